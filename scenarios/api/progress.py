"""Progress as a bar: of HTML in a notebook, of rich on a terminal, none elsewhere."""

import contextlib
import html
import sys
import time
from collections.abc import Callable, Generator
from typing import Any

from rich.progress import BarColumn, TextColumn, TimeElapsedColumn

from handover.scenarios.runs.execution.progress import terminal_progress

Move = Callable[[float, float, str], None]
"""Is called with what is done, of how much, and what that is in words."""

_INTERVAL = 0.2
"""Between two updates of a notebook's bar, s."""


@contextlib.contextmanager
def bar(shown: bool) -> Generator[Move, None, None]:
    """Give the function that moves a bar, which goes away at the end."""
    if not shown:
        yield _unseen
    elif _in_notebook():
        with _notebook_bar() as move:
            yield move
    else:
        with _terminal_bar() as move:
            yield move


def _unseen(_done: float, _total: float, _text: str) -> None:
    """Show nothing."""


def _in_notebook() -> bool:
    """Return whether a kernel runs this program, so that HTML can be displayed."""
    ipython: Any = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return shell is not None and hasattr(shell, "kernel")


@contextlib.contextmanager
def _terminal_bar() -> Generator[Move, None, None]:
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=30), TimeElapsedColumn())
    with terminal_progress(sys.stderr, *columns) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda done, total, text: progress.update(task, completed=done, total=total, description=text)


@contextlib.contextmanager
def _notebook_bar() -> Generator[Move, None, None]:
    from IPython import display as ipython  # there, as a notebook is

    place: Any = ipython.display(ipython.HTML(bar_html(0.0, 1.0, "")), display_id=True)
    drawn = time.monotonic()

    def move(done: float, total: float, text: str) -> None:
        nonlocal drawn
        if time.monotonic() - drawn >= _INTERVAL:
            drawn = time.monotonic()
            place.update(ipython.HTML(bar_html(done, total, text)))

    try:
        yield move
    finally:
        place.update(ipython.HTML(""))


def bar_html(done: float, total: float, text: str) -> str:
    """Return a bar with a text beside it."""
    return f"<progress value='{done:g}' max='{total:g}' style='width: 20em'></progress> {html.escape(text)}"
