"""Calls that answer Warning are counted: in the plan, on the general path and in a process of the unit's own alike."""

from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from support.faults.faulty_units import faulty_fmu

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.unit_warnings import WarningData
from handover.cosim.master.checkpoint import read_checkpoint, take_checkpoint, write_checkpoint
from handover.cosim.master.master import Master
from handover.cosim.plan.plan_stepper import PlanStepper
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.system import System

FMI_CALLS = {
    2: ("SetReal", "GetReal", "SetupExperiment"),
    3: ("SetFloat64", "GetFloat64", None),
}
"""What the standards call differently, None where one has no such call."""


def reported(fmi: int, call: str, folder: Path, **options: Any) -> list[WarningData]:
    """Run for 1 s a unit that warns in a call, from 0.3 s on where it steps, between two sound ones."""
    s = System()
    sound, warning = faulty_fmu("sound", fmi, folder), faulty_fmu(f"warning_in_{call}", fmi, folder)
    a, b, c = s.add("a", sound), s.add("b", warning), s.add("c", sound)
    s.connect(a.y.y, b.u.u)
    s.connect(b.y.y, c.u.u)
    with Master(s, MasterOptions(**options)) as master:
        master.run(Fraction(1, 2))
        master.run(Fraction(1))
        assert isinstance(master.stepper, PlanStepper) == options.get("compiled", True)
    return [warnings.as_data(unit) for unit, warnings in master.warnings.items()]


def right(fmi: int, **calls: int) -> list[WarningData]:
    n = {f"fmi{fmi}{call}": n for call, n in calls.items()}
    return [WarningData(instance="b", calls=n, time=0.3, message="step: the step size was halved")]


WAYS: dict[str, dict[str, Any]] = {
    "plan": {},
    "general path": {"compiled": False},
    "isolated, plan": {"isolated": ("b",)},
    "isolated, general path": {"isolated": ("b",), "compiled": False},
}


@pytest.mark.parametrize(("fmi", "algorithm"), [(2, Algorithm.GAUSS_SEIDEL), (3, Algorithm.JACOBI)])
def test_all_calls_that_warn_are_counted_alike_on_all_paths(fmi: int, algorithm: Algorithm, tmp_path: Path):
    """Also those of initialisation and termination, and what an isolated unit is set to later than it was asked for."""
    ways = {way: reported(fmi, "all", tmp_path, algorithm=algorithm, **options) for way, options in WAYS.items()}
    (first,) = ways["plan"]
    setting, getting, setup = FMI_CALLS[fmi]
    gets = 9 if algorithm is Algorithm.JACOBI else 8  # which gets outputs as it arrives, so twice where runs meet
    once = [name for name in (setup, "EnterInitializationMode", "ExitInitializationMode", "Terminate") if name]
    assert first["calls"] == {f"fmi{fmi}{call}": 1 for call in once} | {
        f"fmi{fmi}{setting}": 7, f"fmi{fmi}DoStep": 7, f"fmi{fmi}{getting}": gets
    }  # fmt: skip
    assert (first["time"], first["message"]) == (0.0, "terminate: the step size was halved")
    assert [way for way, data in ways.items() if data != ways["plan"]] == []


@pytest.mark.parametrize("compiled", [True, False], ids=["plan", "general path"])
def test_a_resumed_run_counts_on(compiled: bool, tmp_path: Path):
    def system() -> System:
        s = System()
        s.add("b", faulty_fmu("warning_in_step", 3, tmp_path))
        return s

    options = MasterOptions(compiled=compiled)
    with Master(system(), options) as master:
        master.run(Fraction(1, 2))
        write_checkpoint(tmp_path / "c.zip", take_checkpoint(master, 0))
    with Master(system(), options) as master:
        read_checkpoint(tmp_path / "c.zip").restore(master)
        master.run(Fraction(1))
    assert [master.warnings["b"].as_data("b")] == right(3, DoStep=7)


def test_a_plan_that_stops_has_counted_the_steps_before(tmp_path: Path):
    counts: list[object] = []
    for options in WAYS.values():
        s = System()
        s.add("b", faulty_fmu("warning_in_step", 2, tmp_path))
        s.add("c", faulty_fmu("error_in_step", 2, tmp_path))
        with Master(s, MasterOptions(**options)) as master, pytest.raises(UnitFailure):
            master.run(Fraction(1))
        counts.append(master.warnings["b"].as_data("b"))
    assert counts == [right(2, DoStep=1)[0]] * len(WAYS)
