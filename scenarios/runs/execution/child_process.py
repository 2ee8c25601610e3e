"""A forked child process for a command that may crash or hang.

Only where processes can be forked, thus not on Windows. What is imported here is loaded before every run.
"""

import contextlib
import ctypes
import os
import select
import signal
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, NoReturn

from handover.cosim.fmu.heartbeat import Heartbeat, PolledClock, StallTimer

_POLL_INTERVAL = 0.25  # s
_MAX_GAP = 2 * _POLL_INTERVAL  # s
_GRACE = 5.0
"""How much later than the child itself the parent gives up a call, s.

The child watches its calls too and reports what hung; the parent kills it only where it cannot act any more.
"""

_EXIT_INTERVAL, _EXIT_PATIENCE = 0.002, 0.25
"""How often a child that has closed its pipe is asked whether it has ended, and for how long, s."""


class ChildEnd(NamedTuple):
    """How a child ended.

    Attributes:
        signal: the signal that killed it, None where it exited.
        status: its exit status where it exited, else 0.
        cpu: seconds of CPU that it took.
        hung: whether it was killed because a unit's call did not return.
        stopped: whether it was killed because it was stopped (SIGSTOP) for too long.
    """

    signal: int | None
    status: int
    cpu: float
    hung: bool
    stopped: bool = False


