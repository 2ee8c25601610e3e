"""The section of a page that draws a run's units and the signals between them, with a table of connections.

It is drawn by `handover.cosim.system.graph`, as in notebooks.
"""

import base64
from collections.abc import Collection, Mapping, Sequence
from typing import Any

from markupsafe import Markup

from handover.cosim.exceptions import counted
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.graph import DrawnUnit, Pair, graph_svg, port_text, rate
from handover.fmus.contents.icons import catalog_icon
from handover.scenarios.runs.reporting.html import picture_source
from handover.scenarios.runs.reporting.page import Section, template

_MAX_UNITS = 40
_MAX_ROWS = 1000
_MAX_LISTED = 14
"""Signals that a line's tooltip lists."""


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
        drawing=drawing_of(system) if len(units) <= _MAX_UNITS else None,
        units=[(u["name"], u["model"], u["fmi"], _rate(u)) for u in units],
        rows=_rows(connections[:_MAX_ROWS], run.get("conversions", ())),
        left_out=max(0, len(connections) - _MAX_ROWS),
        n_units=counted(len(units), "unit"),
        n_connections=counted(len(connections), "connection"),
    )
    return Section(anchor="graph", title="Units and signals", html=Markup(html))


def drawing_of(system: Mapping[str, Any]) -> Markup:
    """Return the picture (SVG) of a system as it is in `run.json`."""
    units: Sequence[Mapping[str, Any]] = system["units"]
    drawn = [DrawnUnit(u["name"], (u["model"], f"FMI {u['fmi']}, {_rate(u)}"), _icon(u)) for u in units]
    return Markup(graph_svg(drawn, _signals([u["name"] for u in units], system.get("connections", ()))))


def _signals(names: Collection[str], connections: Sequence[Mapping[str, Any]]) -> dict[Pair, list[str]]:
    """Return the signals' texts by the units that they go from and to."""
    texts: dict[Pair, list[str]] = {}
    for c in connections:
        (source, output), (target, input_) = (_split_port(c[end], names) for end in ("source", "target"))
        texts.setdefault((source, target), []).append(f"{port_text(output, input_)}{_form(c)}")
    return {pair: [*of[:_MAX_LISTED], *_more(len(of) - _MAX_LISTED)] for pair, of in texts.items()}


def _more(n: int) -> list[str]:
    return [f"and {n} more"] if n > 0 else []


def _split_port(port: str, names: Collection[str]) -> tuple[str, str]:
    """Return unit and port of a port's qualified name; both may have dots in them."""
    dots = [k for k, letter in enumerate(port) if letter == "."]
    at = next((k for k in reversed(dots) if port[:k] in names), dots[0])
    return port[:at], port[at + 1 :]


def _rate(unit: Mapping[str, Any]) -> str:
    return rate(unit["period"], sampled=unit["sampled"])


def _icon(unit: Mapping[str, Any]) -> str:
    """Return the icon that was in the unit's FMU; where none is kept, that of the catalog's unit, or of any block."""
    if "icon" not in unit:
        return picture_source(catalog_icon(unit["model"]).read_bytes(), "image/svg+xml")
    mime = unit["icon"]["type"]
    if mime not in ("image/svg+xml", "image/png"):
        raise ValueError(f"an icon of type {mime!r:.40}")
    return picture_source(base64.b64decode(unit["icon"]["base64"], validate=True), mime)


def _form(c: Mapping[str, Any]) -> str:
    """Return kind, unit and size of a signal, without the usual ones, such as " (m, x 3)"."""
    kind = [] if c["kind"] == "real" else [c["kind"]]
    unit = [c["unit"]] if c["unit"] not in ("", "1") else []
    size = [f"x {c['size']}"] if c["size"] != 1 else []
    text = ", ".join([*kind, *unit, *size])
    return f" ({text})" if text else ""


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
