"""What ends a run at an event, or at a step that a unit does not take."""

from collections.abc import Iterable, Sequence
from typing import Any

from handover.cosim.exceptions import UnitFailure
from handover.cosim.failures import UnitDiscarded


class StepDiscarded(UnitDiscarded):
    """A unit did not carry out a step, and the step is not repeated shorter.

    Attributes:
        reached: the time in seconds until which its step was successful; in FMI 3 the step's begin.
        reason: why it is not repeated.
    """

    def __init__(self, unit: str, call: str, t: float, reached: float, reason: str, log: Sequence[str] = ()) -> None:
        self.reason = reason
        super().__init__(unit, call, t, log, reached)

    @property
    def what(self) -> str:
        """What happened, with the time that was reached and the reason."""
        return f"{super().what}; {self.reason}"

    @property
    def told(self) -> str:
        """What the unit logged last, and the reason."""
        return f"{super().told} ({self.reason})"


class UnsettledEvents(UnitFailure):
    """Units in event mode that keep changing each other's inputs, or asking for one more iteration."""

    kind = "unsettled"

    def __init__(self, units: Iterable[str], t: float, iterations: int, call: str = "fmi3UpdateDiscreteStates") -> None:
        self.units = tuple(units)
        status = f"no end of events after {iterations} iterations; these do not settle: {', '.join(self.units)}"
        super().__init__(self.units[0], call, t, status)

    def as_data(self) -> dict[str, Any]:
        """Return the failure as JSON can hold it."""
        return {**super().as_data(), "units": list(self.units)}
