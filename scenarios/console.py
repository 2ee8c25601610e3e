"""The console that commands print to."""

import os
import sys

from rich.console import Console
from rich.table import Table
from rich.text import Text


def open_console() -> Console:
    """Return standard output's console: in colours and as wide as the terminal, plain and wide when piped."""
    return _Console(highlight=False, width=None if sys.stdout.isatty() else 160)


def print_rows(console: Console, rows: list[tuple[str, ...]]) -> None:
    """Print rows of texts in columns, indented; nothing in them is read as rich's markup."""
    table = Table.grid(padding=(0, 2))
    for row in rows:
        table.add_row("", *map(Text, row))
    console.print(table)


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Say no more to a reader who has left; how the run ended is still told by the exit status."""
        self.quiet = True
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
