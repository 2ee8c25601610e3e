"""The progress bar of a run on a terminal."""

from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn, TimeElapsedColumn
from rich.text import Text


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
