"""Ctrl-C during a campaign: the first ends it in order, the second at once."""

import contextlib
import os
import signal
from collections.abc import Callable, Generator
from functools import partial
from types import FrameType, TracebackType

from handover.scenarios.execution.exit_status import ABORTED
from handover.scenarios.execution.supervisor import leave

_SIGNALS = [n for n in (signal.SIGINT, signal.SIGTERM, getattr(signal, "SIGHUP", None)) if n is not None]


class CampaignInterruption:
    """Takes SIGINT, SIGTERM and SIGHUP over. Use it as a context manager in the main thread.

    The first of them raises KeyboardInterrupt, on which a campaign drops the runs under way and writes its table. The
    second ends this process at once with status 130; workers end when they miss it. One that is ignored, as under
    nohup, stays so.
    """

    def __init__(self) -> None:
        self._asked = self._holds_back = False
        self._undo: list[Callable[[], object]] = []

    def __enter__(self) -> "CampaignInterruption":
        for number in _SIGNALS:
            before = signal.getsignal(number)
            if before is not signal.SIG_IGN:
                signal.signal(number, self._take)
                self._undo.append(partial(signal.signal, number, before))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for undo in self._undo:
            undo()

    @contextlib.contextmanager
    def at_once(self) -> Generator[None, None, None]:
        """Let the first signal end this process like the second, while there is nothing to put in order."""
        before, self._asked = self._asked, True
        try:
            yield
        finally:
            self._asked = before

    @contextlib.contextmanager
    def held_back(self) -> Generator[None, None, None]:
        """Let the first signal count at the end of the block, as what is half started or ended is not in order.

        Raises:
            KeyboardInterrupt: at the end, if there has been one.
        """
        self._holds_back = True
        try:
            yield
        finally:
            self._holds_back = False
        if self._asked:
            raise KeyboardInterrupt

    def _take(self, _number: int, _frame: FrameType | None) -> None:
        if self._asked:
            os.write(2, b"\nAborted!\n" if os.isatty(2) else b"Aborted!\n")
            leave(ABORTED)
        self._asked = True
        if not self._holds_back:
            raise KeyboardInterrupt
