"""Runs a command in a child process, so that a unit which crashes its process does not crash what reports it.

Only where processes can be forked, thus not on Windows. What is imported here is loaded before every run.
"""

import contextlib
import os
import shutil
import signal
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

from handover.cosim.exceptions import one_line
from handover.cosim.fmu.heartbeat import Heartbeat
from handover.cosim.fmu.host_process import hard_limits, lowered_limits
from handover.scenarios.runs.execution.child_process import ChildEnd, ForkedChild
from handover.scenarios.runs.execution.exit_status import ABORTED, UNIT_FAILED

TERMINATION_SIGNALS = (
    () if sys.platform == "win32" else (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE, signal.SIGQUIT)
)
"""Signals that ask a process to end: not a crash."""

heartbeat = Heartbeat()
"""Of the run in this process, in memory that a parent and its child share."""

_in_child = False


def heartbeat_of_run() -> Heartbeat:
    """Return the heartbeat for a run in this process: in a child the one that its parent reads, else a new one."""
    global heartbeat
    if not _in_child:
        heartbeat = Heartbeat()
    return heartbeat


def begin_child() -> None:
    """Note that this process is a child, whose parent reads `heartbeat`."""
    global _in_child
    _in_child = True


def is_supervised() -> bool:
    """Return whether this process is a child whose parent reports how it crashes."""
    return _in_child


def renew_heartbeat() -> Heartbeat:
    """Return a new heartbeat, for the next run in a child of this process."""
    global heartbeat
    heartbeat = Heartbeat()
    return heartbeat


def can_supervise() -> bool:
    """Return whether this process can be forked: the system supports it, and no thread would be lost."""
    return hasattr(os, "fork") and threading.active_count() == 1


def supervise(command: Callable[[], Any], report_crash: Callable[[Heartbeat, ChildEnd, float], int]) -> NoReturn:
    """Run a command in a child process and end with its status.

    If the child crashes, `report_crash` gets the heartbeat, how the child ended and the seconds that it ran; it
    completes what the run left, prints what happened and returns the exit status.

    The child is a process group of its own: the parent alone receives Ctrl-C and forwards it, so that the child
    receives each signal once. If the parent ends, the child is killed. A child that is stopped (SIGSTOP), as by a
    unit, handles no signals: the second that asks it to end kills it, with the status of what is aborted.
    """
    began = time.monotonic()
    forwarded = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGTSTP, signal.SIGCONT]
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, forwarded)

    def begin() -> NoReturn:
        begin_child()
        signal.signal(signal.SIGTTOU, signal.SIG_IGN)  # a group in the background may write to the terminal
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        run_to_end(command)

    child = ForkedChild(begin, heartbeat)
    asks = _forward_signals(child)
    signal.pthread_sigmask(signal.SIG_SETMASK, mask)
    end = child.wait()
    assert end is not None  # it watched nothing else
    if asks.aborted and heartbeat.status is None:
        for folder in heartbeat.facts.get("scratch", []):
            shutil.rmtree(folder, ignore_errors=True)
        sys.exit(ABORTED)
    _end_as(end, time.monotonic() - began, report_crash)


def run_to_end(command: Callable[[], Any]) -> NoReturn:
    """Run a command and end this process with its status.

    Where a unit has lowered hard limits of this process and the command did not get to its end, an error is a matter of
    chance and of the place where it struck: a child leaves the report to its parent, as where it crashes.
    """
    status, limits = 1, hard_limits()
    try:
        command()
        status = 0
    except SystemExit as e:
        status = e.code if isinstance(e.code, int) else int(e.code is not None)
    except OSError as e:  # not even an error could be printed, as where a unit took the right to write files
        heartbeat.record_facts(unsaid=one_line(e))
        status = UNIT_FAILED
    except Exception:  # such as MemoryError, or what libraries make of it
        if not _limited(limits):
            raise
        status = UNIT_FAILED
    finally:
        if status and (lowered := _limited(limits)):
            _leave_limited(lowered)
        heartbeat.status = status
    if heartbeat.abandoned:  # a thread is still in a unit's call: the interpreter could not end
        leave(status)
    sys.exit(status)


def _limited(limits: Mapping[int, int]) -> str:
    """Return which hard limits are lower than they were where the run in this child has not ended; else nothing."""
    return lowered_limits(limits) if _in_child and "concluded" not in heartbeat.facts else ""


def _leave_limited(lowered: str) -> NoReturn:
    """End this process at once, without an exit status in the heartbeat, so that the parent reports it."""
    with contextlib.suppress(Exception):
        heartbeat.record_facts(lowered=lowered)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(Exception):
            stream.flush()
    os._exit(UNIT_FAILED)


def leave(status: int) -> NoReturn:
    """End this process at once, in order."""
    heartbeat.status = status
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)


def write_error_line(line: str) -> None:
    """Write a line to standard error past its buffer, which a signal may have interrupted; not if nobody can read it.

    On a terminal, which may have been closed, it begins a line, as ^C or a progress bar is on the one before.
    """
    begin = "\n" if os.isatty(2) else ""
    with contextlib.suppress(OSError):
        os.write(2, f"{begin}{line}\n".encode())


class _Asks:
    """How often a child was asked to end, and whether it was killed because it could not."""

    def __init__(self, child: ForkedChild) -> None:
        self._child, self._count, self.aborted = child, 0, False

    def add(self) -> None:
        self._count += 1
        if not self._child.stopped:
            return
        line = "the run is stopped (SIGSTOP) and ends once it continues; the same signal again aborts it"
        if self._count > 1:
            self.aborted, line = True, "Aborted! The run was stopped (SIGSTOP)."
            with contextlib.suppress(ProcessLookupError):
                os.kill(self._child.pid, signal.SIGKILL)
        write_error_line(line)


def _forward_signals(child: ForkedChild) -> _Asks:
    asks = _Asks(child)

    def forward(number: int, _frame: Any) -> None:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child.pid, number)
        if number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            asks.add()

    def stop(_number: int, _frame: Any) -> None:
        forward(signal.SIGSTOP, None)
        os.kill(os.getpid(), signal.SIGSTOP)
        forward(signal.SIGCONT, None)

    signal.signal(signal.SIGINT, forward)
    signal.signal(signal.SIGTERM, forward)
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as under nohup
        signal.signal(signal.SIGHUP, forward)
    if signal.getsignal(signal.SIGTSTP) is signal.SIG_DFL:
        signal.signal(signal.SIGTSTP, stop)
    return asks


def _end_as(end: ChildEnd, wall: float, report_crash: Callable[[Heartbeat, ChildEnd, float], int]) -> NoReturn:
    """End as the child did; where it had not set its exit status, report how it crashed.

    Where it had concluded its run and could not tell, what it left is reported in its place.
    """
    if end.signal is not None and end.signal in TERMINATION_SIGNALS:
        signal.signal(end.signal, signal.SIG_DFL)
        os.kill(os.getpid(), end.signal)
    unsaid, ended = heartbeat.facts.get("unsaid"), "concluded" in heartbeat.facts
    if unsaid and ended:
        print(
            f"the run ended, but its process could not print its summary ({unsaid}); from its folder:", file=sys.stderr
        )
    elif unsaid:
        print(f"Error: the run's process could not go on: {unsaid}", file=sys.stderr)
    if heartbeat.status is not None and not (unsaid and ended):
        sys.exit(heartbeat.status if end.signal is not None else end.status)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.exit(report_crash(heartbeat, end, wall))
