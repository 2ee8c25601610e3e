"""Every state that is saved is freed, whatever happens, but for units that must not be called any more."""

import ctypes
from collections import Counter
from contextlib import nullcontext
from fractions import Fraction
from typing import cast

import pytest
from support.cosim.call_log import CallLog
from support.cosim.native_units import native_fmu

from handover.cosim.exceptions import UnitFailure
from handover.cosim.fmu.instance import Instance
from handover.cosim.master.master import Master
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, MasterOptions
from handover.cosim.stepping.pending_steps import PendingSteps
from handover.cosim.system.schedule import Slot
from handover.cosim.system.system import System

OPTIONS = {
    "newton": MasterOptions(algorithm=Algorithm.NEWTON),
    "adaptive": MasterOptions(adaptive=AdaptiveStep()),
    "events": MasterOptions(repeat_discarded=True),
    "adaptive newton": MasterOptions(algorithm=Algorithm.NEWTON, adaptive=AdaptiveStep()),
    "events newton": MasterOptions(algorithm=Algorithm.NEWTON, repeat_discarded=True),
}


FAULTS = ("errs", "gives_nan", "ends", "fatal")


def cycle(fault: str, fmi: int, at: float = 0.4) -> System:
    """Return a cycle of an integrator and a unit that fails at a time in seconds, and one beside it."""
    s = System()
    steady, bad = s.add("steady", native_fmu("integrator", fmi)), s.add("bad", native_fmu(fault, fmi), at=at)
    s.add("beside", native_fmu("integrator", fmi))
    s.connect(steady.y.x, bad.u.u)
    s.connect(bad.y.y, steady.u.u)
    return s


def kept(call_log: CallLog, fmi: int) -> dict[str, int]:
    """Return how many states of each unit were saved and not freed."""
    state = "FMUstate" if fmi == 2 else "FMUState"
    count = Counter(call_log.calls)
    units = {unit for unit, _ in call_log.calls}
    return {u: count[u, f"fmi{fmi}Get{state}"] - count[u, f"fmi{fmi}Free{state}"] for u in sorted(units)}


@pytest.mark.parametrize(
    ("fault", "way", "fmi"),
    [
        *((fault, way, 2 + (i + k) % 2) for i, fault in enumerate(FAULTS) for k, way in enumerate(OPTIONS) if k < 3),
        *((fault, way, 3) for fault in ("errs", "fatal") for way in ("adaptive newton", "events newton")),
    ],
)
def test_states_are_freed_unless_their_unit_must_not_be_called(fault: str, fmi: int, way: str):
    call_log = CallLog()
    with (
        nullcontext() if fault == "ends" else pytest.raises(UnitFailure),
        Master(cycle(fault, fmi), OPTIONS[way], call_log) as master,
    ):
        master.run(Fraction(1))
        assert master.ended is not None
    assert ("steady", f"fmi{fmi}GetFMU{'s' if fmi == 2 else 'S'}tate") in call_log.calls
    left = kept(call_log, fmi)
    assert (left["steady"], left["beside"]) == (0, 0)
    assert (left["bad"] > 0) == (fault == "fatal")
    if fault == "fatal":
        assert call_log.after("bad", f"fmi{fmi}DoStep", "bad") == []


@pytest.mark.parametrize("options", [OPTIONS["newton"], OPTIONS["adaptive"]], ids=["newton", "adaptive"])
def test_states_are_freed_where_a_unit_does_not_save_its_own(options: MasterOptions, monkeypatch: pytest.MonkeyPatch):
    call_log, save = CallLog(), Instance.save_state

    def save_until_04(self: Instance) -> ctypes.c_void_p:
        if self.name == "bad" and self.time > 0.39:
            self.judge("fmi3GetFMUState", 3)
        return save(self)

    monkeypatch.setattr(Instance, "save_state", save_until_04)
    with (
        pytest.raises(UnitFailure, match="GetFMUState"),
        Master(cycle("ends", 3, at=10.0), options, call_log) as master,
    ):
        master.run(Fraction(1))
    assert kept(call_log, 3) == {"bad": 0, "beside": 0, "steady": 0}


class Isolated:
    """All units are isolated, and begin."""

    def begin(self, unit: str, t: float, dt: float) -> bool:  # noqa: ARG002
        return True


def begun(finished: list[str]) -> PendingSteps:
    """Return the step of a, which fails as it is finished."""

    def finish(slot: Slot) -> None:
        finished.append(slot.unit)
        raise UnitFailure(slot.unit, "fmi3DoStep", 0.0, "Error")

    pending = PendingSteps(cast("Ensemble", Isolated()), finish)
    assert pending.begin(Slot("a", 1, 0.1), 0.0)
    return pending


def test_a_unit_that_comes_before_fails_first_but_only_where_one_has_failed():
    finished: list[str] = []
    with pytest.raises(UnitFailure, match=r"^a: "), begun(finished).failing_first():
        raise UnitFailure("b", "fmi3DoStep", 0.0, "Error")
    assert finished == ["a"]
    with pytest.raises(ZeroDivisionError), begun(finished).failing_first():
        raise ZeroDivisionError
    assert finished == ["a"]
