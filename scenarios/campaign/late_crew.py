"""Workers of a campaign that are started when its folder is held, so that no other command can take it meanwhile."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

from scenarios.campaign.crew import Crew
from scenarios.campaign.run_order import RunAnswer, RunOrder


class LateCrew:
    """Starts a crew when it is checked.

    Args:
        start: gives the crew.
        opened: ends it.
    """

    def __init__(
        self, start: Callable[[], contextlib.AbstractContextManager[Crew]], opened: contextlib.ExitStack
    ) -> None:
        self._start, self._opened = start, opened
        self._crew: Crew | None = None

    @property
    def workers(self) -> int:
        """How many runs go on at the same time."""
        return 0 if self._crew is None else self._crew.workers

    def check(self, folder: Path) -> None:
        """Start the crew and check it.

        Raises:
            BadCrew: it cannot be started or used.
        """
        self._crew = self._opened.enter_context(self._start())
        self._crew.check(folder)

    def carry_out(self, orders: Sequence[RunOrder]) -> Iterator[RunAnswer]:
        """Let the crew carry out orders, after `check`.

        Raises:
            CrewLost: it has gone.
        """
        if self._crew is None:
            raise RuntimeError("check the crew first: that starts it")
        return self._crew.carry_out(orders)
