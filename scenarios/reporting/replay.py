"""What a run looked like in space: bodies and lines over time, in W."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from handover.cosim.blocks.ports import Floats
from handover.scenarios.reporting.meshes import Mesh


@dataclass(frozen=True, kw_only=True)
class Line:
    """A line or a tube through points that move, such as a backbone.

    Attributes:
        label: what the legend says; lines and bodies of one label are shown and hidden together.
        colour: as "#rrggbb".
        points: shape (rows, n, 3), m; NaN leaves gaps in a line and hides a tube. A single row stays where it is.
        width: of a line, in pixels.
        markers: whether the points of a line are drawn too.
        radii: of a tube at each of its points, shape (n,), m; None for a line.
        trail: whether what is drawn is the way of a single point until the time, not a line at the time.
        opacity: from 0 to 1.
    """

    label: str
    colour: str
    points: Floats
    width: float = 4.0
    markers: bool = False
    radii: Floats | None = None
    trail: bool = False
    opacity: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body.

    Attributes:
        label, colour: the latter as "#rrggbb".
        mesh: in the body's frame B.
        p_WB: position over time, shape (rows, 3), m; NaN hides it. A single row stays where it is.
        q_WB: orientation over time, shape (rows, 4), scalar first; None: that of W.
        opacity: from 0 to 1.
    """

    label: str
    colour: str
    mesh: Mesh
    p_WB: Floats
    q_WB: Floats | None = None
    opacity: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Replay:
    """A scene over a record's time.

    Attributes:
        lines, bodies: what moves; each has as many rows as the record, or one.
        fixed: lines that stay, of shape (1, n, 3), such as a path to follow or a table's edge.
        eye: the side from which one looks at first, a direction in W; from as far as all that is shown is seen.
        phases: an enumeration's signal whose value is told beside the time; "" for none.
        notes: sentences below the scene.
        window: least and greatest corner of what is shown, shape (2, 3), m; None: everything that is drawn.
    """

    lines: Sequence[Line] = ()
    bodies: Sequence[Body] = ()
    fixed: Sequence[Line] = ()
    eye: tuple[float, float, float] = (1.3, 1.3, 0.6)
    phases: str = ""
    notes: Sequence[str] = field(default_factory=tuple[str, ...])
    window: Floats | None = None
