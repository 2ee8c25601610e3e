"""Our units in libcosim, the engine of the Open Simulation Platform. It takes FMI 2, and no enumerations of that.

The other units in it are rows of docs/hosts.md (`make hosts`).
"""

from collections.abc import Callable
from pathlib import Path

import drive
import pytest
import systems
from libcosim_job import Job, needs_libcosim, without_enumerations
from own_master import Placed, run_in_our_own
from reference import References, description, expect_same

from handover.fmus.build import cached
from handover.fmus.catalog import UNITS

pytestmark = needs_libcosim

LIGHT = "FreeFlyer"


def test_a_unit_driven_by_libcosim_is_the_same_as_in_our_own_master(references: References, tmp_path: Path):
    unit = LIGHT
    d = description(unit)
    driven = [drive.inputs(d, k) for k in range(drive.STEPS)]
    placed = Placed(cached(unit, 2), {**drive.parameters(d), **driven[0]})
    job = Job({"unit": placed}, UNITS[unit].step, drive.STEPS, driven={"unit": driven})
    wanted = without_enumerations(references.varying(unit, 2), job.description("unit"))
    expect_same(job.run(tmp_path)["unit"], wanted, first=1)


@pytest.mark.slow
@pytest.mark.parametrize("wire", [systems.free_flyer, systems.grasp, systems.vsl])
def test_a_closed_loop_in_libcosim_is_the_same_as_in_our_own_master(
    wire: Callable[[int], systems.Wired], tmp_path: Path
):
    units, connections, step = wire(2)
    job = Job(units, step, 40, connections)
    found, wanted = job.run(tmp_path), run_in_our_own(units, connections, step, 40)
    for name in units:
        assert wanted[name].rows[1] != wanted[name].rows[-1]
        expect_same(found[name], without_enumerations(wanted[name], job.description(name)), first=1)
