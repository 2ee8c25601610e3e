"""Figures of a campaign for papers: success rates and metrics by point, with intervals."""

import math
import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.plan import safe_name
from handover.scenarios.campaign.results import CampaignResults
from handover.scenarios.campaign.statistics import Interval
from handover.scenarios.campaign_report.point_layout import PointLayout, layout_of
from handover.scenarios.experiment.display_unit import DisplayUnit, display_unit
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.results.run_folder import folder_within
from handover.scenarios.results.tolerated_faults import ToleratedFaults

_LINE = 0.24
"""Height of a row where points are a list, in inches."""
_NEXT_LINE = 0.17
"""Height of each further line of a label there, in inches."""
_LETTER = 0.073
"""Width of a letter of a label, about, in inches."""
_PLOT = 4.2
"""Width that a list leaves for what is drawn, in inches."""
_LONGEST = 60
"""Letters of a line of a label in a list: a longer label takes several lines."""

_DARK, _SOFT = "#1c2330", "#4d5866"

_UNBROKEN = "\u00a0"  # a space at which `textwrap` does not break

_MAX_ENTRIES = 80
_LETTERS_ALONG = 60  # that fit along a horizontal axis


def draw_campaign(
    results: CampaignResults, folder: Path, faults: ToleratedFaults, layout: PointLayout | None = None
) -> list[Figure]:
    """Draw success rates and the first metrics of the headline into a folder, as PNG and SVG.

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
    with figure(folder / "success_by_point", 1, size=_size(layout)) as [axes]:
        for k, point in enumerate(results.points):
            span = point.interval
            if span is not None:
                alone = len(point.done) == 1  # the interval of one run says nothing
                low, middle, high = (100 * x for x in (span.low, point.rate, span.high))
                low, high = (middle, middle) if alone else (low, high)
                _bar(axes, layout, float(layout.places[k]), (low, middle, high), COLOURS[layout.groups[k]])
        _set_point_axis(axes, layout)
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
    with figure(folder / file, 1, size=_size(layout)) as [axes]:
        for k, point in enumerate(results.points):
            values, colour = column[point.rows] * unit.factor, COLOURS[layout.groups[k]]
            succeeded = np.array([success[row] is True for row in point.rows])
            places = layout.beside(k, len(values)) - 0.12 * layout.room
            for chosen, marker, width in ((succeeded, "o", 0.0), (~succeeded, "x", 1.1)):
                x, y = _ordered(layout, places[chosen], values[chosen])
                axes.plot(x, y, marker, ms=4, mew=width, color=colour, alpha=0.6)
            _median(axes, layout, k, (results.median(point, name), results.median_interval(point, name)), unit)
        _set_point_axis(axes, layout, _marks(results, column))
        _set_value_axis(axes, layout, unit.axis(words), None)
    description = results.table.description(name) or words
    intervals = " with their 95 % bootstrap intervals" if results.has_intervals else ""
    caption = (
        f"{description[0].upper()}{description[1:]}: runs that succeeded (discs) and others (crosses); medians of the "
        f"runs done{intervals}."
    )
    return Figure(file, caption)


def _marks(results: CampaignResults, column: Floats) -> list[tuple[str, str, str]]:
    """Return what a legend names besides the points' colours: label, marker and colour."""
    success = results.table.column("success")
    shown = np.concatenate([point.rows for point in results.points])
    shown = shown[np.isfinite(column[shown])]
    failed = [row for row in shown if success[row] is not True]
    marks = [("median, 95 % interval" if results.has_intervals else "median", "o", _DARK)]
    if failed:
        marks.append(("run that failed", "x", _SOFT))
    if len(failed) < len(shown):
        marks.append(("run that succeeded", "o", _SOFT))
    return marks


def _median(
    axes: Axes, layout: PointLayout, k: int, measured: tuple[float, Interval | None], unit: DisplayUnit
) -> None:
    median, span = measured
    if math.isnan(median):
        return
    low, high = (median, median) if span is None else (span.low, span.high)
    scaled = (low * unit.factor, median * unit.factor, high * unit.factor)
    _bar(axes, layout, float(layout.places[k]) + 0.38 * layout.room, scaled, _DARK)


def _bar(axes: Axes, layout: PointLayout, place: float, span: tuple[float, float, float], colour: str) -> None:
    """Draw low, middle and high of a point."""
    low, middle, high = span
    reach = [[middle - low], [high - middle]]
    if layout.listed:
        axes.errorbar([middle], [place], xerr=reach, color=colour, marker="o", ms=5, capsize=2.5, lw=1.3)
    else:
        axes.errorbar([place], [middle], yerr=reach, color=colour, marker="o", ms=5, capsize=2.5, lw=1.3)


def _ordered(layout: PointLayout, places: Floats, values: Floats) -> tuple[Floats, Floats]:
    return (values, places) if layout.listed else (places, values)


def _size(layout: PointLayout) -> tuple[float, float]:
    """Return width and height, in inches, with room for the longest label of a list."""
    if not layout.listed:
        return 8.0, 3.6
    labels = _labels(layout)
    longest = max((len(line) for label in labels for line in label.split("\n")), default=0)
    row = _LINE + _NEXT_LINE * max((label.count("\n") for label in labels), default=0)
    return max(8.0, _PLOT + _LETTER * longest), 1.0 + row * max(len(layout.places), 2)


def _labels(layout: PointLayout) -> list[str]:
    """Return the names of the points along their axis; long ones of a list in several lines, broken after commas."""
    names = [name for _, name in layout.ticks or ()]
    if not layout.listed:
        return names
    whole = [", ".join(part.replace(" ", _UNBROKEN) for part in name.split(", ")) for name in names]
    return ["\n".join(textwrap.wrap(name, _LONGEST)).replace(_UNBROKEN, " ") for name in whole]


def _set_value_axis(axes: Axes, layout: PointLayout, title: str, limits: tuple[float, float] | None) -> None:
    if layout.listed:
        axes.set(xlabel=title, **({} if limits is None else {"xlim": limits}))
    else:
        axes.set(ylabel=title, **({} if limits is None else {"ylim": limits}))


def _set_point_axis(axes: Axes, layout: PointLayout, marks: Sequence[tuple[str, str, str]] = ()) -> None:
    """Label the points along their axis, and colours and marks in a legend."""
    low, high = layout.limits
    if layout.listed:
        axes.set(ylim=(low, high), ylabel=layout.title)
        axes.grid(visible=False, axis="y")
    else:
        axes.set(xlim=(low, high), xlabel=layout.title)
        axes.grid(visible=False, axis="x")
    if layout.ticks is not None:
        places, names = [place for place, _ in layout.ticks], _labels(layout)
        (axes.set_yticks if layout.listed else axes.set_xticks)(places, names)
        if not layout.listed and _crowded(names):
            axes.tick_params(axis="x", rotation=30)
    colours = zip(COLOURS, layout.group_names, strict=False) if len(layout.group_names) > 1 else ()
    entries = [*((name, "o", colour) for colour, name in colours), *marks]
    for name, marker, colour in entries:
        axes.plot([], [], marker, color=colour, label=name)
    if entries:
        names = [name for name, _, _ in entries]
        axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=_columns(names))


def _crowded(names: Sequence[str]) -> bool:
    return len(names) * max(map(len, names)) > 1.4 * _LETTERS_ALONG


def _columns(names: Sequence[str]) -> int:
    return max(1, min(len(names), _LETTERS_ALONG // (4 + max(map(len, names)))))
