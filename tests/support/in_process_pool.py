"""A worker pool in this process, for tests of the code that uses worker pools: it executes runs one after another."""

import contextlib
import os
import shutil
from collections.abc import Callable, Generator, Sequence
from pathlib import Path

from handover.scenarios.runs.campaign import pools
from handover.scenarios.runs.campaign.run_job import run_job
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob


class InProcessPool:
    """Executes real runs; `before` is called with each job and may raise, or return why the run is lost."""

    def __init__(self, before: Callable[[RunJob], str] = lambda _job: "") -> None:
        self.begun: list[str] = []
        self._before = before

    @classmethod
    @contextlib.contextmanager
    def opened(cls, _workers: int | None) -> "Generator[InProcessPool, None, None]":
        """Stand in for `LocalPool`."""
        yield cls()

    def check(self, folder: Path) -> None:
        assert folder.is_dir()

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        for job in jobs:
            self.begun.append(job.name)
            lost = self._before(job)
            if not lost:
                _run(job)
            yield JobResult(name=job.name, lost=lost)


def _run(job: RunJob) -> None:
    unfinished = Path(job.runs) / f".{job.name}"
    try:
        run_job(job, unfinished)
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise
    os.replace(unfinished, Path(job.runs) / job.name)


def use_in_process_pool() -> None:
    """Let this process execute campaigns' runs itself; `before` of a `Command`."""
    pools.LocalPool = InProcessPool.opened  # type: ignore
