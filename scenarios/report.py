"""Writes the report page of a run: one HTML file that opens offline, with its figures inside."""

import base64
from collections.abc import Mapping, Sequence
from importlib import resources
from typing import Any

import jinja2

from scenarios.conversions import told_conversion
from scenarios.experiment import Figure
from scenarios.master_rows import master_rows
from scenarios.run_folder import RunFolder, write_whole

UnitRow = tuple[str, str, str, int | None, float | None]
"""Name, FMU, step, number of steps and CPU seconds of a unit, the last two where they are known."""

_IN_TABLES = ("cpu_", "pace_", "iterations", "rollbacks")
"""Metrics that have a place in other tables."""


def write_report(
    folder: RunFolder,
    title: str,
    headline: Sequence[str],
    summary: Mapping[str, Any],
    parameters: Sequence[tuple[str, str, str]],
    units: Sequence[UnitRow],
    figures: Sequence[Figure],
) -> None:
    """Write `report.html`: verdict, failure, figures of merit, parameters, units with their CPU time, master, figures.

    Args:
        folder: the run's folder, with `run.json`; the figures are in it.
        title: the scenario's.
        headline: names of the figures of merit that are shown first.
        summary: what is in `summary.json`.
        parameters: name, value with unit, and description of each parameter.
        units: see `UnitRow`.
        figures: names and captions.
    """
    source = resources.files("scenarios").joinpath("report.html").read_text(encoding="utf-8")
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    environment.filters["figure"] = told
    pictures = [(f, _inline(folder, f)) for f in figures]
    page = environment.from_string(source).render(
        title=title,
        metrics=_in_order(summary["metrics"], headline),
        summary=summary,
        parameters=parameters,
        units=units,
        master=master_rows(summary),
        conversions=[told_conversion(c) for c in folder.read_run().get("conversions", [])],
        failure=summary.get("failure"),
        pictures=pictures,
    )
    write_whole(folder.report, page)


def told(metric: Mapping[str, Any]) -> str:
    """Write a metric with a unit that reads well: mm for small lengths, ms for small times, MB for memory."""
    value, unit = metric["value"], metric["unit"]
    if value is None:
        return "undefined"
    if unit == "m" and abs(value) < 1:
        return f"{value * 1000:.1f} mm"
    if unit == "s" and 0 < abs(value) < 0.1:
        return f"{value * 1000:.2f} ms"
    if unit == "B":
        return f"{value / 1e6:.0f} MB"
    return f"{value:.4g}" + ("" if unit == "1" else f" {unit}")


def _in_order(metrics: Mapping[str, Any], headline: Sequence[str]) -> list[tuple[str, Any]]:
    """Return the headline's metrics, then the others but those that have a place in other tables."""
    first = [n for n in headline if n in metrics]
    others = [n for n in metrics if n not in headline and not n.startswith(_IN_TABLES)]
    return [(n, metrics[n]) for n in first + others]


def _inline(folder: RunFolder, figure: Figure) -> str:
    data = (folder.figures / f"{figure.name}.png").read_bytes()
    return "data:image/png;base64," + base64.b64encode(data).decode()
