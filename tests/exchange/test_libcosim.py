"""Our units in libcosim, the engine of the Open Simulation Platform. It takes FMI 2."""

from pathlib import Path

import drive
import pytest
from libcosim_job import Job, Placed
from reference import FMI2_UNITS, References, description, expect_same

from fmus.build import cached
from fmus.catalog import UNITS

LIGHT = "HandoverPartner"


@pytest.mark.parametrize("unit", [n if n == LIGHT else pytest.param(n, marks=pytest.mark.slow) for n in FMI2_UNITS])
def test_a_unit_driven_by_libcosim_is_the_same_as_in_our_own_master(
    unit: str, references: References, tmp_path: Path
):
    d = description(unit)
    driven = [drive.inputs(d, k) for k in range(drive.STEPS)]
    placed = Placed(cached(unit, 2), {**drive.parameters(d), **driven[0]}, driven)
    found = Job({"unit": placed}, UNITS[unit].step, drive.STEPS).run(tmp_path)
    expect_same(found["unit"], references.varying(unit, 2), first=1)
