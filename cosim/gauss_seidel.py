"""Units step one after another, each from the newest values."""

from collections.abc import Sequence

from cosim.ensemble import Ensemble
from cosim.schedule import Slot


class GaussSeidel:
    """At t, sampled units act on the values at t, then observers see all signals, then the others go on from t."""

    def __init__(self, ensemble: Ensemble) -> None:
        self._ensemble = ensemble

    def arrive(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:  # noqa: ARG002
        """Let sampled units turn the values at t into further values at t."""
        self._one_after_another(t, sampled)

    def depart(self, t: float, sampled: Sequence[Slot], continuous: Sequence[Slot]) -> None:  # noqa: ARG002
        """Step the others; what they give counts for those that follow."""
        self._one_after_another(t, continuous)

    def _one_after_another(self, t: float, due: Sequence[Slot]) -> None:
        with self._ensemble.stopwatch() as charge:
            for slot in due:
                self._ensemble.feed(slot.unit, t, slot.period)
                self._ensemble.step(slot.unit, t, slot.period)
                self._ensemble.publish(slot.unit)
                charge(slot.unit)
