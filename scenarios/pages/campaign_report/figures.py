"""Figures of a campaign for papers, in the width of a column: success rates and metrics by point, with intervals."""

import math
import textwrap
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.display_unit import DisplayUnit, display_unit
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, COLUMN, MARKERS, PAGE, figure, legend_below
from handover.scenarios.pages.campaign_report.point_layout import PointLayout, layout_of
from handover.scenarios.runs.campaign.plan import safe_name
from handover.scenarios.runs.campaign.results import CampaignResults
from handover.scenarios.runs.campaign.statistics import Interval
from handover.scenarios.runs.results.run_folder import folder_within
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults

_LINE, _NEXT_LINE = 0.2, 0.13
"""Height of a row where points are a list, and of each further line of its label or of a legend, in inches."""
_LONGEST = 22
"""Letters of a line of a label in a list: a longer label takes several lines."""
_TITLE = 24
"""Letters of a line of the value axis's title."""
_IN_COLUMN = 16
"""Points side by side in the width of a column; more take that of a page."""
_HEIGHT = 2.0
"""Height of a figure of points side by side, without its legend, in inches."""

_DARK, _SOFT = "#1c2330", "#4d5866"

_UNBROKEN = "\u00a0"  # a space at which `textwrap` does not break

_MAX_ENTRIES = 80
_LETTERS_PER_INCH = 15  # along a horizontal axis


def draw_campaign(
    results: CampaignResults, folder: Path, faults: ToleratedFaults, layout: PointLayout | None = None
) -> list[Figure]:
    """Draw success rates and the first metrics of the headline into a folder, as PNG, SVG and PDF.

    Draws nothing if no run is done, or if the points are more than a figure has room for.
    What cannot be drawn is noted in `faults`; the other figures are drawn.

    Args:
        results: what is drawn.
        folder: where the figures go; it is made if it is not there.
        faults: takes a line for each figure that cannot be drawn.
        layout: where the points stand; by default as `layout_of` lays them out.
    """
    if not results.done:
        return []
    layout = layout or layout_of(results)
    if layout.listed and len(results.points) > _MAX_ENTRIES:
        return []
    folder_within(folder)
    drawn: list[Figure] = []
    with faults.tolerated("figure success_by_point could not be drawn"):
        drawn.append(_success(results, layout, folder))
    for name in results.shown_metrics:
        with faults.tolerated(f"figure {name}_by_point could not be drawn"):
            drawn.append(_metric(results, layout, name, folder))
    return drawn


def _success(results: CampaignResults, layout: PointLayout, folder: Path) -> Figure:
    with _figure(folder / "success_by_point", layout, _groups(layout)) as axes:
        for k, point in enumerate(results.points):
            span = point.interval
            if span is not None:
                alone = len(point.done) == 1  # the interval of one run says nothing
                low, middle, high = (100 * x for x in (span.low, point.rate, span.high))
                low, high = (middle, middle) if alone else (low, high)
                _bar(axes, layout, k, float(layout.places[k]), (low, middle, high), COLOURS[layout.groups[k]])
        _set_value_axis(axes, layout, "success rate (%)", (-3.0, 103.0))
    repeated = any(len(point.done) > 1 for point in results.points)
    bars = "with 95 % intervals of Clopper and Pearson" if repeated else "one run at each point"
    caption = f"Share of the runs done that succeeded, {bars}."
    return Figure("success_by_point", caption)


def _metric(results: CampaignResults, layout: PointLayout, name: str, folder: Path) -> Figure:
    """Draw every run of a metric, a disc if it succeeded and else a cross, and the points' medians."""
    column, success = results.table.column(name), results.table.column("success")
    unit = display_unit(results.table.unit(name), column)
    words = name.replace("_", " ")
    file = safe_name(f"{name}_by_point")
    with _figure(folder / file, layout, [*_groups(layout), *_marks(results, column)]) as axes:
        for k, point in enumerate(results.points):
            values, colour = column[point.rows] * unit.factor, COLOURS[layout.groups[k]]
            succeeded = np.array([success[row] is True for row in point.rows])
            places = layout.beside(k, len(values)) - 0.12 * layout.room
            for chosen, marker, width in ((succeeded, "o", 0.0), (~succeeded, "x", 0.9)):
                x, y = _ordered(layout, places[chosen], values[chosen])
                axes.plot(x, y, marker, ms=3, mew=width, color=colour, alpha=0.7)
            _median(axes, layout, k, (results.median(point, name), results.median_interval(point, name)), unit)
        _set_value_axis(axes, layout, unit.axis(words), None)
    description = results.table.description(name) or words
    intervals = " with their 95 % bootstrap intervals" if results.has_intervals else ""
    caption = (
        f"{description[0].upper()}{description[1:]}: runs that succeeded (discs) and others (crosses); medians of the "
        f"runs done{intervals}."
    )
    return Figure(file, caption)


