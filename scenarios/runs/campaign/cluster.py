"""The workers of a Dask cluster that the user runs, and calls with a timeout to processes that may never answer.

What a worker does for a campaign comes first: functions that the campaign's process calls there. Each thread of a
worker has a run server. All jobs of one worker pool have the same `batch`, by which they can be ended together.
"""

import contextlib
import functools
import itertools
import logging
import os
import queue
import threading
import uuid
import warnings
from collections.abc import Callable, Generator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar, cast

from dask import config
from distributed import Client, Future, KilledWorker, get_worker

from handover.cosim.exceptions import one_line
from handover.cosim.fmu.heartbeat import PolledClock
from handover.scenarios.runs.campaign.run_servers import JobRunner, end_runners
from handover.scenarios.runs.campaign.worker_pool import JobResult, RunJob, marked
from handover.scenarios.runs.execution.errors import ClusterLost, PoolError
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


_T = TypeVar("_T")

_SILENT = logging.CRITICAL + 1
_LOGGERS = ("distributed", "distributed.client", "distributed.gc", "tornado", "tornado.application", "asyncio")
_FIRST_WORKER_TIMEOUT = 3.0
"""How long is waited for a cluster's first worker, s."""


def call_with_timeout(function: Callable[[], _T], timeout: float) -> _T:
    """Return what a function returns that is called in a thread of its own.

    So it may run an event loop where the caller's thread has one already, as in a notebook.

    Args:
        function: what is called.
        timeout: how long it gets, s; after that its thread is abandoned.

    Raises:
        TimeoutError: it has not returned in time. Besides, what it raises itself.
    """
    answers: queue.SimpleQueue[tuple[_T] | Exception] = queue.SimpleQueue()

    def wait() -> None:
        try:
            answers.put((function(),))
        except Exception as e:  # raised where it is waited for
            answers.put(e)

    threading.Thread(target=wait, daemon=True).start()
    try:
        answer = answers.get(timeout=timeout)
    except queue.Empty:
        raise TimeoutError(f"no answer within {timeout:g} s") from None
    if isinstance(answer, Exception):
        raise answer
    return answer[0]


_AHEAD = 2
"""Jobs that the scheduler holds for each thread: one that runs and one that waits.

If it were given all jobs of a campaign at once, it would hold many thousand on few workers, and count the loss of a
worker as a failure of each of them.
"""

_MAX_REPORTED = 3
"""Workers that an error names."""

_POLL_INTERVAL = 5.0
"""How often is checked whether there are workers while no run ends, s."""

_MAX_TIME_WITHOUT_WORKERS = 60.0
"""For how long a cluster may have no worker, s: nannies restart workers that crashed."""

_ANSWER_TIMEOUT = 10.0
"""How long workers get to answer a question to all of them, s."""


