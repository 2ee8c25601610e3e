"""Every unit in FMPy and in a program in C that has no Python in it gives what it gives alone in our own master.

Here it is judged whether a unit is sound; what all hosts make of all its forms is docs/hosts.md (`make hosts`).
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from support.exchange.drive import STEPS, inputs, parameters, scalars
from support.exchange.host_runs import Case, Form, fmu_of, in_c_program, in_fmpy
from support.exchange.reference import FMI2_UNITS, References, description, expect_same, variables

from handover.cosim.blocks.variable import element_names
from handover.fmus import interpreter
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS

HOST: Any = fmpy
LIGHT = ("HandoverPartner", "Thrusters")
"""Units whose tests are quick."""

EVERY = [name if name in LIGHT else pytest.param(name, marks=pytest.mark.slow) for name in UNITS]


def case(unit: str, form: Form, references: References, folder: Path) -> Case:
    return Case(unit, form, lambda fmi: fmu_of(unit, form, fmi, folder), references, ())


@pytest.mark.parametrize("unit", EVERY)
def test_fmpy_gives_the_same_by_which_parameters_and_inputs_act(references: References, unit: str, tmp_path: Path):
    wanted, held, untouched = (f(unit, 3) for f in (references.varying, references.held, references.untouched))
    found = in_fmpy(case(unit, Form.FMI3, references, tmp_path), tmp_path).found
    expect_same(found.rows, wanted)
    assert found.pictures == wanted.pictures
    assert not wanted.is_like(untouched)
    assert not held.is_like(untouched)
    assert wanted.is_like(held) is not bool(description(unit).inputs)


@pytest.mark.skipif(os.name == "nt", reason="c_program.c loads libraries with dlopen")
@pytest.mark.skipif(not interpreter.library(), reason="this Python has no shared library that a C program can load")
@pytest.mark.parametrize("unit", EVERY)
def test_a_program_in_c_gives_the_same(references: References, unit: str, tmp_path: Path):
    form = Form.FMI2 if unit in FMI2_UNITS else Form.FMI3
    found = in_c_program(case(unit, form, references, tmp_path), tmp_path).found
    wanted = references.varying(unit, 3)
    expect_same(found.rows, wanted)
    assert found.pictures == wanted.pictures


@pytest.mark.parametrize(("unit", "fmi"), [(LIGHT[0], 2), (LIGHT[1], 3)])
def test_fmpys_own_simulation_gives_the_same(references: References, unit: str, fmi: int):
    expect_same(simulated(unit, cached(unit, fmi, scalar=fmi == 3)), references.varying(unit, 3))


def simulated(unit: str, fmu: Path) -> Sequence[Mapping[str, float]]:
    """Simulate with signals for all inputs; return the outputs, all of which are scalars."""
    d, known, step = description(unit), variables(unit), float(UNITS[unit].step)
    rows = [scalars(known, inputs(d, k)) for k in range(STEPS + 1)]
    times = [k * step for k in range(STEPS + 1)]
    columns: list[tuple[str, Any]] = [("time", float), *((name, type(value)) for name, value in rows[0].items())]
    outputs = [name for v in d.outputs for name in element_names(v)]
    result = HOST.simulate_fmu(
        str(fmu),
        stop_time=times[-1],
        output_interval=step,
        start_values=scalars(known, parameters(d)),
        input=np.array([(t, *row.values()) for t, row in zip(times, rows, strict=True)], dtype=columns),
        output=outputs,
    )
    assert result["time"] == pytest.approx(times, abs=1e-12)
    return [{name: float(row[name]) for name in outputs} for row in result]