Entry = tuple[str, str, str]
"""Of a legend: label, marker and colour."""


def _groups(layout: PointLayout) -> list[Entry]:
    """Return what a legend says of the points' colours and of the marks of their rates and medians."""
    if len(layout.group_names) == 1:
        return []
    return [(name, MARKERS[k], COLOURS[k]) for k, name in enumerate(layout.group_names)]


def _marks(results: CampaignResults, column: Floats) -> list[Entry]:
    """Return what a legend names besides the points' groups."""
    success = results.table.column("success")
    shown = np.concatenate([point.rows for point in results.points])
    shown = shown[np.isfinite(column[shown])]
    failed = [row for row in shown if success[row] is not True]
    marks = [("median, 95 % interval" if results.has_intervals else "median", "o", _DARK)]
    if failed:
        marks.append(("run that failed", "x", _SOFT))
    if len(failed) < len(shown):
        marks.append(("run that succeeded", ".", _SOFT))
    return marks


def _median(
    axes: Axes, layout: PointLayout, k: int, measured: tuple[float, Interval | None], unit: DisplayUnit
) -> None:
    median, span = measured
    if math.isnan(median):
        return
    low, high = (median, median) if span is None else (span.low, span.high)
    scaled = (low * unit.factor, median * unit.factor, high * unit.factor)
    _bar(axes, layout, k, float(layout.places[k]) + 0.38 * layout.room, scaled, _DARK)


def _bar(axes: Axes, layout: PointLayout, k: int, place: float, span: tuple[float, float, float], colour: str) -> None:
    """Draw low, middle and high of point k, with the mark of its group."""
    low, middle, high = span
    reach = [[middle - low], [high - middle]]
    drawn: dict[str, Any] = {"color": colour, "marker": MARKERS[layout.groups[k]], "ms": 4, "capsize": 2, "lw": 1.1}
    if layout.listed:
        axes.errorbar([middle], [place], xerr=reach, **drawn)
    else:
        axes.errorbar([place], [middle], yerr=reach, **drawn)


def _ordered(layout: PointLayout, places: Floats, values: Floats) -> tuple[Floats, Floats]:
    return (values, places) if layout.listed else (places, values)


@contextmanager
def _figure(path: Path, layout: PointLayout, entries: Sequence[Entry]) -> Generator[Axes, None, None]:
    """Make a figure with the points along an axis, and a legend below."""
    labels = _labels(layout)
    width = COLUMN if layout.listed or len(layout.places) <= _IN_COLUMN else PAGE
    letters = _LETTERS_PER_INCH * width
    columns = max(1, min(len(entries), int(letters / max((5 + len(e[0]) for e in entries), default=1))))
    row = _LINE + _NEXT_LINE * max((label.count("\n") for label in labels), default=0)
    height = 0.6 + row * max(len(layout.places), 2) if layout.listed else _HEIGHT
    size = (width, height + _NEXT_LINE * math.ceil(len(entries) / columns))
    with figure(path, 1, size=size, as_printed=True) as [axes]:
        yield axes
        _set_point_axis(axes, layout, labels)
        if not layout.listed and len(labels) * max(map(len, labels), default=0) > 1.2 * letters:
            axes.tick_params(axis="x", rotation=30)
        if entries:
            drawn = {name: Line2D([], [], marker=m, color=colour, ls="", ms=4) for name, m, colour in entries}
            legend_below(axes, drawn, columns)


def _labels(layout: PointLayout) -> list[str]:
    """Return the names of the points along their axis; long ones of a list in several lines, broken after commas."""
    names = [name for _, name in layout.ticks or ()]
    if not layout.listed:
        return names
    whole = [", ".join(part.replace(" ", _UNBROKEN) for part in name.split(", ")) for name in names]
    return ["\n".join(textwrap.wrap(name, _LONGEST)).replace(_UNBROKEN, " ") for name in whole]


def _set_value_axis(axes: Axes, layout: PointLayout, title: str, limits: tuple[float, float] | None) -> None:
    axis = "x" if layout.listed else "y"
    axes.set(**{f"{axis}label": textwrap.fill(title, _TITLE)}, **({} if limits is None else {f"{axis}lim": limits}))


def _set_point_axis(axes: Axes, layout: PointLayout, labels: Sequence[str]) -> None:
    """Label the points along their axis."""
    low, high = layout.limits
    if layout.listed:
        axes.set(ylim=(low, high), ylabel=layout.title)
        axes.grid(visible=False, axis="y")
    else:
        axes.set(xlim=(low, high), xlabel=layout.title)
        axes.grid(visible=False, axis="x")
    if layout.ticks is not None:
        places = [place for place, _ in layout.ticks]
        (axes.set_yticks if layout.listed else axes.set_xticks)(places, labels)
