"""What commands print to: the console; rows in columns; data as JSON."""

import json
import os
import re
import sys
from collections.abc import Iterable, Mapping
from typing import Any, TextIO

import click
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from handover.cosim.exceptions import visible
from handover.cosim.fmu.host_process import copied

_WIDTH = 160
"""Of what is piped where COLUMNS has no number."""


def open_console() -> Console:
    """Return a console on standard output: coloured and as wide as the terminal; piped plain, as wide as COLUMNS."""
    columns = os.environ.get("COLUMNS", "")
    piped = int(columns) if columns.isdecimal() and int(columns) else _WIDTH
    return _Console(highlight=False, width=None if sys.stdout.isatty() else piped)


def print_rows(console: Console, rows: Iterable[tuple[str, ...]]) -> None:
    """Print rows of texts in columns, indented; nothing in them is interpreted as rich's markup."""
    table = Table.grid(padding=(0, 2))
    for row in rows:
        table.add_row("", *map(Text, row))
    console.print(table)


def heading(name: str) -> Text:
    """Return a column's heading, whose long names are broken at underscores and dots, and not within words."""
    return Text("\n".join(line for text in name.split("\n") for line in _broken(text)))


def _broken(name: str) -> list[str]:
    lines = [""]
    for part in _PARTS.findall(name):
        if lines[-1] and len(lines[-1]) + len(part) > _LONGEST_HEADING:
            lines.append("")
        lines[-1] += part
    return lines


_PARTS = re.compile(r"[^_.]*[_.]|[^_.]+")
_LONGEST_HEADING = 16
"""Characters in a line of a heading, unless a word is longer."""


def print_json(data: Mapping[str, Any]) -> None:
    """Print data as JSON, for programs."""
    click.echo(json.dumps(data, indent=2))


def reserve_stdout() -> TextIO:
    """Return standard output for this command alone: what units print there from now on goes to standard error.

    It stays so until the process ends, as units may print until then, and what C libraries keep is written last.
    """
    try:
        if sys.stdout.fileno() != _STDOUT:
            return sys.stdout
    except (OSError, ValueError):  # it is not a file of the system, as where a program calls the command
        return sys.stdout
    sys.stdout.flush()
    kept = copied(_STDOUT)
    kept = os.dup(_STDOUT) if kept is None else kept
    os.dup2(_STDERR, _STDOUT)
    return open(kept, "w", encoding="utf-8")


_STDOUT, _STDERR = 1, 2


class _Console(Console):
    def render_str(self, text: str, **options: Any) -> Text:
        """Return a text as `visible` has it, before it is broken into lines."""
        return super().render_str(visible(text), **options)

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Render as `visible` has it all that is shown: it may quote files of others."""
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else visible(text), style, control)

    def on_broken_pipe(self) -> None:
        """Print no more to a reader that has closed the pipe; the exit status still says how the run ended."""
        self.quiet = True
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
