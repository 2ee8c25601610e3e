"""How often a campaign's runs succeeded, point by point."""

from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup

from handover.scenarios.campaign.campaign_results import CampaignResults
from handover.scenarios.campaign.point_layout import PointLayout
from handover.scenarios.reporting.plot_html import plot_html
from handover.scenarios.reporting.section import Section

_A_SCREEN = 15
"""Points of a list; the values of a longer one stand at its top."""


def success_section(results: CampaignResults, layout: PointLayout) -> Section | None:
    """Return the plot of success rates with their intervals; None if no run is done."""
    if not any(len(p.done) for p in results.points):
        return None
    figure = go.Figure()
    for group, name in enumerate(layout.group_names):
        figure.add_trace(_rates(results, layout, group, name))
    place_axis(figure, layout)
    value = "xaxis" if layout.listed else "yaxis"
    figure.update_layout({value: {"title": {"text": "success rate (%)"}, "range": [-4, 104], "dtick": 25}})
    told = Markup("<p class='soft'>Of the runs done; bars: 95 % intervals of Clopper and Pearson.</p>")
    return Section(
        anchor="success",
        title="Success",
        html=plot_html(figure, plot_height(layout), "success rate by point, with intervals") + told,
    )


def _rates(results: CampaignResults, layout: PointLayout, group: int, name: str) -> Any:
    chosen = [k for k, p in enumerate(results.points) if layout.groups[k] == group and len(p.done)]
    points = [results.points[k] for k in chosen]
    rates = np.array([p.rate for p in points]) * 100.0
    spans = [p.interval for p in points]
    low = np.array([s.low for s in spans if s]) * 100.0
    high = np.array([s.high for s in spans if s]) * 100.0
    told = [
        [results.label(p), f"{p.successes} of {len(p.done)}", f"{a:.0f} to {b:.0f} %"]
        for p, a, b in zip(points, low, high, strict=True)
    ]
    bar = {"type": "data", "array": high - rates, "arrayminus": rates - low, "thickness": 1.6, "width": 4}
    along, across = ("y", "x") if layout.listed else ("x", "y")
    return go.Scatter(
        {along: layout.places[chosen], across: rates, f"error_{across}": bar},
        mode="markers",
        marker={"size": 10, "color": f"var(--c{group})"},
        name=name,
        showlegend=len(layout.group_names) > 1,
        customdata=told,
        hovertemplate="%{customdata[0]}<br>%{customdata[1]} succeeded<br>95 %: %{customdata[2]}<extra></extra>",
    )


def place_axis(figure: Any, layout: PointLayout) -> None:
    """Give a figure the axis along which points stand."""
    axis: dict[str, Any] = {"title": {"text": layout.title}, "range": list(layout.limits)}
    if layout.ticks is not None:
        names = [name for _, name in layout.ticks]
        if layout.listed:
            names = [_broken(name) for name in names]
        axis |= {"tickmode": "array", "tickvals": [place for place, _ in layout.ticks], "ticktext": names}
    figure.update_layout({"yaxis" if layout.listed else "xaxis": axis})
    if layout.listed and len(layout.places) > _A_SCREEN:
        figure.update_layout({"xaxis": {"side": "top"}})


def plot_height(layout: PointLayout) -> int:
    """Return the height of a plot, in pixels, in which each point of a list has room for its name."""
    if not layout.listed:
        return 340
    lines = [1 + _broken(name).count("<br>") for _, name in layout.ticks or ()]
    return 110 + max(30, 17 * max(lines, default=1)) * len(layout.places)


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
