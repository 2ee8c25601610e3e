"""The workers of this machine, and the choice between them and those of a Dask scheduler, which start lazily.

On this machine there is a thread for each worker, which gives jobs to a run server. Dask, which takes a while to load,
is imported for the workers of a scheduler alone.
"""

import contextlib
import functools
import queue
import threading
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from handover.cosim.exceptions import counted, one_line
from handover.scenarios.runs.campaign.run_servers import JobRunner, end_runners
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob, WorkerPool, cores, marked


class LocalPool:
    """Run servers of this process, started with their first job. They end with it, however it ends.

    They receive no Ctrl-C: this process does, and ends them.

    Args:
        workers: how many; None for one for each core that this process may use.
    """

    def __init__(self, workers: int | None) -> None:
        self.workers = workers or cores()
        """How many jobs run at the same time."""
        self._runners = [JobRunner() for _ in range(self.workers)]

    def __enter__(self) -> "LocalPool":
        """Return itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """End the run servers."""
        self._end()

    def check(self, folder: Path) -> None:
        """Check that a folder can be written to.

        Raises:
            RecordNotWritten: it cannot.
        """
        with marked(folder):
            pass

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        """Give each job to a run server; yield the results as they come.

        If the iteration is left before its end, runs under way are ended and leave nothing.
        """
        waiting: queue.SimpleQueue[RunJob] = queue.SimpleQueue()
        done: queue.SimpleQueue[JobResult] = queue.SimpleQueue()
        left = threading.Event()
        for job in jobs:
            waiting.put(job)

        def work(runner: JobRunner) -> None:
            while not left.is_set():
                try:
                    job = waiting.get_nowait()
                except queue.Empty:
                    return
                try:
                    done.put(runner.run(job, lambda: not left.is_set()))
                except Exception as e:  # a thread that ends without a result would be waited for without end
                    done.put(JobResult(name=job.name, lost=f"{type(e).__name__}: {one_line(e)}"))

        threads = [threading.Thread(target=work, args=(runner,), daemon=True) for runner in self._runners[: len(jobs)]]
        try:
            for thread in threads:
                thread.start()
            for _ in jobs:
                yield done.get()
        except BaseException:
            left.set()
            self._end()
            raise
        finally:
            for thread in threads:
                if thread.ident is not None:
                    thread.join()

    def _end(self) -> None:
        """End the run servers, and their runs; later jobs get others."""
        ended, self._runners = self._runners, [JobRunner() for _ in range(self.workers)]
        end_runners(ended)


@dataclass(frozen=True)
class PoolConfig:
    """The workers that a command asks for.

    Attributes:
        workers: how many on this machine; None for one a core.
        scheduler: address of a cluster's scheduler, whose workers are used; None for workers on this machine.
    """

    workers: int | None = None
    scheduler: str | None = None

    def __str__(self) -> str:
        """Return such as "2 workers"."""
        if self.scheduler is not None:
            return f"the workers of {self.scheduler}"
        return counted(self.workers or cores(), "worker")

    def check(self) -> None:
        """Check that a scheduler answers at its address.

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
        if self.scheduler is None:
            return LocalPool(self.workers)
        from handover.scenarios.runs.campaign.cluster import connect_cluster

        return connect_cluster(self._address)

    @functools.cached_property
    def _address(self) -> str:
        """The complete address of the scheduler, which is asked once."""
        from handover.scenarios.runs.campaign.scheduler import scheduler_address

        return scheduler_address(self.scheduler or "")


class LazyPool:
    """Starts a worker pool when it is checked, or else with its first job.

    It is checked when the campaign's folder is locked, so that no other command can take the folder while workers
    start. It is not checked where all runs seem done; if one of them then turns out to be damaged, it is started late.

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
        self._pool = self._started(folder)

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        """Let the worker pool run jobs.

        Raises:
            PoolError, RecordNotWritten: as `check`, if that was not called. ClusterLost: all workers were lost.
        """
        pool = self._pool or self._started(Path(jobs[0].runs))
        return pool.run_jobs(jobs)

    def _started(self, folder: Path) -> WorkerPool:
        pool = self._opened.enter_context(self._start())
        pool.check(folder)
        return pool
