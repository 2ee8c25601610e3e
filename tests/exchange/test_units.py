"""A unit gives in a foreign host what it gives alone in our own master, and parameters and inputs act on it.

Which unit runs where is a table: two in FMPy and in a program in C that has no Python in it at each change, in the slow
tier those with other kinds of ports and packages, and by `make hosts` all forms in all hosts (docs/hosts.md).
"""

import os
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from support.exchange.drive import STEPS, inputs, parameters, scalars
from support.exchange.host_runs import HOSTS, Case, Form, fmu_of
from support.exchange.reference import FMI2_UNITS, References, description, expect_same, variables

from handover.cosim.blocks.variable import element_names
from handover.fmus import interpreter
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS

HOST: Any = fmpy
FMPY, C = ("FMPy", Form.FMI3), ("C program", Form.FMI2)
QUICK = {"HandoverPartner": FMPY, "Thrusters": C}
SLOW = {
    "TendonArm": C,
    "StereoCamera": C,
    "HandoverVision": FMPY,
    "VslArm": FMPY,
    "HybridKinematics": C,
    "ImpedanceController": FMPY,
    "HandAndObject": FMPY,
    "HandoverStateMachine": FMPY,
    "HandoverTeam": C,
    "GraspScene": FMPY,
    "IrReflex": C,
}
TRIED = [
    *((unit, *where) for unit, where in QUICK.items()),
    *(pytest.param(unit, *where, marks=pytest.mark.slow) for unit, where in SLOW.items()),
]


@pytest.mark.parametrize(("unit", "host", "form"), TRIED)
def test_a_host_gives_the_same_by_which_parameters_and_inputs_act(
    references: References, unit: str, host: str, form: Form, tmp_path: Path
):
    if host == "C program" and (os.name == "nt" or not interpreter.library()):
        pytest.skip("c_program.c loads libraries with dlopen, and units a shared library of Python")
    form = form if unit in FMI2_UNITS else Form.FMI3
    wanted, held, untouched = (f(unit, 3) for f in (references.varying, references.held, references.untouched))
    case = Case(unit, form, lambda fmi: fmu_of(unit, form, fmi, tmp_path), references, ())
    found = HOSTS[host](case, tmp_path).found
    expect_same(found.rows, wanted)
    assert found.pictures == wanted.pictures
    assert not wanted.is_like(untouched)
    assert not held.is_like(untouched)
    assert wanted.is_like(held) is not bool(description(unit).inputs)


def test_fmpys_own_simulation_gives_the_same(references: References):
    """With signals for all inputs, and outputs that are all scalars."""
    unit = "HandoverPartner"
    d, known, step = description(unit), variables(unit), float(UNITS[unit].step)
    rows = [scalars(known, inputs(d, k)) for k in range(STEPS + 1)]
    times = [k * step for k in range(STEPS + 1)]
    columns: list[tuple[str, Any]] = [("time", float), *((name, type(value)) for name, value in rows[0].items())]
    outputs = [name for v in d.outputs for name in element_names(v)]
    result = HOST.simulate_fmu(
        str(cached(unit, 2)),
        stop_time=times[-1],
        output_interval=step,
        start_values=scalars(known, parameters(d)),
        input=np.array([(t, *row.values()) for t, row in zip(times, rows, strict=True)], dtype=columns),
        output=outputs,
    )
    assert result["time"] == pytest.approx(times, abs=1e-12)
    expect_same([{name: float(row[name]) for name in outputs} for row in result], references.varying(unit, 3))
