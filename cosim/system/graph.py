"""The graph of a system: the layout of its units, and a picture (SVG) of them and the signals between them.

Few units stand around a circle, in the order in which signals flow; many by a force-directed layout.
"""

import html
import itertools
from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from handover.cosim.blocks.ports import Floats

if TYPE_CHECKING:
    from handover.cosim.system.system import Connection, PlacedUnit, System

Pair = tuple[str, str]
"""Names of the units that signals go from and to."""

_MAX_ON_A_CIRCLE = 8
_BEND = 0.16
"""Offset of a bent line's middle from the straight line, as a share of its length."""
_POINTS = 21


def places(units: Sequence[str], pairs: Collection[Pair]) -> dict[str, Floats]:
    """Return each unit's position, shape (2,), within -1 and 1 each way; the same for the same system.

    Few units lie on a circle, clockwise from the top, in the order that minimizes the total distance of signals around
    it; two lie side by side. Of many units, connected ones lie near each other, if networkx is installed; else they lie
    on a circle as they come.
    """
    if len(units) <= 2:
        return {name: np.array([2.0 * k - (len(units) - 1.0), 0.0]) for k, name in enumerate(units)}
    if len(units) <= _MAX_ON_A_CIRCLE:
        return _around(_flow(units, pairs))
    return _near_each_other(units, pairs)


def bent(a: Floats, b: Floats) -> Floats:
    """Return points of a line from a to b bent to its left, shape (n, 2): both directions are seen apart."""
    along = b - a
    middle = (a + b) / 2.0 + 2.0 * _BEND * np.array([-along[1], along[0]])
    s = np.linspace(0.0, 1.0, _POINTS)[:, np.newaxis]
    return (1.0 - s) ** 2 * a + 2.0 * s * (1.0 - s) * middle + s**2 * b


def _flow(units: Sequence[str], pairs: Collection[Pair]) -> list[str]:
    """Return the order with the least sum of clockwise steps from source to target; the first unit stays first."""
    first, *others = units

    def steps(order: tuple[str, ...]) -> int:
        at = {name: k for k, name in enumerate((first, *order))}
        return sum((at[b] - at[a]) % len(units) for a, b in pairs)

    return [first, *min(itertools.permutations(others), key=steps)]


def _around(order: Sequence[str]) -> dict[str, Floats]:
    angles = 2.0 * np.pi * np.arange(len(order)) / len(order)
    return {name: np.array([np.sin(angle), np.cos(angle)]) for name, angle in zip(order, angles, strict=True)}


def _near_each_other(units: Sequence[str], pairs: Collection[Pair]) -> dict[str, Floats]:
    """Return positions by Kamada and Kawai's layout, started from a circle, that fill the square."""
    try:
        import networkx as nx  # takes long to load, and few units need none of it
    except ModuleNotFoundError:  # it comes with what reports need
        return _around(units)
    graph = cast(Any, nx).Graph()
    graph.add_nodes_from(units)
    graph.add_edges_from(pairs)
    layout = cast(dict[str, Floats], nx.kamada_kawai_layout(graph, pos=cast(Any, nx).circular_layout(graph)))
    points: Floats = np.array([layout[name] for name in units])
    low, high = points.min(axis=0), points.max(axis=0)
    return {name: 2.0 * (layout[name] - low) / np.maximum(high - low, 1e-9) - 1.0 for name in units}


_COLOURS = ("#2f6db5", "#d1602b", "#3c8d53", "#8357a8", "#a37a10", "#4d5866", "#c2487f", "#1f8a94", "#7d5a3c")
_WIDTH, _HEIGHT = 720, 400
_BOX_WIDTH, _LINE_HEIGHT, _LETTER = 170, 15, 6.6
"""Least width of a unit's box, height of a line of text in it, width of a letter, pixels."""
_NAME, _DETAIL = ' font-weight="bold"', ""
"""Attributes of the first line of text in a box, and of the others."""
_BOX = np.array([_BOX_WIDTH + 12.0, 3.0 * _LINE_HEIGHT + 22.0])
"""Room of a box, pixels; that of another does not begin within it."""
_ROUNDS = 200
"""In which boxes are moved apart, at most."""
_FEW = 12
"""Number of units up to which a box has room for more than the name."""


