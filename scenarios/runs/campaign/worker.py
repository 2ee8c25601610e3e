"""What a worker of a Dask cluster does for a campaign: functions that the campaign's process calls there.

Each thread of a worker has a run server. All jobs of one worker pool have the same `batch`, by which they can be ended
together.
"""

import functools
import os
import threading
from collections.abc import Mapping
from pathlib import Path

from distributed import get_worker

from handover.scenarios.runs.campaign.run_servers import JobRunner, end_runners
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob
from handover.scenarios.runs.results.run_folder import version_differences, versions

_runners: dict[tuple[str, int], JobRunner] = {}
"""By batch and thread."""

_ended: set[str] = set()
"""Batches whose runs are not wanted any more."""

_lock = threading.Lock()


def run_job_on_worker(job: RunJob, batch: str, wanted_versions: Mapping[str, str]) -> JobResult:
    """Run a job of a batch.

    A worker that joined after the others were checked may be of other versions; it runs nothing.
    """
    worker = get_worker()
    if fault := fault_of_versions(wanted_versions, worker_versions()):
        return JobResult(name=job.name, lost=f"worker {worker.address} {fault}")
    task = worker.get_current_task()

    def wanted() -> bool:
        known = worker.state.tasks.get(task)
        return batch not in _ended and known is not None and known.state in ("executing", "long-running")

    runner = JobRunner()
    with _lock:
        if batch not in _ended:  # jobs that waited here still come until the scheduler has cancelled them
            runner = _runners.setdefault((batch, threading.get_ident()), runner)
    return runner.run(job, wanted)


def end_runs(batch: str) -> None:
    """End the runs of a batch in this worker, and its servers."""
    with _lock:
        _ended.add(batch)
        runners = [_runners.pop(key) for key in list(_runners) if key[0] == batch]
    end_runners(runners)


@functools.cache
def worker_versions() -> dict[str, str]:
    """Return the versions of the packages on which a run's numbers depend, those when this worker was first asked."""
    return versions()


def fault_of_versions(here: Mapping[str, str], there: Mapping[str, str]) -> str:
    """Return which versions of a worker differ, as a predicate; "" if none does."""
    other = version_differences(here, there)
    return f"has other versions: {other}" if other else ""


def fault_of_folder(folder: str, file: str, content: str) -> str:
    """Return why this worker cannot write to a folder in which the campaign has written a file, "" if it can."""
    try:
        if Path(folder, file).read_text(encoding="utf-8") != content:
            return "it sees another folder of that name"
    except OSError as e:
        return f"it does not see what is written there ({e.strerror})"
    return "" if os.access(folder, os.W_OK | os.X_OK) else "it may not write there"
