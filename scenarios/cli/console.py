"""What commands print to: the console, rows in columns, and the progress bar of a run."""

import os
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text


def open_console() -> Console:
    """Return a console on standard output: in colours and as wide as the terminal, plain and wide when piped."""
    return _Console(highlight=False, width=None if sys.stdout.isatty() else 160)


def print_rows(console: Console, rows: list[tuple[str, ...]]) -> None:
    """Print rows of texts in columns, indented; nothing in them is interpreted as rich's markup."""
    table = Table.grid(padding=(0, 2))
    for row in rows:
        table.add_row("", *map(Text, row))
    console.print(table)


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Print no more to a reader that has closed the pipe; the exit status still says how the run ended."""
        self.quiet = True
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())


class _Pace(ProgressColumn):
    """Simulated seconds per second of wall time."""

    def render(self, task: Task) -> Text:
        elapsed = task.elapsed or 0.0
        return Text(f"{task.completed / elapsed:.1f} x real time" if elapsed > 0.5 else "", style="dim")


@contextmanager
def progress_bar(stream: TextIO) -> Generator[Callable[[float, float], None], None, None]:
    """Show a bar during a run, where the stream is a terminal; give the function that updates it.

    The function takes the simulated time and the time at which the run ends at the latest, in seconds.
    """
    columns = (
        TextColumn("simulated {task.completed:6.1f} s of at most {task.total:.0f} s"),
        BarColumn(bar_width=30),
        TextColumn("wall"),
        TimeElapsedColumn(),
        _Pace(),
    )
    console = Console(file=stream)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        task = progress.add_task("run", total=1.0, start=True)

        def move(t: float, end: float) -> None:
            progress.update(task, completed=t, total=end)

        yield move
