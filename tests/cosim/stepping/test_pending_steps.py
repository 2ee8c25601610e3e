"""Where something fails beside steps that were begun, failures of units are raised in the order of one process."""

from typing import cast

import pytest

from handover.cosim.exceptions import UnitFailure
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.stepping.pending_steps import PendingSteps
from handover.cosim.system.schedule import Slot


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


def test_a_unit_that_comes_before_fails_first():
    finished: list[str] = []
    with pytest.raises(UnitFailure, match=r"^a: "), begun(finished).failing_first():
        raise UnitFailure("b", "fmi3DoStep", 0.0, "Error")
    assert finished == ["a"]


def test_what_is_no_failure_of_a_unit_is_not_replaced_by_one():
    finished: list[str] = []
    with pytest.raises(ZeroDivisionError), begun(finished).failing_first():
        raise ZeroDivisionError
    assert finished == []
