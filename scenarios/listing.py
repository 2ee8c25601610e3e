"""What `handover` prints of a run that has ended: its summary."""

import shlex
from collections.abc import Sequence

from handover.scenarios.console import open_console, print_rows
from handover.scenarios.execution.task import Ended
from handover.scenarios.results.run_folder import RunFolder
from handover.scenarios.results.tables import pace_rows, told, told_conversion

_MOST_CONVERSIONS = 8
"""Conversions of units that the end of a run tells on the terminal."""


def print_summary(ended: Ended, headline: Sequence[str], folder: RunFolder) -> None:
    """Print how a run ended, the figures named in the headline, and where its report is, or its results."""
    console = open_console()
    summary = ended.summary
    verdict = "[green]succeeded[/]" if summary["success"] else "[red]failed[/]"
    console.print(f"{summary['scenario']} {verdict}: ", end="")
    console.print(summary["reason"], markup=False, soft_wrap=True)
    metrics = summary["metrics"]
    rows = [(metrics[n]["description"] or n, told(metrics[n])) for n in headline if n in metrics]
    rows.append(("simulated", f"{summary['simulated_seconds']:.1f} s in {summary['wall_seconds']:.1f} s"))
    rows += pace_rows(summary)
    rows += _conversion_rows(folder)
    print_rows(console, rows)
    left = f"report: {folder.report}" if folder.report.exists() else f"results: {folder.path}"
    console.print(left, markup=False, soft_wrap=True)
    if folder.checkpoint.exists():
        console.print(f"to go on: handover resume {shlex.quote(str(folder.path))}", markup=False, soft_wrap=True)


def _conversion_rows(folder: RunFolder) -> list[tuple[str, str]]:
    told = [told_conversion(c) for c in folder.read_run().get("conversions", [])]
    left = len(told) - _MOST_CONVERSIONS
    more = [(f"{left} conversions more", "in the report")] if left > 0 else []
    return [(f"converted: {ends}", change) for ends, change in told[:_MOST_CONVERSIONS]] + more
