"""Steps of isolated units that go on in their processes while the master steps other units.

A unit's step is begun when its inputs are set, and finished when something needs its outputs, at the latest at the end
of the communication step. Units that do not read each other's outputs so step at the same time, with the results of one
after another.
"""

import contextlib
from collections.abc import Callable, Generator, Sequence

from handover.cosim.exceptions import UnitFailure
from handover.cosim.stepping.ensemble import Ensemble
from handover.cosim.system.schedule import Slot


class PendingSteps:
    """The steps that were begun and not finished, in the order of the units.

    Args:
        ensemble: the units.
        finish: waits for a unit's step, and does what follows it.
    """

    def __init__(self, ensemble: Ensemble, finish: Callable[[Slot], None]) -> None:
        self._ensemble, self._finish = ensemble, finish
        self._slots: list[Slot] = []

    def begin(self, slot: Slot, t: float) -> bool:
        """Begin a unit's step at t, if it is isolated; return whether it is."""
        if not self._ensemble.begin(slot.unit, t, slot.period):
            return False
        self._slots.append(slot)
        return True

    def finish_sources(self, unit: str) -> None:
        """Finish the steps of units that feed a unit, and those before them.

        Raises:
            UnitFailure: a step failed.
        """
        for _ in range(n_sources(self._ensemble, unit, self._slots)):
            self._finish(self._slots.pop(0))

    def finish(self) -> None:
        """Finish all steps.

        Raises:
            UnitFailure: one failed.
        """
        while self._slots:
            self._finish(self._slots.pop(0))

    @contextlib.contextmanager
    def failing_first(self, before: Sequence[Slot] | None = None) -> Generator[None, None, None]:
        """Do something with a unit: where that fails, failures of units that come before it are raised in its place.

        These are all that were begun, or those of them that `before` has. What is no failure of a unit passes at once.

        Raises:
            UnitFailure: a step that was begun failed.
        """
        try:
            yield
        except UnitFailure:
            self._slots = [slot for slot in self._slots if before is None or slot in before]
            self.finish()
            raise


def n_sources(ensemble: Ensemble, unit: str, begun: Sequence[Slot]) -> int:
    """Return how many of the steps that were begun, from the first on, have to be finished before a unit is fed."""
    sources = {source.unit for source in ensemble.system.sources_of(unit).values()}
    return max((i + 1 for i, slot in enumerate(begun) if slot.unit in sources), default=0)
