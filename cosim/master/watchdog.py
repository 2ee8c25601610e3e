"""Runs jobs with units in a thread of its own, so that a call which does not return does not block the caller."""

import queue
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from handover.cosim.fmu.failures import UnitHung
from handover.cosim.fmu.heartbeat import Call, Heartbeat, StallTimer

T = TypeVar("T")

_GRACE = 2.0
"""Seconds for an interrupted thread to finish its step, and for freeing a unit where another one hangs."""

_MAX_POLL_INTERVAL = 0.25  # s


@dataclass
class _Task:
    job: Callable[[], Any]
    done: threading.Event = field(default_factory=threading.Event)
    result: Any = None
    error: BaseException | None = None


class Watchdog:
    """Watches the heartbeat of jobs with units; without a limit, jobs simply run in the caller's thread.

    All jobs run in one thread, as units may expect. A thread whose call does not return is abandoned, and further jobs
    run in another one. When the call of an abandoned thread returns after all, the thread finds its unit in
    `Heartbeat.abandoned` and ends. Time in which this process itself was suspended, as in a machine that sleeps, does
    not count.

    Args:
        heartbeat: what the job's calls write.
        limit: seconds of wall time that a call may take; None: no limit.
        clock: returns the wall time in seconds.
    """

    def __init__(self, heartbeat: Heartbeat, limit: float | None, clock: Callable[[], float] = time.monotonic) -> None:
        self._heartbeat, self._limit, self._clock = heartbeat, limit, clock
        self._tasks: queue.SimpleQueue[_Task | None] | None = None
        heartbeat.limit = limit or 0.0

    def run_job(self, job: Callable[[], T]) -> T:
        """Run a job and return what it returns.

        Raises:
            UnitHung: a call did not return within the limit. Whatever else the job raises.
        """
        if self._limit is None:
            return job()
        if not self._heartbeat.abandoned:
            self._heartbeat.stopped = False
        task = _Task(job)
        self._start().put(task)
        try:
            self._watch(task, self._limit)
        except UnitHung:
            raise
        except BaseException:  # Ctrl-C: the thread stops after its step, or is abandoned
            self._heartbeat.stopped = True
            if not task.done.wait(_GRACE):
                self._abandon_thread(self._heartbeat.under_way)
            raise
        if task.error is not None:
            raise task.error
        return task.result

    def close(self) -> None:
        """End the thread."""
        if self._tasks is not None:
            self._tasks.put(None)
            self._tasks = None

    def _watch(self, task: _Task, limit: float) -> None:
        poll_interval = min(limit / 4, _MAX_POLL_INTERVAL)
        stall_timer = StallTimer(self._heartbeat, 2 * poll_interval, self._clock)
        while not task.done.wait(poll_interval):
            seconds, call = stall_timer.poll(), self._heartbeat.under_way
            if call is not None and call.unit in self._heartbeat.isolated:
                seconds -= _GRACE  # its process is ended at the limit, and the call returns
            if seconds >= limit and stall_timer.beat is not None:
                self._give_up(task, stall_timer.beat, limit)

    def _give_up(self, task: _Task, beat: tuple[int, int], limit: float) -> None:
        """Abandon the thread in its call and raise UnitHung, unless the call returns in this very moment."""
        call = self._heartbeat.under_way
        if call is None:
            return
        self._heartbeat.abandoned.add(call.unit)
        self._heartbeat.stopped = True
        if self._heartbeat.beat != beat and not task.done.wait(_GRACE):
            self._heartbeat.abandoned.discard(call.unit)
            self._heartbeat.stopped = False
            return
        self._abandon_thread(call)
        raise UnitHung(call.unit, call.call, call.t, limit, self._heartbeat.log_of(call.unit))

    def _abandon_thread(self, call: Call | None) -> None:
        """Use neither the thread any more nor the unit that it is in."""
        if call is not None:
            self._heartbeat.abandoned.add(call.unit)
        self.close()
        self._heartbeat.end()
        self._limit = min(self._limit or _GRACE, _GRACE)

    def _start(self) -> "queue.SimpleQueue[_Task | None]":
        if self._tasks is None:
            self._tasks = queue.SimpleQueue()
            threading.Thread(target=_work, args=(self._tasks,), name="units", daemon=True).start()
        return self._tasks


def _work(tasks: "queue.SimpleQueue[_Task | None]") -> None:
    while (task := tasks.get()) is not None:
        try:
            task.result = task.job()
        except BaseException as e:
            task.error = e
        task.done.set()
