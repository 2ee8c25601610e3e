"""The section of a page that draws a run's units and the signals between them, with a table of connections.

The layout is that of `handover.cosim.system.graph`, which draws the same for notebooks.
"""

import base64
from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import plotly.graph_objects as go
from markupsafe import Markup, escape

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.graph import Pair, bent, places
from handover.fmus.contents.icons import catalog_icon
from handover.scenarios.experiment.time_plot import COLOURS
from handover.scenarios.reporting.html import picture_source, plot_html
from handover.scenarios.reporting.page import Section, template

_MAX_UNITS = 40
_MAX_ROWS = 1000
_MAX_LISTED = 14
"""Signals that a line's tooltip lists."""
_FEW = 8
"""Number of units up to which a box has room for more than the name."""
_NODE, _ICON = 48, 36
"""Width of a unit's node and of the icon in it, of few units, pixels; those of many are smaller by `_SMALL`."""
_SMALL = 0.7
_LABEL, _LINE = 26, 14
"""Height of a box with one line of text, and of each further one, pixels."""
_EDGE = 6
"""Room above the nodes and below the boxes, pixels."""


class _Signal(NamedTuple):
    """A connection: the ports at its ends, and its entry in `run.json`."""

    output: str
    input: str
    description: Mapping[str, Any]


_Bundles = Mapping[Pair, Sequence[_Signal]]
"""Signals by the units that they go from and to."""


def graph_section(run: Mapping[str, Any]) -> Section | None:
    """Return the graph of a run's system with tables of units and connections; only the tables of a large system.

    Args:
        run: what is in `run.json`; without `system` there is no section.
    """
    system: Mapping[str, Any] = run.get("system", {})
    units: Sequence[Mapping[str, Any]] = system.get("units", ())
    if not units:
        return None
    connections: Sequence[Mapping[str, Any]] = system.get("connections", ())
    html = template("graph.html").render(
        plot=_plot(units, _bundled([u["name"] for u in units], connections)) if len(units) <= _MAX_UNITS else None,
        units=[(u["name"], u["model"], u["fmi"], rate(u)) for u in units],
        rows=_rows(connections[:_MAX_ROWS], run.get("conversions", ())),
        left_out=max(0, len(connections) - _MAX_ROWS),
        n_units=counted(len(units), "unit"),
        n_connections=counted(len(connections), "connection"),
    )
    return Section(anchor="graph", title="Units and signals", html=Markup(html))


def rate(unit: Mapping[str, Any]) -> str:
    """Return a unit's step as text, such as "33.3 ms, sampled"."""
    period = unit["period"]
    text = "steps vary" if period is None else f"{period:.3g} s" if period >= 1.0 else f"{1000.0 * period:.3g} ms"
    return text + (", sampled" if unit["sampled"] else "")


def _bundled(names: Collection[str], connections: Sequence[Mapping[str, Any]]) -> _Bundles:
    bundles: dict[Pair, list[_Signal]] = {}
    for c in connections:
        (source, output), (target, input_) = (_split_port(c[end], names) for end in ("source", "target"))
        bundles.setdefault((source, target), []).append(_Signal(output=output, input=input_, description=c))
    return bundles


def _split_port(port: str, names: Collection[str]) -> tuple[str, str]:
    """Return unit and port of a port's qualified name; both may have dots in them."""
    dots = [k for k, letter in enumerate(port) if letter == "."]
    at = next((k for k in reversed(dots) if port[:k] in names), dots[0])
    return port[:at], port[at + 1 :]


def _plot(units: Sequence[Mapping[str, Any]], bundles: _Bundles) -> Markup:
    names = [u["name"] for u in units]
    between = {pair: cs for pair, cs in bundles.items() if pair[0] != pair[1]}
    at = places(names, between)
    colour = {name: f"var(--c{k % len(COLOURS)})" for k, name in enumerate(names)}
    lines = [bent(at[a], at[b]) for a, b in between]
    drawn = [_line(points, colour[a]) for points, (a, _) in zip(lines, between, strict=True)]
    heads = [
        _head(points, _signal_text(*pair, cs), colour[pair[0]])
        for points, (pair, cs) in zip(lines, between.items(), strict=True)
    ]
    detailed = len(units) <= _FEW
    scale = 1.0 if detailed else _SMALL
    pixel = 1.0 / (80 if len(units) <= 2 else 112 + 16 * min(len(units), 10))
    top = 1.0 + (scale * _NODE / 2 + _EDGE) * pixel
    bottom = -top - (_LABEL + 3 * _LINE * detailed) * pixel
    axis = {"visible": False, "fixedrange": True}
    figure = go.Figure(
        [*drawn, *heads, _nodes([at[name] for name in names], [colour[name] for name in names], scale)],
        {
            "xaxis": {**axis, "range": [-1.6, 1.6]},
            "yaxis": {**axis, "range": [bottom, top]},
            "images": [_picture(u, at[u["name"]], scale * _ICON * pixel) for u in units],
            "annotations": [_box(u, at[u["name"]], colour[u["name"]], scale, detailed=detailed) for u in units],
            "showlegend": False,
            "hovermode": "closest",
            "dragmode": False,
            "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
        },
    )
    text = "; ".join(f"{a} to {b}: {', '.join(s.output for s in signals)}" for (a, b), signals in bundles.items())
    return plot_html(figure, height=round((top - bottom) / pixel), label=f"Graph of {len(units)} units. {text}")


