"""A campaign's points: a table of successes and medians of metrics with intervals, and a plot of success rates."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from handover.scenarios.experiment.display_unit import DisplayUnit, column_text, digits_after_point, display_unit
from handover.scenarios.pages.campaign_report.point_layout import PointLayout
from handover.scenarios.runs.campaign.results import CampaignResults, PointResults
from handover.scenarios.runs.reporting.html import Cell, plot_html, rows_table
from handover.scenarios.runs.reporting.page import Section


def points_section(results: CampaignResults, layout: PointLayout | None) -> Section | None:
    """Return the table of points; None if no run has ended. It says so where the layout has no room for plots."""
    points = results.points
    if not points or layout is None:
        return None
    metrics = results.shown_metrics
    units = {m: display_unit(results.table.unit(m), results.table.column(m)) for m in metrics}
    digits = {m: digits_after_point([results.median(point, m) * units[m].factor for point in points]) for m in metrics}
    units_of_varied = _units_of_varied(results)
    rows = [
        (
            *_values(results, point, units_of_varied),
            str(len(point.rows)),
            *_success(point),
            *(_median(results, point, m, units[m], digits[m]) for m in metrics),
        )
        for point in points
    ]
    header = (
        *(name.replace("_", " ") for name in results.varied or ("point",)),
        "runs",
        "successes",
        "rate, 95 % interval",
        *(units[m].axis(f"median {m.replace('_', ' ')}") for m in metrics),
    )
    first = len(header) - 3 - len(metrics)
    line = "Of the runs done. Intervals of success rates: Clopper and Pearson"
    line += "; of medians: bootstrap, from three values on." if results.has_intervals and metrics else "."
    if any(results.number_measured(p, m) < len(p.done) for p in points for m in metrics):
        line += " “Of 2”: so many of the runs done have a value."
    if not layout.fits_a_page:
        line += f" {len(points)} points are too many for plots: click on a column's name to sort by it."
    table = rows_table(header, rows, numbers=range(first, len(header)), sortable=True)
    box = Markup("<div class='tall'>{}</div>").format(table)
    note = Markup("<p class='soft'>{}</p>").format(line)
    return Section(anchor="points", title="Points", html=box + note, scripts=("campaign.js",))


def _units_of_varied(results: CampaignResults) -> Mapping[str, DisplayUnit]:
    """Return the unit in which the values of each varied number are shown."""
    texts = {n: {p.values[n] for p in results.points if n in p.values} for n in results.varied if results.is_number(n)}
    return {name: display_unit(results.unit(name), list(map(float, values))) for name, values in texts.items()}


def _values(results: CampaignResults, point: PointResults, units: Mapping[str, DisplayUnit]) -> list[Cell]:
    cells: list[Cell] = []
    for name in results.varied:
        text = point.values.get(name)
        if text is None:
            cells.append(Cell("–"))
        elif name in units:
            cells.append(Cell(units[name].text(float(text)), float(text)))
        else:
            cells.append(Cell(results.words(name, text)))
    return cells or [Cell("all runs")]


def _success(point: PointResults) -> tuple[Cell, Cell]:
    span = point.interval
    if span is None:
        return Cell("–", math.nan), Cell("–", math.nan)
    line = f"{100 * point.rate:.0f} % ({100 * span.low:.0f} to {100 * span.high:.0f})"
    return Cell(f"{point.successes} of {len(point.done)}", point.successes), Cell(line, point.rate)


def _median(results: CampaignResults, point: PointResults, metric: str, unit: DisplayUnit, digits: int) -> Cell:
    median, span = results.median(point, metric), results.median_interval(point, metric)
    if math.isnan(median):
        return Cell("–", math.nan)
    line = column_text(median * unit.factor, digits)
    if span is not None:
        low, high = (column_text(x * unit.factor, digits) for x in (span.low, span.high))
        line += f" ({low} to {high})"
    number = results.number_measured(point, metric)
    return Cell(line if number == len(point.done) else f"{line}, of {number}", median)


_BETWEEN = 9
"""Pixels between names of several lines, below each other."""
_SCREEN = 15
"""Points of a list that fit a screen; a longer list has its value axis at the top."""


def success_section(results: CampaignResults, layout: PointLayout) -> Section | None:
    """Return the plot of success rates with their intervals; None if no run is done."""
    if not results.done:
        return None
    figure = go.Figure()
    for group, name in enumerate(layout.group_names):
        figure.add_trace(_rates(results, layout, group, name))
    place_axis(figure, layout)
    rate_axis = "xaxis" if layout.listed else "yaxis"
    figure.update_layout({rate_axis: {"title": {"text": "success rate (%)"}, "range": [-4, 104], "dtick": 25}})
    repeated = any(len(p.done) > 1 for p in results.points)
    bars = "bars: 95 % intervals of Clopper and Pearson" if repeated else "one at each point"
    note = Markup("<p class='soft'>Of the runs done; {}.</p>").format(bars)
    return Section(
        anchor="success",
        title="Success",
        html=plot_html(figure, plot_height(layout), "success rate by point, with intervals") + note,
    )


def _rates(results: CampaignResults, layout: PointLayout, group: int, name: str) -> Any:
    chosen = [k for k, p in enumerate(results.points) if layout.groups[k] == group and len(p.done)]
    points = [results.points[k] for k in chosen]
    rates = np.array([p.rate for p in points]) * 100.0
    spans = [p.interval for p in points]
    low = np.array([s.low for s in spans if s]) * 100.0
    high = np.array([s.high for s in spans if s]) * 100.0
    hover = [
        [results.label(p), f"{p.successes} of {len(p.done)}", f"{a:.0f} to {b:.0f} %"]
        for p, a, b in zip(points, low, high, strict=True)
    ]
    up, down = (  # the interval of one run says nothing
        [float(x) if len(p.done) > 1 else None for p, x in zip(points, reach, strict=True)]
        for reach in (high - rates, rates - low)
    )
    bar = {"type": "data", "array": up, "arrayminus": down, "thickness": 1.6, "width": 4}
    along, across = ("y", "x") if layout.listed else ("x", "y")
    return go.Scatter(
        {along: layout.places[chosen], across: rates, f"error_{across}": bar},
        mode="markers",
        marker={"size": 10, "color": f"var(--c{group})"},
        name=name,
        showlegend=len(layout.group_names) > 1,
        customdata=hover,
        hovertemplate="%{customdata[0]}<br>%{customdata[1]} succeeded<br>95 %: %{customdata[2]}<extra></extra>",
    )


def place_axis(figure: Any, layout: PointLayout) -> None:
    """Set the axis of a figure along which points stand; places and values are numbers.

    Plotly would guess an axis's type by its first trace, and takes one of boxes without data for names.
    """
    axis: dict[str, Any] = {"title": {"text": layout.title}, "range": list(layout.limits), "type": "linear"}
    if layout.ticks is not None:
        names = [name for _, name in layout.ticks]
        if layout.listed:
            names = [_broken(name) for name in names]
        axis |= {"tickmode": "array", "tickvals": [place for place, _ in layout.ticks], "ticktext": names}
    along, across = ("yaxis", "xaxis") if layout.listed else ("xaxis", "yaxis")
    figure.update_layout({along: axis, across: {"type": "linear"}})
    if layout.listed:
        figure.update_layout(meta={"list": True}, xaxis_side="top" if len(layout.places) > _SCREEN else None)


def plot_height(layout: PointLayout) -> int:
    """Return the height of a plot, in pixels, in which each point of a list has room for its name."""
    if not layout.listed:
        return 340
    lines = [1 + _broken(name).count("<br>") for _, name in layout.ticks or ()]
    most = max(lines, default=1)
    return 110 + max(30, 17 * most + _BETWEEN * (most > 1)) * len(layout.places)


def _broken(name: str) -> str:
    """Break a long name into lines at commas."""
    lines = [""]
    for part in name.split(", "):
        if lines[-1] and len(lines[-1]) + len(part) > 24:
            lines[-1] += ","
            lines.append(part)
        else:
            lines[-1] += f", {part}" if lines[-1] else part
    return "<br>".join(lines)