class ClusterPool:
    """The workers of a Dask cluster.

    Args:
        client: connected to the cluster's scheduler.
        name: what the cluster is called in error messages.
    """

    def __init__(self, client: Client, name: str) -> None:
        self._client, self._name = client, name
        self._batch = uuid.uuid4().hex
        self._versions = versions()

    @property
    def workers(self) -> int:
        """How many jobs run at the same time."""
        return sum(cast("Mapping[str, int]", self._client.nthreads()).values())

    def check(self, folder: Path) -> None:
        """Check that all workers compute the same numbers as this process, and write to the same folder.

        Raises:
            PoolError: some do not; the first of them are named.
            RecordNotWritten: this process cannot write there itself.
        """
        found = self._ask(worker_versions)
        self._raise_faults({worker: _fault_of_answer(self._versions, other) for worker, other in found.items()})
        with marked(folder) as mark:
            faults = self._ask(fault_of_folder, str(folder.absolute()), mark, mark)
        self._raise_faults(
            {w: f"cannot use {folder.absolute()}: {fault}" if fault else "" for w, fault in faults.items()}
        )

    def run_jobs(self, jobs: Sequence[RunJob]) -> Generator[JobResult, None, None]:
        """Give each job to a worker; yield the results as they come.

        A worker that is lost is replaced where it has a nanny, and its run is started again. If the iteration is left
        before its end, runs under way are ended and leave nothing.

        Raises:
            ClusterLost: the scheduler is gone, or there has been no worker for a minute.
        """
        waiting = iter(jobs)
        running: dict[Any, tuple[RunJob, Future[JobResult]]] = {}
        done: queue.SimpleQueue[Future[JobResult]] = queue.SimpleQueue()

        def give() -> None:
            for job in itertools.islice(waiting, max(1, _AHEAD * self.workers - len(running))):
                key = f"run-{uuid.uuid4().hex}"
                future = self._client.submit(run_job_on_worker, job, self._batch, self._versions, key=key, pure=False)
                running[future.key] = job, future
                future.add_done_callback(done.put)

        try:
            give()
            while running:
                job, future = running.pop(self._next(done).key)
                result = self._result(job, future)
                give()
                yield result
        finally:
            if running:
                with contextlib.suppress(Exception):  # a cluster that is gone has nothing left to end
                    self._client.cancel([future for _, future in running.values()], force=True)
                self.end()

    def end(self) -> None:
        """End the runs of this pool on the workers, and the run servers that they keep for it."""
        ended, self._batch = self._batch, uuid.uuid4().hex  # later jobs are of another batch
        with contextlib.suppress(Exception):
            self._ask(end_runs, ended)

    def _next(self, done: "queue.SimpleQueue[Future[JobResult]]") -> "Future[JobResult]":
        """Wait for a run's end."""
        without = PolledClock(2 * _POLL_INTERVAL)
        while True:
            with contextlib.suppress(queue.Empty):
                return done.get(timeout=_POLL_INTERVAL)
            if self.workers:
                without.restart()
            elif without.poll() > _MAX_TIME_WITHOUT_WORKERS:
                raise ClusterLost(f"{self._name} has had no worker for {_MAX_TIME_WITHOUT_WORKERS:g} s")

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
            answers = call_with_timeout(ask, _ANSWER_TIMEOUT)
        except Exception as e:  # a cluster that ends may raise anything
            raise PoolError(f"the workers of {self._name} do not answer: {one_line(e)}") from e
        return {f"worker {worker}": answer for worker, answer in answers.items()}

    def _raise_faults(self, faults: Mapping[str, str]) -> None:
        """Raise PoolError if there is a fault."""
        bad = [f"{worker} {fault}" for worker, fault in faults.items() if fault]
        if bad:
            more = f"; and {len(bad) - _MAX_REPORTED} workers more" if len(bad) > _MAX_REPORTED else ""
            raise PoolError(f"{self._name} cannot be used: {'; '.join(bad[:_MAX_REPORTED])}{more}")


def _fault_of_answer(here: Mapping[str, str], there: Any) -> str:
    if isinstance(there, BaseException):
        return f"cannot run this package: {type(there).__name__}: {one_line(there)}"
    return fault_of_versions(here, there)


@contextlib.contextmanager
def connect_cluster(address: str) -> Generator[ClusterPool, None, None]:
    """Connect to a cluster that the user runs; the address is one that `scheduler_address` has returned.

    Raises:
        PoolError: no scheduler answers there, or it has no workers.
    """
    with _quiet(), config.set({"distributed.comm.timeouts.connect": "5s"}), contextlib.ExitStack() as opened:
        try:
            client = opened.enter_context(Client(address, timeout=5, set_as_default=False))
        except (OSError, ValueError) as e:
            raise PoolError(f"the scheduler at {address} cannot be used: {one_line(e)}") from e
        try:
            client.wait_for_workers(1, timeout=_FIRST_WORKER_TIMEOUT)
        except TimeoutError as e:
            raise PoolError(f"the scheduler at {address} has no workers; `dask worker {address}` starts some") from e
        pool = ClusterPool(client, f"the cluster at {address}")
        opened.callback(pool.end)
        yield pool


@contextlib.contextmanager
def _quiet() -> Generator[None, None, None]:
    """Keep Dask's own log and warnings off the terminal: `PoolError` and job results report what matters."""
    loggers = [logging.getLogger(name) for name in _LOGGERS]
    before = [logger.level for logger in loggers]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # such as that versions of Dask's packages differ
        for logger in loggers:
            logger.setLevel(_SILENT)
        try:
            yield
        finally:
            for logger, level in zip(loggers, before, strict=True):
                logger.setLevel(level)
