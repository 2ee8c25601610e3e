"""Tells how far a campaign has come: a bar on a terminal, a line now and then elsewhere, as in a batch system's log."""

import time
from collections.abc import Callable
from types import TracebackType
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn

from scenarios.campaign.tally import Tally

_PAUSE = 30.0
"""Seconds from line to line where there is no terminal."""


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
        self._task = self._bar.add_task("", total=None, left="")

    def __call__(self, tally: Tally) -> None:
        """Take how far it has come."""
        if self.tally is None:
            self._began = self._told = self._clock()
        self.tally = tally
        elapsed = self._clock() - self._began
        done, left = told_done(tally), told_left(tally, elapsed)
        ended = tally.ended + tally.lost
        self._bar.update(self._task, description=done, total=tally.total, completed=ended, left=left)
        if self._bar.disable and self._clock() - self._told >= _PAUSE:
            self._told = self._clock()
            self._stream.write(f"{done}{', ' if left else ''}{left}\n")
            self._stream.flush()

    def __enter__(self) -> "CampaignProgress":
        self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._bar.stop()


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
