"""Draws the units of a run and what flows between them."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from markupsafe import Markup, escape

from cosim.linear import Linear
from cosim.ports import Floats
from scenarios.reporting.graph_layout import bent, places
from scenarios.reporting.page import template
from scenarios.reporting.plot_html import plot_html
from scenarios.reporting.section import Section

_MOST_UNITS = 40
_MOST_ROWS = 1000
_MOST_TOLD = 14
"""Signals of a line that are told where one points at it."""
_COLOURS = 8  # of page.css
_FEW = 8
"""Units beyond which a box has room for the name alone."""

_Bundles = Mapping[tuple[str, str], Sequence[Mapping[str, Any]]]
"""Connections by the units that they go from and to."""


def graph_section(run: Mapping[str, Any]) -> Section | None:
    """Return the graph of a run's system with a table of its connections; a table alone of a large one.

    Args:
        run: what is in `run.json`; without `system` there is no section.
    """
    system: Mapping[str, Any] = run.get("system", {})
    units: Sequence[Mapping[str, Any]] = system.get("units", ())
    if not units:
        return None
    connections: Sequence[Mapping[str, Any]] = system.get("connections", ())
    html = template("graph.html").render(
        plot=_plot(units, _bundled(connections)) if len(units) <= _MOST_UNITS else None,
        units=[(u["name"], u["model"], u["fmi"], rate(u)) for u in units],
        rows=_rows(connections[:_MOST_ROWS], run.get("conversions", ())),
        left_out=max(0, len(connections) - _MOST_ROWS),
        connections=len(connections),
    )
    return Section(anchor="graph", title="Units and signals", html=Markup(html))


def rate(unit: Mapping[str, Any]) -> str:
    """Return how often a unit steps, as one reads it, such as "33.3 ms, sampled"."""
    period = unit["period"]
    told = "steps vary" if period is None else f"{period:.3g} s" if period >= 1.0 else f"{1000.0 * period:.3g} ms"
    return told + (", sampled" if unit["sampled"] else "")


def _unit_of(port: str, names: Sequence[str] = ()) -> str:
    """Return the unit of a port's whole name; units' and ports' names may have dots."""
    fitting = [name for name in names if port.startswith(f"{name}.")]
    return max(fitting, key=len) if fitting else port.partition(".")[0]


def _bundled(connections: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str], list[Mapping[str, Any]]]:
    bundles: dict[tuple[str, str], list[Mapping[str, Any]]] = {}
    for c in connections:
        bundles.setdefault((_unit_of(c["source"]), _unit_of(c["target"])), []).append(c)
    return bundles


def _plot(units: Sequence[Mapping[str, Any]], bundles: _Bundles) -> Markup:
    names = [u["name"] for u in units]
    between = {pair: cs for pair, cs in bundles.items() if pair[0] != pair[1]}
    at = places(names, between)
    colour = {name: f"var(--c{k % _COLOURS})" for k, name in enumerate(names)}
    traces = [_arrow(at[a], at[b], a, b, cs, colour[a]) for (a, b), cs in between.items()]
    reach = 1.25 if len(units) > 2 else 1.6
    axis = {"visible": False, "fixedrange": True}
    figure = go.Figure(
        traces,
        {
            "xaxis": {**axis, "range": [-reach - 0.1, reach + 0.1]},
            "yaxis": {**axis, "range": [-reach, reach]},
            "annotations": [_box(u, at[u["name"]], colour[u["name"]], few=len(units) <= _FEW) for u in units],
            "showlegend": False,
            "hovermode": "closest",
            "dragmode": False,
            "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        },
    )
    told = "; ".join(f"{a} to {b}: {', '.join(_port(c['source']) for c in cs)}" for (a, b), cs in bundles.items())
    height = 230 if len(units) <= 2 else 440 if len(units) <= _FEW else 620
    return plot_html(figure, height=height, label=f"Graph of {len(units)} units. {told}")


def _arrow(a: Floats, b: Floats, source: str, target: str, cs: Sequence[Mapping[str, Any]], colour: str) -> Any:
    """Return a bent line with its head in the middle, where boxes of any size leave it free."""
    points, head = bent(a, b), len(bent(a, b)) // 2
    sizes = np.where(np.arange(len(points)) == head, 15, 0)
    return go.Scatter(
        x=points[:, 0],
        y=points[:, 1],
        mode="lines+markers",
        line={"color": colour, "width": 1.8},
        marker={"symbol": "arrow", "angleref": "previous", "size": sizes, "color": colour, "opacity": 1},
        hovertext=_told(source, target, cs),
        hoverinfo="text",
        hoverlabel={"align": "left"},
    )


def _told(source: str, target: str, cs: Sequence[Mapping[str, Any]]) -> str:
    lines = [f"<b>{escape(source)} → {escape(target)}</b>"]
    for c in cs[:_MOST_TOLD]:
        out, into = _port(c["source"]), _port(c["target"])
        port = out if out == into else f"{out} → {into}"
        lines.append(f"{escape(port)}{escape(_form(c))}")
    if len(cs) > _MOST_TOLD:
        lines.append(f"and {len(cs) - _MOST_TOLD} more")
    return "<br>".join(lines)


def _form(c: Mapping[str, Any]) -> str:
    """Return unit and size of a signal, where they say something, such as " (m, 3)"."""
    kind = [] if c["kind"] == "real" else [c["kind"]]
    unit = [c["unit"]] if c["unit"] not in ("", "1") else []
    size = [f"x {c['size']}"] if c["size"] != 1 else []
    told = ", ".join([*kind, *unit, *size])
    return f" ({told})" if told else ""


def _port(name: str) -> str:
    return name.partition(".")[2]


def _box(unit: Mapping[str, Any], at: Floats, colour: str, *, few: bool) -> dict[str, Any]:
    name, model = escape(unit["name"]), escape(unit["model"])
    rest = f"FMI {escape(unit['fmi'])}, {escape(rate(unit))}"
    return {
        "x": float(at[0]),
        "y": float(at[1]),
        "text": f"<b>{name}</b><br>{model}<br>{rest}" if few else f"<b>{name}</b>",
        "hovertext": f"{name}: {model}, {rest}",
        "showarrow": False,
        "bgcolor": "var(--card)",
        "bordercolor": colour,
        "borderwidth": 2,
        "borderpad": 6,
        "font": {"size": 12},
    }


def _rows(
    connections: Sequence[Mapping[str, Any]], conversions: Sequence[Mapping[str, Any]]
) -> list[tuple[str, str, str, str, str]]:
    """Return source, target, unit, size and conversion of each connection."""
    changes = {(c["source"], c["target"]): str(Linear(c["factor"], c["offset"])) for c in conversions}
    return [
        (
            c["source"],
            c["target"],
            "" if c["unit"] == "1" else c["unit"],
            str(c["size"]) if c["kind"] == "real" else f"{c['size']} {c['kind']}",
            changes.get((c["source"], c["target"]), ""),
        )
        for c in connections
    ]
