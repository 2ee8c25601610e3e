"""Carries out work with units in a thread of its own, so that a call which does not return does not stop the caller."""

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
"""How long an interrupted thread gets to reach the end of its step, and a unit to be freed beside one that hangs, s."""

_MAX_POLL_INTERVAL = 0.25  # s


@dataclass
class _Task:
    job: Callable[[], Any]
    done: threading.Event = field(default_factory=threading.Event)
    result: Any = None
    error: BaseException | None = None


class Watchdog:
    """Watches the heartbeat of work with units; where there is no limit, work is simply done.

    All work is done in one thread, as units may expect. A thread whose call does not return is left to itself; further
    work is done in another one. When a thread that was left comes back, it finds its unit in `Heartbeat.abandoned` and
    ends. Time in which this process itself stood still, as in a machine that sleeps, does not count.

    Args:
        heartbeat: what the work writes.
        limit: seconds of wall time that a call may take; None: any.
        clock: tells the time in seconds.
    """

    def __init__(self, heartbeat: Heartbeat, limit: float | None, clock: Callable[[], float] = time.monotonic) -> None:
        self._heartbeat, self._limit, self._clock = heartbeat, limit, clock
        self._tasks: queue.SimpleQueue[_Task | None] | None = None
        heartbeat.limit = limit or 0.0

    def run_job(self, job: Callable[[], T]) -> T:
        """Do a job and return what it returns.

        Raises:
            UnitHung: a call did not return within the limit. Besides, whatever the job raises.
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
        except BaseException:  # Ctrl-C: the thread stops after its step, or is left
            self._heartbeat.stopped = True
            if not task.done.wait(_GRACE):
                self._leave(self._heartbeat.under_way)
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
        look = min(limit / 4, _MAX_POLL_INTERVAL)
        stall_timer = StallTimer(self._heartbeat, 2 * look, self._clock)
        while not task.done.wait(look):
            if stall_timer.elapsed() >= limit and stall_timer.beat is not None:
                self._give_up(task, stall_timer.beat, limit)

    def _give_up(self, task: _Task, beat: tuple[int, int], limit: float) -> None:
        """Leave the thread in its call and raise UnitHung, unless the call returns in this very moment."""
        call = self._heartbeat.under_way
        if call is None:
            return
        self._heartbeat.abandoned.add(call.unit)
        self._heartbeat.stopped = True
        if self._heartbeat.beat != beat and not task.done.wait(_GRACE):
            self._heartbeat.abandoned.discard(call.unit)
            self._heartbeat.stopped = False
            return
        self._leave(call)
        raise UnitHung(call.unit, call.call, call.t, limit, self._heartbeat.log_of(call.unit))

    def _leave(self, call: Call | None) -> None:
        """Have nothing more to do with the thread, nor with the unit that it is in."""
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
