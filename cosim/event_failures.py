"""What ends a run at an event, or at a step that a unit does not take."""

from collections.abc import Iterable, Sequence

from cosim.exceptions import UnitFailure


class EndRequested(UnitFailure):
    """A unit asked for the end of the simulation; what observers saw before is complete."""

    def __init__(self, unit: str, call: str, t: float, log: Sequence[str] = ()) -> None:
        super().__init__(unit, call, t, "a request to end the simulation", log)


class StepDiscarded(UnitFailure):
    """A unit did not carry out a step, and the step cannot be repeated shorter, for the reason given."""

    def __init__(self, unit: str, call: str, t: float, reached: float, reason: str, log: Sequence[str] = ()) -> None:
        status = f"Discard: it came to t = {reached:.9g} s; {reason}"
        super().__init__(unit, call, t, status, log)
        self.reached, self.reason = reached, reason

    @property
    def told(self) -> str:
        """What was answered, which says more than the unit's log of the same."""
        return self.status


class UnsettledEvents(UnitFailure):
    """Units in event mode that keep changing each other's inputs, or asking for one more iteration."""

    def __init__(self, units: Iterable[str], t: float, iterations: int, call: str = "fmi3UpdateDiscreteStates") -> None:
        self.units = tuple(units)
        status = f"no end of events after {iterations} iterations; these do not settle: {', '.join(self.units)}"
        super().__init__(self.units[0], call, t, status)