class ForkedChild:
    """Runs a command in the main thread of a process group of its own, which is killed when this process ends.

    What is left of the group when the child ends, such as processes that a unit has forked, is killed too. On Linux so
    is what has left the group: this process adopts the child's descendants whose parents end, as they would else be
    adopted by the system's first process.

    Two pipes, over which nothing is sent, tell each process of the other's end: their read ends become ready. On Linux
    the kernel, too, kills the child when this thread ends, whatever a unit did to the pipes or to Python's threads.

    Args:
        command: what the child does; it has to end the process.
        heartbeat: of the run in the child.

    Attributes:
        stopped: whether it was stopped (SIGSTOP) when `wait` looked last, so that it handles no signals.
    """

    def __init__(self, command: Callable[[], NoReturn], heartbeat: Heartbeat) -> None:
        self._heartbeat, self.stopped = heartbeat, False
        self._others = _children()
        _adopt_descendants()
        self._alive, child_lives = os.pipe()
        parent_alive, self._parent_lives = os.pipe()
        parent = os.getpid()
        self.pid = os.fork()
        if self.pid == 0:
            _die_at_once_with(parent)
            os.close(self._alive)
            os.close(self._parent_lives)
            os.setpgid(0, 0)
            if sys.platform != "linux":  # there the kernel does it, whatever the units do to the descriptors
                threading.Thread(target=_die_with_parent, args=(parent_alive,), daemon=True).start()
            command()
        os.close(child_lives)
        os.close(parent_alive)
        with contextlib.suppress(OSError):  # it has done so itself, or is gone
            os.setpgid(self.pid, self.pid)

    def wait(self, watched: int | None = None, *, stop_limit: float | None = None) -> ChildEnd | None:
        """Return how it ended, or None if it still runs when the file descriptor `watched` becomes readable.

        If a unit's call does not return in time, the child is killed; also if it does not end in that time after it
        has reported its exit status, as where a unit's library holds it. Time in which the child is stopped (SIGSTOP,
        Ctrl-Z) or waits for memory that was swapped out does not count.

        Args:
            watched: a file descriptor.
            stop_limit: seconds after which a child that stays stopped is killed; None: it may stay so for ever.
        """
        files = [self._alive] if watched is None else [self._alive, watched]
        limits, closed, since_closed = _Limits(self._heartbeat, self.pid, stop_limit), False, PolledClock(_MAX_GAP)
        while True:
            ready, _, _ = select.select(files, [], [], _EXIT_INTERVAL if closed else _POLL_INTERVAL)
            if self._alive in ready:  # it is about to end, or a unit has closed the pipe: see below
                files.remove(self._alive)
                closed, since_closed = True, PolledClock(_MAX_GAP)
            pid, status, spent = os.wait4(self.pid, os.WNOHANG | os.WUNTRACED | os.WCONTINUED)
            if pid and (os.WIFSTOPPED(status) or os.WIFCONTINUED(status)):
                self.stopped = os.WIFSTOPPED(status)
                limits.note_suspension(stopped=self.stopped)
            elif pid:
                self._kill_rest()
                self._close()
                exited = os.WIFEXITED(status)
                number = None if exited else os.WTERMSIG(status)
                code = os.WEXITSTATUS(status) if exited else 0
                return ChildEnd(number, code, spent.ru_utime + spent.ru_stime, limits.hung, limits.given_up)
            self._reap_adopted()
            if watched is not None and watched in ready:
                return None
            if limits.exceeded():
                os.kill(self.pid, signal.SIGKILL)
            closed = closed and since_closed.poll() < _EXIT_PATIENCE

    def kill(self) -> None:
        """Kill it and what it started, and wait until it is gone."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        self._kill_rest()
        self._close()

    def _kill_rest(self) -> None:
        """Kill what units have forked and left, once the child has ended: its group, and what was adopted since."""
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(self.pid, signal.SIGKILL)
        while adopted := self._adopted():  # those of which one ends leave their own children to this process
            for pid in adopted:
                with contextlib.suppress(ProcessLookupError, PermissionError):
                    os.kill(pid, signal.SIGKILL)
                with contextlib.suppress(ChildProcessError):
                    os.waitpid(pid, 0)

    def _reap_adopted(self) -> None:
        for pid in self._adopted():
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, os.WNOHANG)

    def _adopted(self) -> set[int]:
        """Return the children of this process that it has neither forked here nor had before."""
        return _children() - self._others - {self.pid}

    def _close(self) -> None:
        os.close(self._alive)
        os.close(self._parent_lives)


class _Limits:
    """Says, at each poll of a child, whether it has taken longer for something than it may.

    Args:
        heartbeat: of the run in the child; its limit is that of a call, and of the end after the last one.
        pid: of the child.
        stop_limit: seconds for which it may stay stopped (SIGSTOP); None: for ever.

    Attributes:
        hung: whether a call has not returned in time.
        given_up: whether it stayed stopped for too long.
    """

    def __init__(self, heartbeat: Heartbeat, pid: int, stop_limit: float | None) -> None:
        self._heartbeat, self._stop_limit = heartbeat, stop_limit
        self._calls = StallTimer(heartbeat, 2 * _POLL_INTERVAL, page_reads=lambda: _page_reads(pid))
        self._stopped: PolledClock | None = None
        self._ending = PolledClock(_MAX_GAP)
        self.hung = self.given_up = False

    def note_suspension(self, *, stopped: bool) -> None:
        """Note that the child was stopped, or continues."""
        self._stopped = PolledClock(_MAX_GAP) if stopped else None

    def exceeded(self) -> bool:
        """Poll; return whether the child is to be killed."""
        if self._stopped is not None:
            self._calls.poll(suspended=True)
            self.given_up = self._stop_limit is not None and self._stopped.poll() >= self._stop_limit
            return self.given_up
        limit = self._heartbeat.limit + _GRACE if self._heartbeat.limit else float("inf")
        if self._heartbeat.status is None:
            self.hung = self._calls.poll() >= limit
            self._ending = PolledClock(_MAX_GAP)
        return self.hung or self._ending.poll() >= limit


def _page_reads(pid: int) -> int:
    """Return how often a process has waited for a page of memory from the disk; 0 where that is unknown."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_bytes().rpartition(b")")[2].split()
        return int(fields[9])  # majflt
    except (OSError, ValueError, IndexError):
        return 0


_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36


def _adopt_descendants() -> None:
    """Let descendants of this process whose parents end become its children (Linux)."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _children() -> set[int]:
    """Return the children of this process, those that have ended and were not waited for included; Linux, else none."""
    found: set[int] = set()
    for file in Path("/proc/self/task").glob("*/children"):
        with contextlib.suppress(OSError):  # the thread has ended
            found.update(map(int, file.read_bytes().split()))
    return found


def _die_at_once_with(parent: int) -> None:
    """Let the kernel kill this process when the thread that forked it ends (Linux); at once if that has happened."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)


def _die_with_parent(parent_alive: int) -> None:
    os.read(parent_alive, 1)
    os.kill(os.getpid(), signal.SIGKILL)
