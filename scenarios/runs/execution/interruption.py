"""Ctrl-C: before a run it aborts at once; during a run the first ends the run after its step, the second aborts it."""

import contextlib
import functools
import signal
import socket
import threading
from collections.abc import Callable, Sequence
from types import FrameType, TracebackType
from typing import Any

from handover.cosim.fmu.host_process import opened_file
from handover.scenarios.runs.execution.exit_status import ABORTED
from handover.scenarios.runs.execution.supervisor import leave, write_error_line

_ENDING = [n for n in (signal.SIGTERM, getattr(signal, "SIGHUP", None)) if n is not None]
"""Signals that end a run after its step, as of a batch system or of a terminal that is closed."""

_GRACE = 2.0
"""How long Python gets to handle an interrupt before the process is ended, s; a unit's native code may never return."""


class Interruption:
    """Handles SIGINT, SIGTERM and SIGHUP. Use it as a context manager in the main thread.

    If aborted it exits with 130. SIGTERM or SIGHUP, where it is ignored, as under nohup, stays so.

    Until `begin` the first signal raises KeyboardInterrupt. After it the first only sets `asked`, so that the step
    under way is finished and the record stays whole; the second puts the former handler back and raises
    KeyboardInterrupt.

    Python handles signals between its own instructions. A thread that reads them from a wakeup socket therefore ends
    the process if an abort is not handled in time, as when a unit's native code hangs. The stream of what was recorded
    stays; `complete_record` makes the record of it, as when the run is resumed.

    Args:
        ending: signals besides SIGINT that end a run, all of them by default.
    """

    def __init__(self, ending: Sequence[int] = _ENDING) -> None:
        self._ending = ending
        self.asked = False
        """Whether the run should end."""
        self._aborted = False
        self._running = False
        self._handled = threading.Event()
        self._heard = 0
        self._before: Any = None
        self._undo: list[Callable[[], Any]] = []

    def begin(self) -> None:
        """Let the first signal end the run after its step instead of aborting: from here on there is something to keep.

        Raises:
            KeyboardInterrupt: as by `check`.
        """
        self.check()
        self._running = True

    def check(self) -> None:
        """Raise KeyboardInterrupt again where a unit took the first one for a failure of its own."""
        if self._aborted:
            raise KeyboardInterrupt

    def __enter__(self) -> "Interruption":
        ours, pythons = socket.socketpair()
        pythons.setblocking(False)
        self._before = signal.signal(signal.SIGINT, self._take)
        ending = {n: signal.getsignal(n) for n in self._ending}
        ending = {n: handler for n, handler in ending.items() if handler is not signal.SIG_IGN}
        for number in ending:
            signal.signal(number, self._end)
        wakeup_before = signal.set_wakeup_fd(pythons.fileno(), warn_on_full_buffer=False)
        listener = threading.Thread(target=self._listen, args=(ours,), daemon=True)
        listener.start()
        self._undo = [
            lambda: signal.signal(signal.SIGINT, self._before),
            *(functools.partial(signal.signal, number, handler) for number, handler in ending.items()),
            lambda: signal.set_wakeup_fd(wakeup_before),
            _closing(pythons),  # which ends the listener
            lambda: listener.join(_GRACE),
            _closing(ours),
        ]
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._handled.set()
        for undo in self._undo:
            undo()
        if self._aborted:
            write_error_line("Aborted!")
            raise SystemExit(ABORTED) from None

    def _take(self, _number: int, _frame: FrameType | None) -> None:
        if self._running and not self.asked and self._heard < 2:  # Python reports two signals that come together as one
            self.asked = True
            return
        self._aborted = True
        self._handled.set()
        signal.signal(signal.SIGINT, self._before)
        raise KeyboardInterrupt

    def _end(self, number: int, frame: FrameType | None) -> None:
        """Let another signal end a run that has begun as one Ctrl-C does."""
        if self._running:
            self.asked = True
        else:
            self._take(number, frame)

    def _listen(self, ours: socket.socket) -> None:
        with contextlib.suppress(OSError):  # a unit has closed it before it was listened to
            while numbers := ours.recv(1):
                if numbers[0] != signal.SIGINT:
                    continue
                self._heard += 1
                aborts = not self._running or self._heard > 1
                if not aborts:
                    write_error_line("ending after this step; Ctrl-C again to abort")
                elif not self._handled.wait(_GRACE):
                    write_error_line("Aborted! A unit did not return.")
                    leave(ABORTED)


def _closing(end: socket.socket) -> Callable[[], None]:
    """Return a function that closes a socket, unless a unit has closed it and maybe opened a file under its number."""
    made = opened_file(end.fileno())

    def close() -> None:
        if opened_file(end.fileno()) == made:
            end.close()
        else:
            end.detach()

    return close
