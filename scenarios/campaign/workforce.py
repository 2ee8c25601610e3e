"""Who is to carry out a campaign's runs, as the call says: workers of this machine, or those of a scheduler."""

import contextlib
import functools
from dataclasses import dataclass

from handover.scenarios.campaign.crew import Crew, cores


@dataclass(frozen=True)
class Workforce:
    """Workers that a call asks for; Dask, which takes a while to load, is loaded when they are needed.

    Attributes:
        workers: how many of this machine; None for one a core.
        scheduler: the address of those of a cluster; None for those of this machine.
    """

    workers: int | None = None
    scheduler: str | None = None

    def __str__(self) -> str:
        """Return such as "2 workers"."""
        if self.scheduler is not None:
            return f"the workers of {self.scheduler}"
        workers = self.workers or cores()
        return f"{workers} worker{'s' if workers > 1 else ''}"

    def check(self) -> None:
        """Find out whether a scheduler is where the call says.

        Raises:
            BadCrew: the address is malformed, or no scheduler answers there.
        """
        if self.scheduler is not None:
            _ = self._address

    def start(self) -> contextlib.AbstractContextManager[Crew]:
        """Return the workers; entering starts them.

        Raises:
            BadCrew: here or on entering, if they cannot be started or used.
        """
        from handover.scenarios.campaign.dask_crew import crew_at, embedded_crew

        return embedded_crew(self.workers) if self.scheduler is None else crew_at(self._address)

    @functools.cached_property
    def _address(self) -> str:
        """The whole address of the scheduler, found out once."""
        from handover.scenarios.campaign.scheduler_address import scheduler_address

        return scheduler_address(self.scheduler or "")
