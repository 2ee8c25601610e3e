"""Plot of a campaign's metrics: each run as a mark, one metric at a time to choose from.

A point of many runs has a box too; of few, quartiles say less than the runs themselves.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.pages.campaign_report.point_layout import PointLayout
from handover.scenarios.pages.campaign_report.points import place_axis, plot_height
from handover.scenarios.runs.campaign.results import CampaignResults
from handover.scenarios.runs.reporting.html import json_html, plot_html
from handover.scenarios.runs.reporting.page import Section

_SUCCESS, _OTHER = "circle", "x-thin"
_MIN_BOXED = 12
"""Runs of a point from which on it has a box; below, each quarter of them is one or two."""
_ENDED = {True: "succeeded", False: "failed", None: "not done"}


def spread_section(results: CampaignResults, layout: PointLayout) -> Section | None:
    """Return the plot of a metric that can be chosen; None if no run has any."""
    if not results.measured:
        return None
    first = results.measured[0]
    strips = _strips(results, layout)
    figure = go.Figure()
    choices = [_choice(results, layout, name, strips) for name in results.measured]
    for trace, values in zip(_traces(results, layout, strips), choices[0]["traces"], strict=True):
        figure.add_trace({**trace, **values})
    place_axis(figure, layout)
    figure.update_layout({"xaxis" if layout.listed else "yaxis": {"title": {"text": choices[0]["axis"]}}})
    options = Markup().join(Markup("<option>{}</option>").format(c["name"]) for c in choices)
    html = Markup(
        "<div class='chooser' data-axis='{}'><div class='controls'><label>Metric <select>{}</select></label></div>\n"
        "<p class='soft description'>{}</p>{}{}</div>\n<p class='soft'>{}</p>"
    ).format(
        "xaxis" if layout.listed else "yaxis",
        options,
        choices[0]["description"],
        plot_html(figure, plot_height(layout) + 60, f"{first} by point"),
        json_html(choices, "choices"),
        _note(results),
    )
    return Section(anchor="metrics", title="Metrics", html=html, scripts=("campaign.js",))


def _note(results: CampaignResults) -> str:
    boxed = any(len(p.rows) >= _MIN_BOXED for p in results.points)
    boxes = f" Boxes, of {_MIN_BOXED} runs and more: quartiles and median; whiskers: extremes." if boxed else ""
    return f"A mark is a run: a disc succeeded, a cross did not.{boxes}"


Strip = tuple[int, bool, list[int], list[float]]
"""Group, whether the runs succeeded, their rows and their places."""


def _strips(results: CampaignResults, layout: PointLayout) -> list[Strip]:
    success = results.table.column("success")
    strips: list[Strip] = []
    for group in range(len(layout.group_names)):
        for succeeded in (True, False):
            rows: list[int] = []
            places: list[float] = []
            for k, point in enumerate(results.points):
                if layout.groups[k] == group:
                    chosen = np.array([(success[row] is True) == succeeded for row in point.rows])
                    rows += point.rows[chosen].tolist()
                    places += layout.beside(k, len(point.rows))[chosen].tolist()
            if rows:
                strips.append((group, succeeded, rows, places))
    return strips


def _traces(results: CampaignResults, layout: PointLayout, strips: Sequence[Strip]) -> list[dict[str, Any]]:
    """Return boxes by group, then strips, without their values."""
    along, across = ("y", "x") if layout.listed else ("x", "y")
    boxed = [layout.groups[k] for k, point in enumerate(results.points) if len(point.rows) >= _MIN_BOXED]
    boxes = [_box_trace(layout, in_legend=group in boxed[:1]) for group, _ in enumerate(layout.group_names)]
    mixed = len({succeeded for _, succeeded, _, _ in strips}) > 1
    columns = [results.table.column(n) for n in ("run", "seed", "success")]
    traces: list[dict[str, Any]] = []
    for group, succeeded, rows, places in strips:
        name, outcome = layout.group_names[group], _ENDED[succeeded]
        hover = [
            [run, int(seed), _ENDED[success]] for run, seed, success in zip(*(c[rows] for c in columns), strict=True)
        ]
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                along: places,
                "name": ", ".join(filter(None, (name, outcome if mixed or not (name and succeeded) else ""))),
                "marker": _marker(f"var(--c{group})", _SUCCESS if succeeded else _OTHER),
                "customdata": hover,
                "hovertemplate": f"%{{customdata[0]}}<br>seed %{{customdata[1]}}<br>%{{{across}:.4g}}"
                "<br>%{customdata[2]}<extra></extra>",
            }
        )
    return [*boxes, *traces]


def _marker(colour: str, symbol: str) -> dict[str, Any]:
    line = {"width": 0} if symbol == _SUCCESS else {"color": colour, "width": 2}
    return {"symbol": symbol, "size": 7, "color": colour, "opacity": 0.8, "line": line}


def _box_trace(layout: PointLayout, *, in_legend: bool) -> dict[str, Any]:
    return {
        "type": "box",
        "orientation": "h" if layout.listed else "v",
        "width": 0.75 * layout.room,
        "line": {"color": "var(--soft)", "width": 1.2},
        "fillcolor": "rgba(128,128,128,0.10)",
        "hoverinfo": "skip",
        "name": "median, quartiles, extremes",
        "showlegend": in_legend,
    }


def _choice(results: CampaignResults, layout: PointLayout, name: str, strips: Sequence[Strip]) -> dict[str, Any]:
    """Return a metric's axis, description, and the values of the traces."""
    column = results.table.column(name)
    unit = display_unit(results.table.unit(name), column)
    values = column * unit.factor
    across = "x" if layout.listed else "y"
    of_groups = [
        [k for k in range(len(results.points)) if layout.groups[k] == group] for group in range(len(layout.group_names))
    ]
    boxes = [
        _boxes(
            {float(layout.places[k]): values[results.points[k].rows] for k in of_group}, "y" if layout.listed else "x"
        )
        for of_group in of_groups
    ]
    words = name.replace("_", " ")
    return {
        "name": words,
        "axis": unit.axis(f"{words}<br>" if layout.listed else words),
        "description": results.table.description(name),
        "traces": [*boxes, *({across: _plain(values[rows])} for _, _, rows, _ in strips)],
    }


def _boxes(points: Mapping[float, Floats], along: str) -> dict[str, Any]:
    """Return what Plotly needs for a box at each place where the runs are many."""
    shares = {"lowerfence": 0.0, "q1": 0.25, "median": 0.5, "q3": 0.75, "upperfence": 1.0}
    kept = {place: x[np.isfinite(x)] for place, x in points.items()}
    many = {place: x for place, x in kept.items() if len(x) >= _MIN_BOXED}
    quantiles = {n: _plain([np.quantile(x, share) for x in many.values()]) for n, share in shares.items()}
    return {along: list(many), **quantiles}


def _plain(values: Any) -> list[float | None]:
    """Return numbers to six digits, None for those that are not finite."""
    return [float(f"{v:.6g}") if np.isfinite(v) else None for v in values]
