"""The workers of a Dask cluster as a crew.

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
from handover.scenarios.campaign.worker import carry_out_run, difference, end_runs, fault_of_folder, tell_versions
from handover.scenarios.campaign.worker_pool import RunAnswer, RunOrder
from handover.scenarios.execution.errors import BadCrew, CrewLost
from handover.scenarios.results.run_folder import told_if_not_written, versions

_Answer = TypeVar("_Answer")


def asked_aside(ask: Callable[[], _Answer], bound: float) -> _Answer:
    """Return what a function returns that is called in a thread of its own.

    So it may run an event loop where the caller's thread has one already, as in a notebook.

    Args:
        ask: asks and waits for the answer.
        bound: how long it gets, s; after that it is left alone.

    Raises:
        TimeoutError: it has not returned in time. What it raises itself, besides.
    """
    told: queue.SimpleQueue[tuple[_Answer] | Exception] = queue.SimpleQueue()

    def wait() -> None:
        try:
            told.put((ask(),))
        except Exception as e:  # raised where it is waited for
            told.put(e)

    threading.Thread(target=wait, daemon=True).start()
    try:
        answer = told.get(timeout=bound)
    except queue.Empty:
        raise TimeoutError(f"no answer within {bound:g} s") from None
    if isinstance(answer, Exception):
        raise answer
    return answer[0]


_AHEAD = 2
"""Orders that the scheduler holds for each thread: one that is carried out and one that waits.

Of many thousand it would hold many thousand, and take their workers' loss for their fault.
"""

_MOST_TOLD = 3
"""Workers that a refusal names."""

_LOOK = 5.0
"""How often it is looked whether there are workers while no run ends, s."""

_WITHOUT = 60.0
"""For how long a cluster may have no worker, s: those that watch them start others."""

_BOUND = 10.0
"""How long workers get to answer what is asked of all, s."""


class ClusterCrew:
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
            BadCrew: some do not; the first of them are named.
            RecordNotWritten: this process cannot write there itself.
        """
        told = self._ask(tell_versions)
        self._refuse({worker: _difference(self._versions, other) for worker, other in told.items()})
        token = uuid.uuid4().hex
        mark = folder / f".{token}"
        with told_if_not_written(folder):
            try:
                mark.write_text(token, encoding="utf-8")
                told = self._ask(fault_of_folder, str(folder.absolute()), mark.name, token)
            finally:
                mark.unlink(missing_ok=True)
        self._refuse({w: f"cannot use {folder.absolute()}: {fault}" if fault else "" for w, fault in told.items()})

    def carry_out(self, orders: Sequence[RunOrder]) -> Generator[RunAnswer, None, None]:
        """Give each order to a worker; yield the answers as they come.

        A worker that is lost is replaced where something watches it (a nanny), and its run begun anew. If the iteration
        is left before its end, runs under way are ended and leave nothing.

        Raises:
            CrewLost: the scheduler has gone, or no worker has been there for a while.
        """
        waiting = iter(orders)
        going: dict[Any, tuple[RunOrder, Future[RunAnswer]]] = {}
        done: queue.SimpleQueue[Future[RunAnswer]] = queue.SimpleQueue()

        def give() -> None:
            for order in itertools.islice(waiting, max(1, _AHEAD * self.workers - len(going))):
                key = f"run-{uuid.uuid4().hex}"
                future = self._client.submit(carry_out_run, order, self._batch, self._versions, key=key, pure=False)
                going[future.key] = order, future
                future.add_done_callback(done.put)

        try:
            give()
            while going:
                order, future = going.pop(self._next(done).key)
                answer = self._answer(order, future)
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

    def _next(self, done: "queue.SimpleQueue[Future[RunAnswer]]") -> "Future[RunAnswer]":
        """Wait for a run's end."""
        there = time.monotonic()
        while True:
            with contextlib.suppress(queue.Empty):
                return done.get(timeout=_LOOK)
            if self.workers:
                there = time.monotonic()
            elif time.monotonic() - there > _WITHOUT:
                raise CrewLost(f"{self._name} has had no worker for {_WITHOUT:g} s")

    def _answer(self, order: RunOrder, future: "Future[RunAnswer]") -> RunAnswer:
        if future.cancelled():
            raise CrewLost(f"the scheduler of {self._name} is gone")
        error = cast("BaseException | None", future.exception())
        if error is None:
            return future.result()
        if isinstance(error, KilledWorker):
            times = error.allowed_failures + 1
            return RunAnswer(name=order.name, lost=f"its worker was lost {times} times: killed, or out of memory")
        return RunAnswer(name=order.name, lost=f"{type(error).__name__}: {one_line(error)}")

    def _ask(self, function: Callable[..., Any], *arguments: str) -> dict[str, Any]:
        """Return what each worker answers, by its address."""

        def ask() -> dict[str, Any]:
            return cast("dict[str, Any]", self._client.run(function, *arguments, on_error="return"))

        try:
            told = asked_aside(ask, _BOUND)
        except Exception as e:  # what a cluster's end leads to
            raise BadCrew(f"the workers of {self._name} do not answer: {one_line(e)}") from e
        return {f"worker {worker}": answer for worker, answer in told.items()}

    def _refuse(self, faults: Mapping[str, str]) -> None:
        """Raise BadCrew if there is a fault."""
        bad = [f"{worker} {fault}" for worker, fault in faults.items() if fault]
        if bad:
            more = f"; and {len(bad) - _MOST_TOLD} workers more" if len(bad) > _MOST_TOLD else ""
            raise BadCrew(f"{self._name} cannot be used: {'; '.join(bad[:_MOST_TOLD])}{more}")


def _difference(here: Mapping[str, str], there: Any) -> str:
    if isinstance(there, BaseException):
        return f"cannot run this package: {type(there).__name__}: {one_line(there)}"
    return difference(here, there)
