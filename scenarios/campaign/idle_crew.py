"""Workers of a campaign that seems to need none: they are started only if a run is to be carried out after all."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from scenarios.campaign.crew import Crew
from scenarios.campaign.run_order import RunAnswer, RunOrder


class IdleCrew:
    """Starts a crew with its first order, as when the folder of a run that is done cannot be read.

    Args:
        start: gives the crew.
    """

    def __init__(self, start: Callable[[], contextlib.AbstractContextManager[Crew]]) -> None:
        self._start = start

    @property
    def workers(self) -> int:
        """How many runs go on at the same time: none."""
        return 0

    def check(self, folder: Path) -> None:
        """Check nothing: there are no workers."""

    def carry_out(self, orders: Sequence[RunOrder]) -> Iterator[RunAnswer]:
        """Start the crew, check it, and let it carry out orders.

        Raises:
            BadCrew: it cannot be started or used. CrewLost: it has gone.
        """
        with self._start() as crew:
            crew.check(Path(orders[0].runs))
            yield from crew.carry_out(orders)