def system_svg(system: "System") -> str:
    """Return a picture of a system: a box for each unit, a line for all signals from one to another, with tooltips."""
    names = list(system.units)
    bundles: dict[Pair, list[Connection]] = {}
    for c in system.connections:
        if c.source.unit != c.target.unit and {c.source.unit, c.target.unit} <= set(names):
            bundles.setdefault((c.source.unit, c.target.unit), []).append(c)
    width = max(_WIDTH, 90 * int(np.sqrt(len(names))))
    height = 240 if len(names) <= 2 else _HEIGHT * width // _WIDTH
    inner = np.array([width / 2 - _BOX_WIDTH * 0.65, height / 2 - 45])
    at = {
        name: np.array([width / 2, height / 2]) + p * np.array([1.0, -1.0]) * inner
        for name, p in places(names, bundles).items()
    }
    _move_apart(at)
    points = np.array(list(at.values()))
    beyond = np.maximum(_BOX / 2.0 - points.min(axis=0), 0.0)
    at = {name: p + beyond for name, p in at.items()}
    width, height = (float(x) for x in np.maximum((width, height), points.max(axis=0) + beyond + _BOX / 2.0).round())
    colour = {name: _COLOURS[k % len(_COLOURS)] for k, name in enumerate(names)}
    lines = [
        _arrow(bent(at[a], at[b]), colour[a], _connections_text(system, a, b, cs)) for (a, b), cs in bundles.items()
    ]
    boxes = [
        _box(unit, at[unit.name], colour[unit.name], detailed=len(names) <= _FEW) for unit in system.units.values()
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" role="img" '
        f'aria-label="graph of {len(names)} units" style="max-width: 100%; background: #fff; font: 12px sans-serif">'
        f"{''.join(lines)}{''.join(boxes)}</svg>"
    )


def _move_apart(at: dict[str, Floats]) -> None:
    """Move the middles of boxes until no box covers another: of two, each half the shorter way apart."""
    for _ in range(_ROUNDS):
        overlapping = [(a, b) for a, b in itertools.combinations(at, 2) if np.all(np.abs(at[b] - at[a]) < _BOX)]
        if not overlapping:
            return
        for a, b in overlapping:
            over = _BOX - np.abs(at[b] - at[a])
            along = over == over.min()
            push = np.where(along, 0.51 * over, 0.0) * np.where(at[b] >= at[a], 1.0, -1.0)
            at[a], at[b] = at[a] - push, at[b] + push


def _connections_text(system: "System", source: str, target: str, connections: "Sequence[Connection]") -> str:
    outputs = system.units[source].description.outputs
    lines = [f"{source} → {target}"]
    for c in connections:
        port = c.source.port if c.source.port == c.target.port else f"{c.source.port} → {c.target.port}"
        lines.append(f"{port} ({outputs[c.source.port].signature})" if c.source.port in outputs else port)
    return "\n".join(lines)


def _arrow(points: Floats, colour: str, title: str) -> str:
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points.tolist())
    middle = points[len(points) // 2]
    along = points[len(points) // 2 + 1] - middle
    angle = float(np.degrees(np.arctan2(along[1], along[0])))
    place = f"translate({middle[0]:.1f} {middle[1]:.1f}) rotate({angle:.1f})"
    return (
        f'<g><title>{html.escape(title)}</title><polyline points="{path}" fill="none" stroke="{colour}" '
        f'stroke-width="1.8"/><path d="M-7 -6 L7 0 L-7 6 Z" fill="{colour}" transform="{place}"/></g>'
    )


def _box(unit: "PlacedUnit", at: Floats, colour: str, *, detailed: bool) -> str:
    d, period = unit.description, float(unit.period)
    rate = f"{period:.3g} s" if period >= 1.0 else f"{1000.0 * period:.3g} ms"
    details = [d.name, f"FMI {d.fmi}, {rate}{', sampled' if unit.sampled else ''}"]
    lines = [unit.name, *(details if detailed else ())]
    width, height = max(len(line) for line in lines) * _LETTER + 16, _LINE_HEIGHT * len(lines) + 10
    x, y = float(at[0]), float(at[1])
    texts = "".join(
        f'<tspan x="{x:.1f}" y="{y - height / 2 + _LINE_HEIGHT * (k + 1):.1f}"'
        f"{_NAME if k == 0 else _DETAIL}>{html.escape(line)}</tspan>"
        for k, line in enumerate(lines)
    )
    title = html.escape("\n".join([unit.name, *details]))
    return (
        f"<g><title>{title}</title>"
        f'<rect x="{x - width / 2:.1f}" y="{y - height / 2:.1f}" width="{width:.1f}" height="{height}" rx="4" '
        f'fill="#fff" stroke="{colour}" stroke-width="2"/>'
        f'<text text-anchor="middle" fill="#1f2933">{texts}</text></g>'
    )
