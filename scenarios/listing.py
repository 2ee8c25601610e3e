"""What `handover` prints: the catalog, a scenario's parameters, a run's summary."""

import shlex
from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from handover.cosim.block_description import describe
from handover.cosim.start_values import range_of
from handover.cosim.variable import Causality, Kind, Variable
from handover.fmus.build import import_block
from handover.fmus.catalog import UNITS, Entry
from handover.scenarios.catalog import SCENARIOS, SYSTEMS
from handover.scenarios.console import open_console
from handover.scenarios.conversions import told_conversion
from handover.scenarios.ended import Ended
from handover.scenarios.experiment import Experiment
from handover.scenarios.master_rows import pace_rows
from handover.scenarios.reporting.told_metric import told
from handover.scenarios.run_folder import RunFolder

_MOST_CONVERSIONS = 8
"""Conversions of units that the end of a run tells on the terminal."""


def print_catalog() -> None:
    """Print the scenarios and the units of each robot system, a line each."""
    console = open_console()
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
    console = open_console()
    console.print(f"{experiment.name}: {experiment.title}", style="bold")
    console.print("Parameters, to be set with -p name=value")
    _print_rows(console, [(v.name, _plain(v.start), _allowed(v), v.description) for v in experiment.parameters()])
    console.print("Units, to be replaced with --unit name=file.fmu")
    _print_rows(console, list(experiment.units.items()))


def print_unit(unit: Entry) -> None:
    """Print a unit's parameters with defaults and ranges, its inputs and its outputs."""
    console = open_console()
    d = describe(import_block(unit.block))
    step = "sampled every" if d.period is not None else "stepped by, for instance,"
    console.print(f"{unit.name}: {unit.summary}", style="bold")
    console.print(f"{step} {float(unit.step) * 1000:.4g} ms")
    for heading, variables in (("Parameters", d.parameters), ("Inputs", d.inputs), ("Outputs", d.outputs)):
        if variables:
            console.print(heading, style="bold")
            _print_rows(console, [(v.name, _type_of(v), _start_of(v), _allowed(v), v.description) for v in variables])


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
    _print_rows(console, rows)
    left = f"report: {folder.report}" if folder.report.exists() else f"results: {folder.path}"
    console.print(left, markup=False, soft_wrap=True)
    if folder.checkpoint.exists():
        console.print(f"to go on: handover resume {shlex.quote(str(folder.path))}", markup=False, soft_wrap=True)


def _conversion_rows(folder: RunFolder) -> list[tuple[str, str]]:
    told = [told_conversion(c) for c in folder.read_run().get("conversions", [])]
    left = len(told) - _MOST_CONVERSIONS
    more = [(f"{left} conversions more", "in the report")] if left > 0 else []
    return [(f"converted: {ends}", change) for ends, change in told[:_MOST_CONVERSIONS]] + more


def _allowed(v: Variable) -> str:
    return " | ".join(n.lower() for n, _ in v.items) if v.items else range_of(v)


def _type_of(v: Variable) -> str:
    shape = f"[{','.join(map(str, v.shape))}]" if v.shape else ""
    unit = v.unit.symbol if v.kind is Kind.REAL and v.unit.symbol != "1" else ""
    return f"{v.type_name}{shape} {unit}".rstrip()


def _start_of(v: Variable) -> str:
    told = "" if v.causality is Causality.OUTPUT or v.kind is Kind.BINARY else _plain(v.start)
    return told if len(told) <= 40 else told[:37] + "..."


def _print_rows(console: Console, rows: list[tuple[str, ...]]) -> None:
    table = Table.grid(padding=(0, 2))
    for row in rows:
        table.add_row("", *map(Text, row))  # brackets in names are no markup
    console.print(table)


def _plain(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return ",".join(f"{x:g}" for x in value.reshape(-1).tolist())
    return f"{value:g}" if isinstance(value, float) else str(getattr(value, "name", value)).lower()
