"""What is said on standard error while a command works: progress, what it is doing, and logs as asked for."""

import contextlib
import logging
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TextIO

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, Task, TextColumn, TimeElapsedColumn
from rich.text import Text

from handover.cosim.exceptions import visible


def say(line: object) -> None:
    """Print a line on standard error, as `visible` has it: it may quote files of others."""
    click.echo(visible(str(line)), err=True)


class _Pace(ProgressColumn):
    """Simulated seconds per second of wall time."""

    def render(self, task: Task) -> Text:
        elapsed = task.elapsed or 0.0
        return Text(f"{task.completed / elapsed:.1f} x real time" if elapsed > 0.5 else "", style="dim")


@contextmanager
def progress_bar(stream: TextIO) -> Generator[Callable[[float, float], None], None, None]:
    """Show a bar during a run, where the stream is a terminal; give the function that updates it.

    The function takes the simulated seconds until now, and those of the whole run at most.
    """
    columns = (
        TextColumn("simulated {task.completed:6.1f} s of at most {task.total:.0f} s"),
        BarColumn(bar_width=30),
        TextColumn("wall"),
        TimeElapsedColumn(),
        _Pace(),
    )
    with terminal_progress(stream, *columns) as progress:
        task = progress.add_task("run", total=1.0, start=True)

        def move(t: float, end: float) -> None:
            progress.update(task, completed=t, total=end)

        yield move


@contextmanager
def doing(what: str) -> Generator[None, None, None]:
    """Say on standard error what is being done, where that takes seconds: in a line, which on a terminal goes again.

    Args:
        what: such as "drawing figures".
    """
    if not is_terminal(sys.stderr):
        with contextlib.suppress(OSError):  # as where a unit has closed the stream
            say(f"{what} ...")
        yield
        return
    columns = SpinnerColumn(), TextColumn(visible(what), markup=False), TimeElapsedColumn()
    with terminal_progress(sys.stderr, *columns) as progress:
        progress.add_task(what, total=None)
        yield


def terminal_progress(stream: TextIO, *columns: ProgressColumn) -> Progress:
    """Return a bar that is shown where a stream is a terminal, and removed at the end."""
    return Progress(*columns, console=Console(file=stream), transient=True, disable=not is_terminal(stream))


def is_terminal(stream: TextIO) -> bool:
    """Return whether what moves on a stream is seen. FORCE_COLOR, which notebooks set, asks for colours alone."""
    return not stream.closed and stream.isatty()


LOG_LEVELS = ("debug", "info", "warning", "error")
"""From which level on logs can be shown, as `logging_to_standard_error` takes it."""


@contextmanager
def logging_to_standard_error(level: str | None) -> Generator[None, None, None]:
    """Tell of units' logs and of the master's progress on standard error, from a level on.

    `debug` has all that units log, by all their categories, `info` the master's progress. None leaves all as it is:
    the master's warnings are shown, and of a unit's log what belongs to its failure.
    """
    logger, handler = logging.getLogger(__name__.partition(".")[0]), _ToStandardError()
    if level is None:
        yield
        return
    before = logger.level
    logger.setLevel(level.upper())
    logger.addHandler(handler)
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.setLevel(before)


class _ToStandardError(logging.Handler):
    """Writes to what standard error is at the time: a bar redirects it, so that lines stand above the bar."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line."""
        try:
            say(f"{record.levelname.lower()}: {record.getMessage()}")
        except Exception:  # as logging's own handlers do: what is logged must not end a run
            self.handleError(record)
