"""Units in FMPy: its `simulate_fmu` with signals as inputs, and its classes for FMI 3 call by call."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from drive import STEPS, inputs, parameters, scalars
from fmpy_rows import record_in_fmpy
from reference import FMI2_UNITS, References, description, expect_same, variables

from handover.cosim.blocks.variable import element_names
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS

HOST: Any = fmpy
LIGHT = ("HandoverPartner", "Thrusters")
"""Units whose tests are quick."""


def tiered(units: "list[str]") -> list[Any]:
    return [name if name in LIGHT else pytest.param(name, marks=pytest.mark.slow) for name in units]


@pytest.mark.parametrize("unit", tiered(FMI2_UNITS))
def test_fmi2_gives_the_same_simulated(references: References, unit: str):
    expect_same(simulated(unit, cached(unit, 2)), references.varying(unit, 2))


@pytest.mark.parametrize("unit", tiered(FMI2_UNITS))
def test_scalar_fmi3_gives_the_same_simulated(references: References, unit: str):
    expect_same(simulated(unit, cached(unit, 3, scalar=True)), references.varying(unit, 3))


@pytest.mark.parametrize("unit", tiered(list(UNITS)))
def test_fmi3_gives_the_same_call_by_call(references: References, unit: str, tmp_path: Path):
    d, wanted = description(unit), references.varying(unit, 3)
    driven = [inputs(d, k) for k in range(STEPS)]
    found = record_in_fmpy(cached(unit, 3), tmp_path, float(UNITS[unit].step), driven, parameters(d))
    expect_same(found.rows, wanted)
    assert found.pictures == wanted.pictures


def simulated(unit: str, fmu: Path) -> list[Mapping[str, float]]:
    """Simulate with signals for all inputs; return the outputs, all of which are scalars."""
    d, known, step = description(unit), variables(unit), float(UNITS[unit].step)
    rows = [scalars(known, inputs(d, k)) for k in range(STEPS + 1)]
    times = [k * step for k in range(STEPS + 1)]
    signals = None
    if rows[0]:
        columns: list[tuple[str, Any]] = [("time", float), *((name, type(value)) for name, value in rows[0].items())]
        signals = np.array([(t, *row.values()) for t, row in zip(times, rows, strict=True)], dtype=columns)
    outputs = [name for v in d.outputs for name in element_names(v)]
    result = HOST.simulate_fmu(
        str(fmu),
        stop_time=times[-1],
        output_interval=step,
        start_values=scalars(known, parameters(d)),
        input=signals,
        output=outputs,
    )
    assert result["time"] == pytest.approx(times, abs=1e-12)
    return [{name: float(row[name]) for name in outputs} for row in result]
