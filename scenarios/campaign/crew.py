"""Who carries out the runs of a campaign."""

from collections.abc import Iterator, Sequence
from typing import Protocol

from scenarios.campaign.run_order import RunAnswer, RunOrder


class Crew(Protocol):
    """Workers that carry out orders side by side."""

    @property
    def workers(self) -> int:
        """How many runs go on at the same time."""
        ...

    def carry_out(self, orders: Sequence[RunOrder]) -> Iterator[RunAnswer]:
        """Give each order to a worker; yield the answers as they come.

        A worker that is lost is replaced where that is possible, and its run begun anew. If the iteration is left
        before its end, runs under way are ended and leave nothing.
        """
        ...
