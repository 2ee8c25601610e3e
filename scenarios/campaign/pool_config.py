"""Who is to carry out a campaign's runs, as the call says: workers of this machine, or those of a scheduler.

Workers of a campaign that are started when its folder is held, so that no other command can take it meanwhile.
"""

import contextlib
import functools
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from pathlib import Path

from handover.scenarios.campaign.worker_pool import JobResult, RunJob, WorkerPool, cores


@dataclass(frozen=True)
class PoolConfig:
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
            PoolError: the address is malformed, or no scheduler answers there.
        """
        if self.scheduler is not None:
            _ = self._address

    def start(self) -> contextlib.AbstractContextManager[WorkerPool]:
        """Return the workers; entering starts them.

        Raises:
            PoolError: here or on entering, if they cannot be started or used.
        """
        from handover.scenarios.campaign.local_cluster import connect_cluster, local_cluster

        return local_cluster(self.workers) if self.scheduler is None else connect_cluster(self._address)

    @functools.cached_property
    def _address(self) -> str:
        """The whole address of the scheduler, found out once."""
        from handover.scenarios.campaign.scheduler import scheduler_address

        return scheduler_address(self.scheduler or "")


class LazyPool:
    """Starts a worker pool when it is checked, or with its first order if it was not: a campaign may seem to need none.

    Args:
        start: gives the worker pool.
        opened: ends it.
    """

    def __init__(
        self, start: Callable[[], contextlib.AbstractContextManager[WorkerPool]], opened: contextlib.ExitStack
    ) -> None:
        self._start, self._opened = start, opened
        self._pool: WorkerPool | None = None

    def check(self, folder: Path) -> None:
        """Start the worker pool and check it.

        Raises:
            PoolError: it cannot be started or used. RecordNotWritten: as `WorkerPool.check`.
        """
        self._pool = self._checked(folder)

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        """Let the worker pool carry out orders.

        Raises:
            PoolError, RecordNotWritten: as `check`, if that was not called. ClusterLost: it has gone.
        """
        pool = self._pool or self._checked(Path(jobs[0].runs))
        return pool.run_jobs(jobs)

    def _checked(self, folder: Path) -> WorkerPool:
        pool = self._opened.enter_context(self._start())
        pool.check(folder)
        return pool
