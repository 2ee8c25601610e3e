"""Who carries out the runs of a campaign."""

import os
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Protocol

from handover.scenarios.campaign.run_order import RunAnswer, RunOrder


class Crew(Protocol):
    """Workers that carry out orders side by side."""

    def check(self, folder: Path) -> None:
        """Check that all workers give the same numbers as this process would, and write to the same folder.

        Args:
            folder: an existing one, into which runs are to be written.

        Raises:
            BadCrew: some do not. RecordNotWritten: nothing can be written there, as on a full disk.
        """
        ...

    def carry_out(self, orders: Sequence[RunOrder]) -> Generator[RunAnswer, None, None]:
        """Give each order to a worker; yield the answers as they come.

        A worker that is lost is replaced where that is possible, and its run begun anew. If the iteration is left
        before its end, runs under way are ended and leave nothing.

        Raises:
            CrewLost: all of them have gone for good.
        """
        ...


def cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
