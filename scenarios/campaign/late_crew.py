"""Workers of a campaign that are started when its folder is held, so that no other command can take it meanwhile."""

import contextlib
from collections.abc import Callable, Generator, Sequence
from pathlib import Path

from handover.scenarios.campaign.crew import Crew
from handover.scenarios.campaign.run_order import RunAnswer, RunOrder


class LateCrew:
    """Starts a crew when it is checked, or with its first order if it was not: a campaign may seem to need none.

    Args:
        start: gives the crew.
        opened: ends it.
    """

    def __init__(
        self, start: Callable[[], contextlib.AbstractContextManager[Crew]], opened: contextlib.ExitStack
    ) -> None:
        self._start, self._opened = start, opened
        self._crew: Crew | None = None

    def check(self, folder: Path) -> None:
        """Start the crew and check it.

        Raises:
            BadCrew: it cannot be started or used. RecordNotWritten: as `Crew.check`.
        """
        self._crew = self._checked(folder)

    def carry_out(self, orders: Sequence[RunOrder]) -> Generator[RunAnswer, None, None]:
        """Let the crew carry out orders.

        Raises:
            BadCrew, RecordNotWritten: as `check`, if that was not called. CrewLost: it has gone.
        """
        crew = self._crew or self._checked(Path(orders[0].runs))
        return crew.carry_out(orders)

    def _checked(self, folder: Path) -> Crew:
        crew = self._opened.enter_context(self._start())
        crew.check(folder)
        return crew
