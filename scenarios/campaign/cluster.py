"""The workers of a Dask cluster as a worker pool.

Waiting, for a while, for who may never answer.
"""

import contextlib
import itertools
import queue
import threading
import time
import uuid
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

from distributed import Client, Future, KilledWorker

from handover.cosim.exceptions import one_line
from handover.scenarios.campaign.worker import (
    difference,
    end_runs,
    fault_of_folder,
    package_versions,
    run_job_on_worker,
)
from handover.scenarios.campaign.worker_pool import JobResult, RunJob
from handover.scenarios.execution.errors import ClusterLost, PoolError
from handover.scenarios.results.run_folder import disk_errors_reported, versions

_T = TypeVar("_T")


def call_with_timeout(ask: Callable[[], _T], bound: float) -> _T:
    """Return what a function returns that is called in a thread of its own.

    So it may run an event loop where the caller's thread has one already, as in a notebook.

    Args:
        ask: asks and waits for the answer.
        bound: how long it gets, s; after that it is left alone.

    Raises:
        TimeoutError: it has not returned in time. What it raises itself, besides.
    """
    value: queue.SimpleQueue[tuple[_T] | Exception] = queue.SimpleQueue()

    def wait() -> None:
        try:
            value.put((ask(),))
        except Exception as e:  # raised where it is waited for
            value.put(e)

    threading.Thread(target=wait, daemon=True).start()
    try:
        result = value.get(timeout=bound)
    except queue.Empty:
        raise TimeoutError(f"no answer within {bound:g} s") from None
    if isinstance(result, Exception):
        raise result
    return result[0]


_AHEAD = 2
"""Orders that the scheduler holds for each thread: one that is carried out and one that waits.

Of many thousand it would hold many thousand, and take their workers' loss for their fault.
"""

_MAX_REPORTED = 3
"""Workers that a refusal names."""

_POLL_INTERVAL = 5.0
"""How often it is looked whether there are workers while no run ends, s."""

_WITHOUT = 60.0
"""For how long a cluster may have no worker, s: those that watch them start others."""

_BOUND = 10.0
"""How long workers get to answer what is asked of all, s."""


class ClusterPool:
    """The workers of a Dask cluster.

    Args:
        client: connected to the cluster's scheduler.
        name: what the cluster is called where something is wrong with it.
    """

    def __init__(self, client: Client, name: str) -> None:
        self._client, self._name = client, name
        self._batch = uuid.uuid4().hex
        self._versions = versions()

    @property
    def workers(self) -> int:
        """How many runs go on at the same time."""
        return sum(cast("Mapping[str, int]", self._client.nthreads()).values())

    def check(self, folder: Path) -> None:
        """Check that all workers give the same numbers as this process, and write to the same folder.

        Raises:
            PoolError: some do not; the first of them are named.
            RecordNotWritten: this process cannot write there itself.
        """
        value = self._ask(package_versions)
        self._raise_faults({worker: _difference(self._versions, other) for worker, other in value.items()})
        token = uuid.uuid4().hex
        mark = folder / f".{token}"
        with disk_errors_reported(folder):
            try:
                mark.write_text(token, encoding="utf-8")
                value = self._ask(fault_of_folder, str(folder.absolute()), mark.name, token)
            finally:
                mark.unlink(missing_ok=True)
        self._raise_faults(
            {w: f"cannot use {folder.absolute()}: {fault}" if fault else "" for w, fault in value.items()}
        )

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        """Give each order to a worker; yield the answers as they come.

        A worker that is lost is replaced where something watches it (a nanny), and its run begun anew. If the iteration
        is left before its end, runs under way are ended and leave nothing.

        Raises:
            ClusterLost: the scheduler has gone, or no worker has been there for a while.
        """
        waiting = iter(jobs)
        going: dict[Any, tuple[RunJob, Future[JobResult]]] = {}
        done: queue.SimpleQueue[Future[JobResult]] = queue.SimpleQueue()

        def give() -> None:
            for job in itertools.islice(waiting, max(1, _AHEAD * self.workers - len(going))):
                key = f"run-{uuid.uuid4().hex}"
                future = self._client.submit(run_job_on_worker, job, self._batch, self._versions, key=key, pure=False)
                going[future.key] = job, future
                future.add_done_callback(done.put)

        try:
            give()
            while going:
                job, future = going.pop(self._next(done).key)
                answer = self._result(job, future)
                give()
                yield answer
        finally:
            if going:
                with contextlib.suppress(Exception):  # of a cluster that is gone nothing is left to end
                    self._client.cancel([future for _, future in going.values()], force=True)
                self.end()

    def end(self) -> None:
        """End the runs that workers carry out for this crew, and the servers that they keep for it."""
        ended, self._batch = self._batch, uuid.uuid4().hex  # what comes later is no part of it
        with contextlib.suppress(Exception):
            self._ask(end_runs, ended)

    def _next(self, done: "queue.SimpleQueue[Future[JobResult]]") -> "Future[JobResult]":
        """Wait for a run's end."""
        there = time.monotonic()
        while True:
            with contextlib.suppress(queue.Empty):
                return done.get(timeout=_POLL_INTERVAL)
            if self.workers:
                there = time.monotonic()
            elif time.monotonic() - there > _WITHOUT:
                raise ClusterLost(f"{self._name} has had no worker for {_WITHOUT:g} s")

    def _result(self, job: RunJob, future: "Future[JobResult]") -> JobResult:
        if future.cancelled():
            raise ClusterLost(f"the scheduler of {self._name} is gone")
        error = cast("BaseException | None", future.exception())
        if error is None:
            return future.result()
        if isinstance(error, KilledWorker):
            times = error.allowed_failures + 1
            return JobResult(name=job.name, lost=f"its worker was lost {times} times: killed, or out of memory")
        return JobResult(name=job.name, lost=f"{type(error).__name__}: {one_line(error)}")

    def _ask(self, function: Callable[..., Any], *arguments: str) -> dict[str, Any]:
        """Return what each worker answers, by its address."""

        def ask() -> dict[str, Any]:
            return cast("dict[str, Any]", self._client.run(function, *arguments, on_error="return"))

        try:
            value = call_with_timeout(ask, _BOUND)
        except Exception as e:  # what a cluster's end leads to
            raise PoolError(f"the workers of {self._name} do not answer: {one_line(e)}") from e
        return {f"worker {worker}": answer for worker, answer in value.items()}

    def _raise_faults(self, faults: Mapping[str, str]) -> None:
        """Raise PoolError if there is a fault."""
        bad = [f"{worker} {fault}" for worker, fault in faults.items() if fault]
        if bad:
            more = f"; and {len(bad) - _MAX_REPORTED} workers more" if len(bad) > _MAX_REPORTED else ""
            raise PoolError(f"{self._name} cannot be used: {'; '.join(bad[:_MAX_REPORTED])}{more}")


def _difference(here: Mapping[str, str], there: Any) -> str:
    if isinstance(there, BaseException):
        return f"cannot run this package: {type(there).__name__}: {one_line(there)}"
    return difference(here, there)
