"""Paths through waypoints, read from a CSV file: straight between them, or on an arc by way of a third point."""

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from handover.controllers.vsl.paths import Arc, Line, Segment
from handover.cosim.blocks.ports import Floats
from handover.cosim.files import read_csv, reading_fault

_TO, _VIA = ("x", "y", "z"), ("via_x", "via_y", "via_z")
_MOST = 1000
"""Number of waypoints up to which a file is read."""

_SAME_PLACE = 1e-6  # m
_FARTHEST = 100.0
"""Coordinate up to which a waypoint is read, m: in millimetres it would be far beyond any arm's reach (assumed)."""

_STRAIGHT = 1e-6
"""Sine of the angle below which three points count as on one line."""


class InvalidWaypoints(ValueError):
    """A file that is not a list of waypoints; `faults` lists what is wrong, with its lines."""

    def __init__(self, file: Path, faults: Sequence[str]) -> None:
        super().__init__(f"{file}: " + "; ".join(faults))
        self.file, self.faults = file, list(faults)


def read_waypoints(file: Path) -> list[Segment]:
    """Return the segments of a path through a file's waypoints.

    The file is CSV with a header: columns x, y, z, in W, m, and, for arcs, via_x, via_y, via_z, in any order. Each row
    is a waypoint. The way to it from the one before is straight; or the arc through the `via` point, where that is
    given.

    Raises:
        InvalidWaypoints: the file cannot be read, is no such list, or has fewer than two waypoints, two in a row at one
            place, or an arc whose three points are on one line.
    """
    points = _points(file, _rows(file))
    segments: list[Segment] = []
    faults: list[str] = []
    for number, ((x_0, _), (x_g, via)) in enumerate(itertools.pairwise(points), 2):
        if math.dist(x_0, x_g) < _SAME_PLACE:
            faults.append(f"waypoints {number - 1} and {number} are at the same place")
        elif via is None:
            segments.append(Line(x_0, x_g))
        elif np.linalg.norm(np.cross(via - x_0, x_g - x_0)) < _STRAIGHT * math.dist(x_0, x_g) * math.dist(x_0, via):
            faults.append(f"waypoint {number}: no arc leads there: its via point is on one line with both ends")
        else:
            segments.append(Arc(x_0, via, x_g))
    if faults:
        raise InvalidWaypoints(file, faults)
    return segments


def _rows(file: Path) -> list[tuple[int, dict[str, str]]]:
    """Return a file's rows, by columns that are known, with their lines."""
    try:
        (_, header), *lines = read_csv(file) or [(1, list[str]())]
    except OSError as e:
        raise InvalidWaypoints(file, [reading_fault(e)]) from e
    except ValueError as e:
        raise InvalidWaypoints(file, [f"it is not CSV file: {e}"]) from e
    columns = [name.strip() for name in header]
    rows = [(line, [cell.strip() for cell in row]) for line, row in lines if any(row)]
    if not set(_TO) <= set(columns) <= {*_TO, *_VIA} or len(set(columns)) < len(columns):
        found = ", ".join(columns) or "none"
        raise InvalidWaypoints(
            file,
            [f"its first line, by commas, has the columns {found}; they must be x, y, z and may be {', '.join(_VIA)}"],
        )
    if not 2 <= len(rows) <= _MOST:
        raise InvalidWaypoints(file, [f"it has {len(rows)} waypoints; a path has from 2 to {_MOST}"])
    faults = [
        f"line {line} has {len(row)} values, and there are {len(columns)} columns"
        for line, row in rows
        if len(row) != len(columns)
    ]
    if faults:
        raise InvalidWaypoints(file, faults)
    return [(line, dict(zip(columns, row, strict=True))) for line, row in rows]


def _points(file: Path, rows: Sequence[tuple[int, dict[str, str]]]) -> list[tuple[Floats, Floats | None]]:
    """Return the waypoints, each with the point by way of which an arc leads there, if one does."""
    points: list[tuple[Floats, Floats | None]] = []
    faults: list[str] = []
    for number, (line, row) in enumerate(rows, 1):
        arc = any(row.get(name) for name in _VIA)
        to, via = _point(row, _TO), _point(row, _VIA) if arc else None
        if to is None:
            faults.append(f"waypoint {number} (line {line}): x, y and z must be numbers of metres, 100 at most")
        elif arc and via is None:
            faults.append(f"waypoint {number} (line {line}): {', '.join(_VIA)} must be numbers of metres, or all empty")
        elif arc and number == 1:
            faults.append(f"waypoint 1 (line {line}): the path begins there, so no arc leads to it")
        else:
            points.append((to, via))
    if faults:
        raise InvalidWaypoints(file, faults)
    return points


def _point(row: Mapping[str, str], names: Sequence[str]) -> Floats | None:
    """Return a point, shape (3,), m; None if not all three numbers are there and of a size."""
    try:
        point = np.array([float(row[name]) for name in names])
    except (KeyError, ValueError):
        return None
    return point if np.all(np.abs(point) <= _FARTHEST) else None
