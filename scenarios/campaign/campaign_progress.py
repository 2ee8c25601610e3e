"""Tells how far a campaign has come: a bar on a terminal, a line now and then elsewhere, as in a batch system's log."""

import threading
import time
from collections.abc import Callable
from types import TracebackType
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from handover.scenarios.campaign.worker_pool import Tally

_PAUSE = 30.0
"""Seconds from line to line where there is no terminal."""

_STARTING = "starting workers"


class CampaignProgress:
    """Shows a campaign's tally while it is used as a context manager; calling it moves it.

    Args:
        stream: where to; a bar if it is a terminal.
        clock: gives the seconds from an instant on.
    """

    def __init__(self, stream: TextIO, clock: Callable[[], float] = time.monotonic) -> None:
        self.tally: Tally | None = None
        """What it was told last."""
        self._stream = stream
        self._clock = clock
        self._began = self._told = clock()
        console = Console(file=stream)
        columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), TextColumn("{task.fields[left]}"))
        self._bar = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bar.add_task(_STARTING, total=None, left="")
        self._telling, self._ended = threading.Lock(), threading.Event()
        self._teller = threading.Thread(target=self._tell_while_nothing_ends, daemon=True)

    def __call__(self, tally: Tally) -> None:
        """Take how far it has come."""
        if self.tally is None:
            self._began = self._clock()
        self.tally = tally
        ended = tally.ended + tally.lost
        left = told_left(tally, self._clock() - self._began)
        self._bar.update(self._task, description=told_done(tally), total=tally.total, completed=ended, left=left)
        self.tell()

    def tell(self) -> None:
        """Write a line if one is due."""
        with self._telling:
            if not self._bar.disable or self._due() > 0:
                return
            self._told = self._clock()
            tally = self.tally
            left = told_left(tally, self._told - self._began) if tally else ""
            self._stream.write(f"{told_done(tally) if tally else _STARTING}{', ' if left else ''}{left}\n")
            self._stream.flush()

    def __enter__(self) -> "CampaignProgress":
        self._told = self._clock()
        self._bar.start()
        if self._bar.disable:
            self._teller.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()
        self._ended.set()
        if self._bar.disable:
            self._teller.join()

    def _due(self) -> float:
        """Return in how many seconds the next line is due."""
        return self._told + _PAUSE - self._clock()

    def _tell_while_nothing_ends(self) -> None:
        while not self._ended.wait(max(self._due(), 0.0)):
            self.tell()


def told_done(tally: Tally) -> str:
    """Return such as "12 of 60 runs done, 1 failed, 2 lost"."""
    parts = [f"{tally.ended} of {tally.total} runs done"]
    parts += [f"{tally.failed} failed"] if tally.failed else []
    parts += [f"{tally.lost} lost"] if tally.lost else []
    return ", ".join(parts)


def told_left(tally: Tally, elapsed: float) -> str:
    """Return such as "3 min left", reckoned from the runs of this call; "" where nothing can be said."""
    here = tally.ended + tally.lost - tally.kept
    if here == 0 or tally.left == 0:
        return ""
    seconds = elapsed / here * tally.left
    if seconds < 60:
        return f"{max(1, round(seconds))} s left"
    if seconds < 3600:
        return f"{round(seconds / 60)} min left"
    return f"{seconds / 3600:.1f} h left"
