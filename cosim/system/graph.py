"""The graph of a system: the layout of its units, and a picture (SVG) of them and the signals between them.

Few units stand around a circle, in the order in which signals flow; many by a force-directed layout.
"""

import html
import itertools
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted

if TYPE_CHECKING:
    from handover.cosim.system.system import Connection, System

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


_LEAST_SCALE = 0.8
"""Of a graph where it is shrunk to fit a page: its texts have 12 px then, of which 10 are legible."""

COLOURS = ("#2f6db5", "#d1602b", "#3c8d53", "#8357a8", "#a37a10", "#4d5866", "#c2487f", "#1f8a94", "#7d5a3c")
"""Of units and of curves, in turn; the same as `--c0` and on of a report's page in its light scheme."""
_WIDTH, _HEIGHT = 720, 400
_LEAST_WIDTH, _LINE_HEIGHT, _LETTER, _ICON = 120, 15, 6.6, 36
"""Least width of a unit's box, height of a line of text in it, width of a letter, size of an icon, pixels."""
_GAP = 26.0
"""Least distance of two boxes, pixels: an arrow's head is seen between them."""
_ROUNDS = 200
"""In which boxes are moved apart, at most."""
_FEW = 12
"""Number of units up to which a box has room for more than the name."""


@dataclass(frozen=True)
class DrawnUnit:
    """A unit in the picture of a system.

    Attributes:
        name: in the system.
        details: further lines of text: in the box if there are few units, else in its tooltip.
        icon: address of its icon, a square; "" without.
    """

    name: str
    details: Sequence[str]
    icon: str = ""


def system_svg(system: "System") -> str:
    """Return a picture of a system: a box for each unit, a line for all signals from one to another, with tooltips."""
    bundles: dict[Pair, list[Connection]] = {}
    for c in system.connections:
        if {c.source.unit, c.target.unit} <= set(system.units):
            bundles.setdefault((c.source.unit, c.target.unit), []).append(c)
    units = [
        DrawnUnit(name, (u.description.name, f"FMI {u.description.fmi}, {rate(float(u.period), sampled=u.sampled)}"))
        for name, u in system.units.items()
    ]
    return graph_svg(units, {pair: [_signal_text(system, c) for c in cs] for pair, cs in bundles.items()})


def rate(period: float | None, *, sampled: bool) -> str:
    """Return a unit's step as text, such as "33.3 ms, sampled"; None for steps that vary."""
    text = "steps vary" if period is None else f"{period:.3g} s" if period >= 1.0 else f"{1000.0 * period:.3g} ms"
    return text + (", sampled" if sampled else "")


def port_text(output: str, input_: str) -> str:
    """Return a signal's ports as text: one name where both ends have the same."""
    return output if output == input_ else f"{output} \N{RIGHTWARDS ARROW} {input_}"


def graph_svg(units: Sequence[DrawnUnit], signals: Mapping[Pair, Sequence[str]]) -> str:
    """Return a picture of units and of the signals between them, in the page's colours if it has any.

    Args:
        units: in the system's order.
        signals: texts of the signals by the units that they go from and to; those from a unit to itself are not drawn.
    """
    names = [unit.name for unit in units]
    between = {pair: texts for pair, texts in signals.items() if pair[0] != pair[1]}
    texts = {u.name: [u.name, *(u.details if len(units) <= _FEW else ())] for u in units}
    boxes = {u.name: _box_size(texts[u.name], u.icon) for u in units}
    largest = np.max(list(boxes.values()), axis=0)
    width = max(_WIDTH, 2.5 * np.sqrt(len(names) * np.prod(largest)))
    height = largest[1] + 180 if len(names) <= 2 else _HEIGHT * width / _WIDTH
    inner = np.array([width, height]) / 2 - 0.6 * largest
    at = {name: np.array([1.0, -1.0]) * p * inner for name, p in places(names, between).items()}
    _move_apart(at, boxes)
    curves = {(a, b): bent(at[a], at[b]) for a, b in between}
    corners = [at[name] + sign * boxes[name] / 2 for name in names for sign in (-1, 1)]
    drawn = np.vstack([*corners, *curves.values()])
    low = drawn.min(axis=0) - _GAP
    width, height = (drawn.max(axis=0) + _GAP - low).round()
    at, curves = {n: p - low for n, p in at.items()}, {pair: points - low for pair, points in curves.items()}
    colour = {n: f"var(--c{k % len(COLOURS)}, {COLOURS[k % len(COLOURS)]})" for k, n in enumerate(names)}
    heads = {pair: _head(points, at, boxes) for pair, points in curves.items()}
    titles = {(a, b): "\n".join([f"{a} \N{RIGHTWARDS ARROW} {b}", *of]) for (a, b), of in between.items()}
    lines = [_arrow(curves[pair], heads[pair], colour[pair[0]], titles[pair]) for pair in between]
    shown = [_box(u, texts[u.name], at[u.name], boxes[u.name], colour[u.name]) for u in units]
    listed = "; ".join(f"{a} to {b}: {', '.join(of)}" for (a, b), of in signals.items())
    label = html.escape(f"graph of {counted(len(names), 'unit')}. {listed}")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" role="img" '
        f'aria-label="{label}" style="--least-width: {_LEAST_SCALE * width:.0f}px; background: var(--page, #fff); '
        f'font: 12px sans-serif">{"".join(lines)}{"".join(shown)}</svg>'
    )


