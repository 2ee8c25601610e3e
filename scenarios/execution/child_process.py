"""A process forked from this one to carry out what may end it.

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
"""How much later than the child itself the parent gives up a call, s; only a child that cannot act is late."""


class ChildEnd(NamedTuple):
    """How a child ended.

    Attributes:
        signal: the signal that ended it, None where it ended itself.
        status: its exit status then, else 0.
        cpu: seconds of CPU that it took.
        hung: whether it was ended because a unit's call did not return.
    """

    signal: int | None
    status: int
    cpu: float
    hung: bool


class ForkedChild:
    """Carries out a command in the main thread of a process group of its own, which dies with this process.

    Args:
        command: what the child does; it has to end the process.
        heartbeat: of the run in the child.
    """

    def __init__(self, command: Callable[[], NoReturn], heartbeat: Heartbeat) -> None:
        self._heartbeat = heartbeat
        self._alive, lives = os.pipe()
        parent_alive, self._parent_lives = os.pipe()
        self.pid = os.fork()
        if self.pid == 0:
            os.close(self._alive)
            os.close(self._parent_lives)
            os.setpgid(0, 0)
            threading.Thread(target=_die_with_parent, args=(parent_alive,), daemon=True).start()
            command()
        os.close(lives)
        os.close(parent_alive)
        with contextlib.suppress(OSError):  # it has done so itself, or is gone
            os.setpgid(self.pid, self.pid)

    def wait(self, watched: int | None = None) -> ChildEnd | None:
        """Return how it ended, or None if it goes on when a watched file can be read.

        If a unit's call does not return, the child is killed.
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
                ended_itself = os.WIFEXITED(status)
                number = None if ended_itself else os.WTERMSIG(status)
                code = os.WEXITSTATUS(status) if ended_itself else 0
                return ChildEnd(number, code, spent.ru_utime + spent.ru_stime, hung)
            if ready:
                return None
            if self._heartbeat.limit and stall_timer.elapsed() >= self._heartbeat.limit + _GRACE:
                hung = True
                os.kill(self.pid, signal.SIGKILL)

    def kill(self) -> None:
        """End it and what it started, and wait until it is gone."""
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
