"""A forked child process for a command that may crash or hang.

Only where processes can be forked, thus not on Windows. What is imported here is loaded before every run.
"""

import contextlib
import os
import select
import signal
import threading
from collections.abc import Callable
from typing import NamedTuple, NoReturn

from handover.cosim.fmu.heartbeat import Heartbeat, StallTimer

_POLL_INTERVAL = 0.25  # s
_GRACE = 5.0
"""How much later than the child itself the parent gives up a call, s.

The child watches its calls too and reports what hung; the parent kills it only where it cannot act any more.
"""


class ChildEnd(NamedTuple):
    """How a child ended.

    Attributes:
        signal: the signal that killed it, None where it exited.
        status: its exit status where it exited, else 0.
        cpu: seconds of CPU that it took.
        hung: whether it was killed because a unit's call did not return.
    """

    signal: int | None
    status: int
    cpu: float
    hung: bool


class ForkedChild:
    """Runs a command in the main thread of a process group of its own, which is killed when this process ends.

    Two pipes, over which nothing is sent, tell each process of the other's end: their read ends become ready.

    Args:
        command: what the child does; it has to end the process.
        heartbeat: of the run in the child.
    """

    def __init__(self, command: Callable[[], NoReturn], heartbeat: Heartbeat) -> None:
        self._heartbeat = heartbeat
        self._alive, child_lives = os.pipe()
        parent_alive, self._parent_lives = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self._alive)
            os.close(self._parent_lives)
            os.setpgid(0, 0)
            threading.Thread(target=_die_with_parent, args=(parent_alive,), daemon=True).start()
            command()
        os.close(child_lives)
        os.close(parent_alive)
        with contextlib.suppress(OSError):  # it has done so itself, or is gone
            os.setpgid(self.pid, self.pid)

    def wait(self, watched: int | None = None) -> ChildEnd | None:
        """Return how it ended, or None if it still runs when the file descriptor `watched` becomes readable.

        If a unit's call does not return in time, the child is killed.
        """
        stall_timer = StallTimer(self._heartbeat, 2 * _POLL_INTERVAL)
        files = [self._alive] if watched is None else [self._alive, watched]
        hung = False
        while True:
            ready, _, _ = select.select(files, [], [], _POLL_INTERVAL)
            gone = self._alive in ready
            pid, status, spent = os.wait4(self.pid, 0 if gone else os.WNOHANG)
            if pid:
                self._close()
                exited = os.WIFEXITED(status)
                number = None if exited else os.WTERMSIG(status)
                code = os.WEXITSTATUS(status) if exited else 0
                return ChildEnd(number, code, spent.ru_utime + spent.ru_stime, hung)
            if ready:
                return None
            if self._heartbeat.limit and stall_timer.poll() >= self._heartbeat.limit + _GRACE:
                hung = True
                os.kill(self.pid, signal.SIGKILL)

    def kill(self) -> None:
        """Kill it and what it started, and wait until it is gone."""
        with contextlib.suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
        self._close()

    def _close(self) -> None:
        os.close(self._alive)
        os.close(self._parent_lives)


def _die_with_parent(parent_alive: int) -> None:
    os.read(parent_alive, 1)
    os.kill(os.getpid(), signal.SIGKILL)