def _box_size(lines: Sequence[str], icon: str) -> Floats:
    width = max(_LEAST_WIDTH, max(map(len, lines)) * _LETTER + 16)
    return np.array([width, _LINE_HEIGHT * len(lines) + 10.0 + (_ICON + 4.0 if icon else 0.0)])


def _move_apart(at: dict[str, Floats], boxes: Mapping[str, Floats]) -> None:
    """Move the middles of boxes until no box covers another: of two, each half the shorter way apart."""
    for _ in range(_ROUNDS):
        moved = False
        for a, b in itertools.combinations(at, 2):
            over = (boxes[a] + boxes[b]) / 2 + _GAP - np.abs(at[b] - at[a])
            if np.all(over > 0.0):
                push = np.where(over == over.min(), 0.51 * over, 0.0) * np.where(at[b] >= at[a], 1.0, -1.0)
                at[a], at[b] = at[a] - push, at[b] + push
                moved = True
        if not moved:
            return


def _signal_text(system: "System", c: "Connection") -> str:
    outputs = system.units[c.source.unit].description.outputs
    port = port_text(c.source.port, c.target.port)
    return f"{port} ({outputs[c.source.port].signature})" if c.source.port in outputs else port


def _head(points: Floats, at: Mapping[str, Floats], boxes: Mapping[str, Floats]) -> int:
    """Return the index of the point nearest a line's middle that no box covers; that of the middle if all are."""
    covered = [np.all(np.abs(points - at[name]) < boxes[name] / 2 + 7.0, axis=1) for name in at]
    free = np.flatnonzero(~np.any(covered, axis=0))
    middle = len(points) // 2
    return int(min(free, key=lambda k: abs(k - middle))) if len(free) else middle


def _arrow(points: Floats, head: int, colour: str, title: str) -> str:
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points.tolist())
    middle, along = points[head], points[min(head + 1, len(points) - 1)] - points[max(head - 1, 0)]
    angle = float(np.degrees(np.arctan2(along[1], along[0])))
    place = f"translate({middle[0]:.1f} {middle[1]:.1f}) rotate({angle:.1f})"
    return (
        f'<g><title>{html.escape(title)}</title><polyline points="{path}" fill="none" stroke="transparent" '
        f'stroke-width="12"/><polyline points="{path}" fill="none" stroke="{colour}" '
        f'stroke-width="1.8"/><path d="M-7 -6 L7 0 L-7 6 Z" fill="{colour}" transform="{place}"/></g>'
    )


def _box(unit: DrawnUnit, lines: Sequence[str], at: Floats, size: Floats, colour: str) -> str:
    (x, y), (width, height) = (at - size / 2).tolist(), size.tolist()
    first = y + 5.0 + (_ICON + 4.0 if unit.icon else 0.0)
    texts = "".join(
        f'<tspan x="{at[0]:.1f}" y="{first + _LINE_HEIGHT * (k + 0.75):.1f}"{bold}>{html.escape(line)}</tspan>'
        for k, (line, bold) in enumerate(zip(lines, [' font-weight="bold"', *[""] * len(lines)], strict=False))
    )
    icon = f'<image href="{html.escape(unit.icon)}" x="{at[0] - _ICON / 2:.1f}" y="{y + 5:.1f}" width="{_ICON}"/>'
    return (
        f"<g><title>{html.escape(chr(10).join([unit.name, *unit.details]))}</title>"
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" rx="4" '
        f'fill="var(--card, #fff)" stroke="{colour}" stroke-width="2"/>{icon if unit.icon else ""}'
        f'<text text-anchor="middle" fill="var(--ink, #1f2933)">{texts}</text></g>'
    )
