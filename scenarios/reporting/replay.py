"""What a run looked like in space: bodies and lines over time, in W."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from cosim.ports import Floats


@dataclass(frozen=True, kw_only=True)
class Line:
    """A line through points that move, such as a backbone. `points` has shape (rows, n, 3), m; NaN leaves gaps.

    `width` is in pixels; `markers` draws the points too.
    """

    label: str
    colour: str
    points: Floats
    width: float = 4.0
    markers: bool = False


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body of triangles.

    Attributes:
        label, colour: the latter as "#rrggbb".
        vertices: in the body's frame B, shape (n, 3), m.
        triangles: indices of vertices, shape (m, 3).
        p_WB: position over time, shape (rows, 3), m; NaN hides it.
        q_WB: orientation over time, shape (rows, 4), scalar first; None: that of W.
        opacity: from 0 to 1.
    """

    label: str
    colour: str
    vertices: Floats
    triangles: NDArray[np.int64]
    p_WB: Floats
    q_WB: Floats | None = None
    opacity: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Replay:
    """A scene over a record's time.

    Attributes:
        lines, bodies: what moves; each has as many rows as the record.
        fixed: lines that stay, of shape (1, n, 3), such as a path to follow or a table's edge.
        eye: from where one looks at the scene's middle at first, in units of its size.
        phases: an enumeration's signal whose value is told beside the time; "" for none.
    """

    lines: Sequence[Line] = ()
    bodies: Sequence[Body] = ()
    fixed: Sequence[Line] = ()
    eye: tuple[float, float, float] = (1.3, 1.3, 0.6)
    phases: str = ""
    notes: Sequence[str] = field(default_factory=tuple[str, ...])
