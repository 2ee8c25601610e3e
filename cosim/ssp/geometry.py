"""The diagram of a system in an SSP: where units, connectors and lines are drawn, by the layout of a report's graph.

Units are boxes at the places of `handover.cosim.system.graph`, stretched until no two overlap; x is to the right and y
upwards. A connector is at the side of its box at which the unit that it is connected to lies: so lines leave a box
without crossing it.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.variable import Causality
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.system.graph import bent, places
from handover.cosim.system.system import PortName, System

_LEAST, _GREATEST = 40.0, 80.0
"""Sizes of a box, each way."""
_PITCH = 3.0
"""Distance of connectors at one side, as far as the greatest size allows it."""
_GAP = 40.0
"""Least distance of two boxes, horizontal or vertical."""
_STUB = 10.0
"""Length of the straight piece with which a line leaves a box."""
_MARGIN = 10.0
_EVERY = 5
"""Of the points of a bent line, the share that a diagram gets is one in so many."""

_LEFT, _RIGHT = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
_DOWN, _UP = np.array([0.0, -1.0]), np.array([0.0, 1.0])
_SIDES = (_LEFT, _RIGHT, _DOWN, _UP)
"""The sides of a box by the direction in which lines leave it."""


class ConnectorName(NamedTuple):
    """A connector of a unit; it is a port or one of its entries."""

    unit: str
    name: str


class _Spot(NamedTuple):
    """Where a connector is: from (0, 0) to (1, 1) of its box, and at which of the `_SIDES`."""

    at: Floats
    side: Floats


class Diagram:
    """Adds the elements of geometry to those of a system's structure.

    Args:
        system: the system.
        shown: the ports of each unit that are connectors, in their order.
    """

    def __init__(self, system: System, shown: Mapping[str, Sequence[FmuPort]]) -> None:
        pairs = [(c.source.unit, c.target.unit) for c in system.connections]
        layout = places(list(system.units), {pair for pair in pairs if pair[0] != pair[1]})
        partners: dict[PortName, list[Floats]] = {}
        for c in system.connections:
            partners.setdefault(c.source, []).append(layout[c.target.unit])
            partners.setdefault(c.target, []).append(layout[c.source.unit])
        self._spots: dict[ConnectorName, _Spot] = {}
        for unit, ports in shown.items():
            self._spots |= _spots(unit, ports, layout[unit], partners)
        self._size = {unit: self._needed(unit) for unit in shown}
        stretch = _stretch(layout, self._size)
        self._middle = {unit: stretch * at for unit, at in layout.items()}
        self._outlines = [m + k * self._size[u] / 2.0 for u, m in self._middle.items() for k in (-1.0, 1.0)]

    def _needed(self, unit: str) -> Floats:
        """Return the size of a unit's box, shape (2,), with room for the connectors at each of its sides."""
        sides = [spot.side for c, spot in self._spots.items() if c.unit == unit]
        left, right, down, up = (sum(side is given for given in sides) for side in _SIDES)
        return np.clip(_PITCH * np.array([max(down, up), max(left, right)], dtype=float), _LEAST, _GREATEST)

    def add_element(self, component: ET.Element, unit: str, icon: str) -> None:
        """Add a unit's box with its icon, a URI; "" for none."""
        low, high = self._middle[unit] - self._size[unit] / 2.0, self._middle[unit] + self._size[unit] / 2.0
        picture = {"iconSource": icon, "iconFixedAspectRatio": "true"} if icon else {}
        ET.SubElement(component, "ssd:ElementGeometry", {**_corners(low, high), **picture})

    def add_connector(self, connector: ET.Element, unit: str) -> None:
        """Add the place of a unit's connector on its box."""
        _add_spot(connector, self._spots[ConnectorName(unit, connector.attrib["name"])].at)

    def add_connection(self, connection: ET.Element, start: ConnectorName, end: ConnectorName) -> None:
        """Add the points of a line between its ends, which a tool adds itself."""
        points = bent(self._outside(start), self._outside(end))[::_EVERY]
        self._outlines += list(points)
        xs, ys = (" ".join(_number(value) for value in points[:, k]) for k in (0, 1))
        ET.SubElement(connection, "ssd:ConnectionGeometry", pointsX=xs, pointsY=ys)

    def _outside(self, connector: ConnectorName) -> Floats:
        """Return where a line that leaves a connector ends to be straight."""
        spot, size = self._spots[connector], self._size[connector.unit]
        return self._middle[connector.unit] + (spot.at - 0.5) * size + _STUB * spot.side

    def add_system(self, system: ET.Element) -> None:
        """Add the area of the diagram, with all boxes, and all lines that have been added."""
        outlines = np.array(self._outlines)
        ET.SubElement(
            system, "ssd:SystemGeometry", _corners(outlines.min(axis=0) - _MARGIN, outlines.max(axis=0) + _MARGIN)
        )


