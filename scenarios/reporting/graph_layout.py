"""Places the units of a system so that signals flow around, and bends the lines between them."""

import itertools
from collections.abc import Collection, Sequence
from typing import Any, cast

import networkx as nx
import numpy as np

from handover.cosim.blocks.ports import Floats

Pair = tuple[str, str]

_MOST_ON_A_CIRCLE = 8
_BEND = 0.16
"""How far a line's middle lies beside the straight one, as a share of its length."""
_POINTS = 21


def places(units: Sequence[str], pairs: Collection[Pair]) -> dict[str, Floats]:
    """Return each unit's place, shape (2,), within -1 and 1 each way; the same for the same system.

    Few units lie on a circle, clockwise from the top, in the order in which signals have the least way to go around;
    two lie beside each other. Many lie so that connected ones are near each other.
    """
    if len(units) <= 2:
        return {name: np.array([2.0 * k - (len(units) - 1.0), 0.0]) for k, name in enumerate(units)}
    if len(units) <= _MOST_ON_A_CIRCLE:
        return _around(_flow(units, pairs))
    return _near_each_other(units, pairs)


def bent(a: Floats, b: Floats) -> Floats:
    """Return points of a line from a to b that bends to its left, shape (n, 2): there and back lie apart."""
    along = b - a
    middle = (a + b) / 2.0 + 2.0 * _BEND * np.array([-along[1], along[0]])
    s = np.linspace(0.0, 1.0, _POINTS)[:, np.newaxis]
    return (1.0 - s) ** 2 * a + 2.0 * s * (1.0 - s) * middle + s**2 * b


def _flow(units: Sequence[str], pairs: Collection[Pair]) -> list[str]:
    """Return the order in which the steps clockwise from source to target are least in sum; the first unit is first."""
    first, *others = units

    def steps(order: tuple[str, ...]) -> int:
        at = {name: k for k, name in enumerate((first, *order))}
        return sum((at[b] - at[a]) % len(units) for a, b in pairs)

    return [first, *min(itertools.permutations(others), key=steps)]


def _around(order: Sequence[str]) -> dict[str, Floats]:
    angles = 2.0 * np.pi * np.arange(len(order)) / len(order)
    return {name: np.array([np.sin(angle), np.cos(angle)]) for name, angle in zip(order, angles, strict=True)}


def _near_each_other(units: Sequence[str], pairs: Collection[Pair]) -> dict[str, Floats]:
    """Return places by Kamada and Kawai, from a circle on, that fill the square."""
    graph = cast(Any, nx).Graph()
    graph.add_nodes_from(units)
    graph.add_edges_from(pairs)
    found = cast(dict[str, Floats], nx.kamada_kawai_layout(graph, pos=cast(Any, nx).circular_layout(graph)))
    points: Floats = np.array([found[name] for name in units])
    low, high = points.min(axis=0), points.max(axis=0)
    return {name: 2.0 * (found[name] - low) / np.maximum(high - low, 1e-9) - 1.0 for name in units}
