"""What `handover` prints: the catalog, a scenario's parameters, a run's summary."""

import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from cosim.start_values import range_of
from fmus.catalog import UNITS
from scenarios.catalog import SCENARIOS, SYSTEMS
from scenarios.experiment import Experiment
from scenarios.report import told
from scenarios.run_folder import RunFolder
from scenarios.runner import Ended


def print_catalog() -> None:
    """Print the scenarios and the units of each robot system, a line each."""
    console = _console()
    width = max(map(len, [*SCENARIOS, *UNITS]))
    for system in SYSTEMS:
        console.print(system.title, style="bold")
        for heading, rows in (
            ("scenarios", [(e.name, e.title) for e in system.scenarios]),
            ("units", [(name, UNITS[name].summary) for name in system.units]),
        ):
            console.print(f"  {heading}", style="italic")
            _print_rows(console, [("", name.ljust(width), told) for name, told in rows])


def print_scenario(experiment: type[Experiment[Any]]) -> None:
    """Print a scenario's parameters with defaults and ranges, and its units."""
    console = _console()
    console.print(f"{experiment.name}: {experiment.title}", style="bold")
    console.print("Parameters, to be set with -p name=value")
    rows: list[tuple[str, ...]] = []
    for v in experiment.parameters():
        allowed = " | ".join(n.lower() for n, _ in v.items) if v.items else range_of(v)
        rows.append((v.name, _plain(v.start), allowed, v.description))
    _print_rows(console, rows)
    console.print("Units, to be replaced with --unit name=file.fmu")
    _print_rows(console, list(experiment.units.items()))


def print_summary(ended: Ended, headline: Sequence[str], folder: RunFolder) -> None:
    """Print how a run ended, the figures named in the headline, and where the report is."""
    console = _console()
    summary = ended.summary
    verdict = "[green]succeeded[/]" if summary["success"] else "[red]failed[/]"
    console.print(f"{summary['scenario']} {verdict}: ", end="")
    console.print(summary["reason"], markup=False, soft_wrap=True)
    metrics = summary["metrics"]
    rows = [(metrics[n]["description"] or n, told(metrics[n])) for n in headline if n in metrics]
    rows.append(("simulated", f"{summary['simulated_seconds']:.1f} s in {summary['wall_seconds']:.1f} s"))
    _print_rows(console, rows)
    console.print(f"report: {folder.report}", markup=False, soft_wrap=True)


def _print_rows(console: Console, rows: list[tuple[str, ...]]) -> None:
    table = Table.grid(padding=(0, 2))
    for row in rows:
        table.add_row("", *row)
    console.print(table)


def _console() -> Console:
    return Console(highlight=False, width=None if sys.stdout.isatty() else 160)


def _plain(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return ",".join(f"{x:g}" for x in value.reshape(-1).tolist())
    return str(getattr(value, "name", value)).lower()