def add_external_connectors(connectors: Sequence[ET.Element]) -> None:
    """Add the places of a system's own inputs: at its left side, from the top."""
    for k, connector in enumerate(connectors):
        _add_spot(connector, _along(_LEFT, k, len(connectors)))


def _spots(
    unit: str, ports: Sequence[FmuPort], at: Floats, partners: Mapping[PortName, Sequence[Floats]]
) -> dict[ConnectorName, _Spot]:
    """Return the places of a unit's connectors; along a side they are in the order in which their partners lie."""
    towards = {p.name: np.mean([q - at for q in partners.get(PortName(unit, p.name), ())] or [at - at], axis=0)
               for p in ports}  # fmt: skip
    spots: dict[ConnectorName, _Spot] = {}
    for side in _SIDES:
        there = [p for p in ports if _side(towards[p.name], p.causality) is side]
        there.sort(key=lambda p: float(-towards[p.name][1] if side[0] else towards[p.name][0]))
        names = [ConnectorName(unit, name) for port in there for name in port.entry_names]
        spots |= {name: _Spot(_along(side, k, len(names)), side) for k, name in enumerate(names)}
    return spots


def _side(towards: Floats, causality: Causality) -> Floats:
    """Return the side in a direction; what is connected to nothing is at the left if it is an input, else right."""
    x, y = towards
    if max(abs(x), abs(y)) < 1e-9:
        return _RIGHT if causality is Causality.OUTPUT else _LEFT
    if abs(x) >= abs(y):
        return _RIGHT if x > 0.0 else _LEFT
    return _UP if y > 0.0 else _DOWN


def _along(side: Floats, k: int, n: int) -> Floats:
    """Return the place of one of n connectors at a side, from the top or from the left."""
    share = (k + 0.5) / n
    return np.array([(side[0] + 1.0) / 2.0, 1.0 - share] if side[0] else [share, (side[1] + 1.0) / 2.0])


def _stretch(layout: Mapping[str, Floats], size: Mapping[str, Floats]) -> float:
    """Return the least factor of the places with which all boxes are apart, horizontally or vertically."""
    names, least = list(layout), 1.0
    for k, a in enumerate(names):
        for b in names[:k]:
            apart = np.maximum(np.abs(layout[a] - layout[b]), 1e-9)
            least = max(least, float(np.min(((size[a] + size[b]) / 2.0 + _GAP) / apart)))
    return least


def _corners(low: Floats, high: Floats) -> dict[str, str]:
    return {"x1": _number(low[0]), "y1": _number(low[1]), "x2": _number(high[0]), "y2": _number(high[1])}


def _number(value: float) -> str:
    """Return a coordinate, to a hundredth: it stays the same where processors round differently."""
    return repr(round(float(value), 2) + 0.0)


def _add_spot(connector: ET.Element, spot: Floats) -> None:
    x, y = (repr(round(float(value), 4)) for value in spot)
    ET.SubElement(connector, "ssd:ConnectorGeometry", x=x, y=y)