def _nodes(places: Sequence[Floats], colours: Sequence[str], scale: float) -> Any:
    """Return what the icons lie on: lines end at it."""
    return go.Scatter(
        x=[float(p[0]) for p in places],
        y=[float(p[1]) for p in places],
        mode="markers",
        marker={
            "symbol": "circle",
            "size": scale * _NODE,
            "color": "var(--card)",
            "opacity": 1,
            "line": {"width": 2, "color": list(colours)},
        },
        hoverinfo="skip",
    )


def _icon(unit: Mapping[str, Any]) -> str:
    """Return the icon that was in the unit's FMU; where none is kept, that of the catalog's unit, or of any block."""
    if "icon" not in unit:
        return picture_source(catalog_icon(unit["model"]).read_bytes(), "image/svg+xml")
    mime = unit["icon"]["type"]
    if mime not in ("image/svg+xml", "image/png"):
        raise ValueError(f"an icon of type {mime!r:.40}")
    return picture_source(base64.b64decode(unit["icon"]["base64"], validate=True), mime)


def _picture(unit: Mapping[str, Any], at: Floats, size: float) -> dict[str, Any]:
    """Return a unit's icon, as high as `size`, in units of the axis; it is square."""
    return {
        "source": _icon(unit),
        "xref": "x",
        "yref": "y",
        "x": float(at[0]),
        "y": float(at[1]),
        "sizex": 1.0,
        "sizey": size,
        "xanchor": "center",
        "yanchor": "middle",
        "layer": "above",
    }


def _line(points: Floats, colour: str) -> Any:
    line = {"color": colour, "width": 1.8}
    return go.Scatter(x=points[:, 0], y=points[:, 1], mode="lines", line=line, hoverinfo="skip")


def _head(points: Floats, text: str, colour: str) -> Any:
    """Return an arrow's head with its tooltip, in the middle of the line, which boxes of any size leave free."""
    middle = len(points) // 2
    ends = points[middle - 1 : middle + 1]
    return go.Scatter(
        x=ends[:, 0],
        y=ends[:, 1],
        mode="markers",
        marker={
            "symbol": "arrow",
            "angleref": "previous",
            "size": [0, 15],
            "color": colour,
            "opacity": 1,
            "line": {"width": 0},
        },
        hovertext=["", text],
        hoverinfo="text",
        hoverlabel={"align": "left"},
    )


def _signal_text(source: str, target: str, signals: Sequence[_Signal]) -> str:
    lines = [f"<b>{escape(source)} → {escape(target)}</b>"]
    for s in signals[:_MAX_LISTED]:
        port = s.output if s.output == s.input else f"{s.output} → {s.input}"
        lines.append(f"{escape(port)}{escape(_form(s.description))}")
    if len(signals) > _MAX_LISTED:
        lines.append(f"and {len(signals) - _MAX_LISTED} more")
    return "<br>".join(lines)


def _form(c: Mapping[str, Any]) -> str:
    """Return kind, unit and size of a signal, without the usual ones, such as " (m, x 3)"."""
    kind = [] if c["kind"] == "real" else [c["kind"]]
    unit = [c["unit"]] if c["unit"] not in ("", "1") else []
    size = [f"x {c['size']}"] if c["size"] != 1 else []
    text = ", ".join([*kind, *unit, *size])
    return f" ({text})" if text else ""


def _box(unit: Mapping[str, Any], at: Floats, colour: str, scale: float, *, detailed: bool) -> dict[str, Any]:
    """Return the text below a unit's node."""
    name, model = escape(unit["name"]), escape(unit["model"])
    details = f"FMI {escape(unit['fmi'])}, {escape(rate(unit))}"
    lines = details.replace(", sampled", "<br>sampled")  # narrow, for phones
    return {
        "x": float(at[0]),
        "y": float(at[1]),
        "text": f"<b>{name}</b><br>{model}<br>{lines}" if detailed else f"<b>{name}</b>",
        "hovertext": f"{name}: {model}, {details}",
        "showarrow": False,
        "yanchor": "top",
        "yshift": -scale * _NODE / 2,
        "bgcolor": "var(--card)",
        "bordercolor": colour,
        "borderwidth": 2,
        "borderpad": 6,
        "font": {"size": 11},
    }


def _rows(
    connections: Sequence[Mapping[str, Any]], conversions: Sequence[Mapping[str, Any]]
) -> list[tuple[str, str, str, str, str]]:
    """Return source, target, unit, size and conversion of each connection."""
    changes = {(c["source"], c["target"]): str(LinearTransformation(c["factor"], c["offset"])) for c in conversions}
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
