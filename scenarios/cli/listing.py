"""What `handover` prints of a run that has ended: its summary.

How a command tells the end of a run.

The console that commands print to.
"""

import os
import shlex
import sys
from collections.abc import Sequence
from typing import NoReturn

import click
from rich.console import Console
from rich.table import Table
from rich.text import Text

from handover.scenarios.execution.exit_status import TASK_FAILED, UNIT_FAILED
from handover.scenarios.results.run_folder import RunFolder
from handover.scenarios.results.summary import RunResult
from handover.scenarios.results.tables import format_conversion, format_metric, pace_rows
from handover.scenarios.results.task import Task


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


_MAX_CONVERSIONS = 8
"""Conversions of units that the end of a run tells on the terminal."""


def print_summary(ended: RunResult, headline: Sequence[str], folder: RunFolder) -> None:
    """Print how a run ended, the figures named in the headline, and where its report is, or its results."""
    console = open_console()
    summary = ended.summary
    verdict = "[green]succeeded[/]" if summary["success"] else "[red]failed[/]"
    console.print(f"{summary['scenario']} {verdict}: ", end="")
    console.print(summary["reason"], markup=False, soft_wrap=True)
    metrics = summary["metrics"]
    rows = [(metrics[n]["description"] or n, format_metric(metrics[n])) for n in headline if n in metrics]
    rows.append(("simulated", f"{summary['simulated_seconds']:.1f} s in {summary['wall_seconds']:.1f} s"))
    rows += pace_rows(summary)
    rows += _conversion_rows(folder)
    print_rows(console, rows)
    left = f"report: {folder.report}" if folder.report.exists() else f"results: {folder.path}"
    console.print(left, markup=False, soft_wrap=True)
    if folder.checkpoint.exists():
        console.print(f"to go on: handover resume {shlex.quote(str(folder.path))}", markup=False, soft_wrap=True)


def _conversion_rows(folder: RunFolder) -> list[tuple[str, str]]:
    format_metric = [format_conversion(c) for c in folder.read_run().get("conversions", [])]
    left = len(format_metric) - _MAX_CONVERSIONS
    more = [(f"{left} conversions more", "in the report")] if left > 0 else []
    return [(f"converted: {ends}", change) for ends, change in format_metric[:_MAX_CONVERSIONS]] + more


def exit_with(ended: RunResult, task: Task) -> NoReturn:
    """Print how a run ended, and exit with the status that says so."""
    if ended.failure:
        click.echo(str(ended.failure), err=True)
    print_summary(ended, task.experiment.headline, task.folder)
    sys.exit(UNIT_FAILED if ended.failure else 0 if ended.outcome.success else TASK_FAILED)
