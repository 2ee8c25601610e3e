"""What commands print to: the console; rows in columns; data as JSON."""

import json
import os
import sys
from collections.abc import Mapping
from typing import Any

import click
from rich.console import Console
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


def print_json(data: Mapping[str, Any]) -> None:
    """Print data as JSON, for programs."""
    click.echo(json.dumps(data, indent=2))


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Print no more to a reader that has closed the pipe; the exit status still says how the run ended."""
        self.quiet = True
        with open(os.devnull, "w", encoding="utf-8") as nowhere:
            os.dup2(nowhere.fileno(), sys.stdout.fileno())
