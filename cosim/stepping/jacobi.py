"""Jacobi coupling: all units step from the values at a communication point, as if in parallel."""

from collections.abc import Mapping, Sequence
from typing import Any

from handover.cosim.stepping.ensemble import Ensemble, LastStep
from handover.cosim.stepping.iteration import IterationCount
from handover.cosim.system.schedule import Slot


class Jacobi:
    """A step's results count from the time where it ends, for sampled units too.

    Direct feedthrough takes effect a step later here, so there is no algebraic loop to solve but at the start.
    Also called the parallel scheme: C. Gomes et al., Co-simulation: a survey, ACM Comput. Surv. 51 (2018) 49.
    """

    def __init__(self, ensemble: Ensemble) -> None:
        self._ensemble = ensemble
        self.count = IterationCount()

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:  # noqa: ARG002
        """Fetch what steps that end at t have computed."""
        for slot in (*sampled, *continuous):
            self._ensemble.publish(slot.unit)

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:
        """Set all inputs, then step."""
        due = (*sampled, *continuous)
        for slot in sampled:
            self._ensemble.feed(slot.unit, t)
        for slot in continuous:
            self._ensemble.feed(slot.unit, t, slot.period)
        last = LastStep()
        with self._ensemble.stopwatch() as charge:
            for slot in due:
                with last.completed():
                    self._ensemble.step(slot.unit, t, slot.period)
                charge(slot.unit)
        last.end()

    def get_state(self) -> Mapping[str, Any]:
        """Return nothing: all is in the units' states; see `Coupling`."""
        return {}

    def set_state(self, state: Mapping[str, Any]) -> None:
        """Do nothing; see `Coupling`."""
