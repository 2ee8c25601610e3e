"""What a run looked like in space: bodies and lines over time, in W, with triangle meshes of simple bodies.

A scenario returns a `Replay`, and the report animates it. Meshes (`hull`, `prism`, `ball`, `rod`) are in their body's
frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.returned_types import COLOUR, VECTOR, Checked, Expected, is_series, sequence_of
from handover.scenarios.experiment.time_plot import Phase


class Mesh(NamedTuple):
    """Vertices, shape (n, 3), m, and triangles of them, shape (m, 3), counter-clockwise seen from outside."""

    vertices: Floats
    triangles: NDArray[np.int64]

    def moved(self, p: Floats) -> "Mesh":
        """Return the mesh translated by p, shape (3,), m."""
        return Mesh(self.vertices + p, self.triangles)


_HULLS: dict[bytes, Mesh] = {}
"""Hulls that were asked for, by their points to a nanometre: a scene that is shown live asks for them at each row."""
_MOST_HULLS = 2000


def hull(points: Floats) -> Mesh:
    """Return the convex hull of points, shape (n, 3), or that of points which are the same to a nanometre."""
    key = np.rint(1e9 * np.asarray(points)).astype(np.int64).tobytes()
    if key not in _HULLS:
        if len(_HULLS) >= _MOST_HULLS:
            _HULLS.clear()
        _HULLS[key] = _convex_hull(np.asarray(points))
    return _HULLS[key]


def _convex_hull(points: Floats) -> Mesh:
    from scipy.spatial import ConvexHull  # slow to import, and scenarios import this module without making meshes

    convex = ConvexHull(points)
    triangles = convex.simplices.astype(np.int64)
    a, b, c = (points[triangles[:, k]] for k in range(3))
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), convex.equations[:, :3]) < 0.0
    triangles[inwards] = triangles[inwards][:, ::-1]
    kept = np.unique(triangles)
    return Mesh(points[kept], np.searchsorted(kept, triangles))


def circle(radius: float, corners: int = 24) -> Floats:
    """Return the corners of a regular polygon in a circle about the origin, shape (corners, 2), counter-clockwise."""
    angles = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def prism(outline: Floats, low: float, high: float) -> Mesh:
    """Return a convex outline, shape (n, 2), extruded along z from `low` to `high`, with sharp edges."""
    return faceted(hull(np.vstack([np.column_stack([outline, np.full(len(outline), z)]) for z in (low, high)])))


@cache
def ball(radius: float, finer: int = 2) -> Mesh:
    """Return a sphere about the origin: an icosahedron whose triangles are divided into four `finer` times."""
    golden = (1.0 + np.sqrt(5.0)) / 2.0
    corners = np.array([[0.0, a, b * golden] for a in (-1.0, 1.0) for b in (-1.0, 1.0)])
    vertices = np.vstack([np.roll(corners, k, axis=1) for k in range(3)]) / np.hypot(1.0, golden)
    for _ in range(finer):
        triangles = hull(vertices).triangles
        edges = np.unique(np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
        middles = vertices[edges].mean(axis=1)
        vertices = np.vstack([vertices, middles / np.linalg.norm(middles, axis=1, keepdims=True)])
    return hull(radius * vertices)


def rod(points: Floats, radii: Floats) -> Mesh:
    """Return a chain of rods with rounded ends through points, shape (n, 3), with the radii there, shape (n,)."""
    sphere = ball(1.0, finer=1).vertices
    ends = points[:, None] + np.asarray(radii)[:, None, None] * sphere
    apart = [k for k in range(len(points) - 1) if not np.array_equal(points[k], points[k + 1])]
    return merged([hull(np.vstack([ends[k], ends[k + 1]])) for k in apart])


def merged(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one."""
    firsts = np.cumsum([0, *(len(m.vertices) for m in meshes)])
    triangles = [m.triangles + first for m, first in zip(meshes, firsts, strict=False)]
    return Mesh(np.vstack([m.vertices for m in meshes]), np.vstack(triangles))


def turned(profile: Floats, corners: int = 32) -> Mesh:
    """Return the surface that a line about z makes, its radii and heights, shape (n, 2), given from the inside out.

    Its first and last points lie on z. Seen from outside the body that it encloses, a profile that rises along the
    inside of a bowl and comes down along its outside runs the right way.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, corners, endpoint=False)
    n = len(profile)
    rings = [np.column_stack([r * np.cos(angles), r * np.sin(angles), np.full(corners, z)]) for r, z in profile]
    k = np.arange(corners)
    beside = (k + 1) % corners
    triangles: list[NDArray[np.int64]] = []
    for i in range(n - 1):
        a, b, c, d = (i * corners + k, i * corners + beside, (i + 1) * corners + k, (i + 1) * corners + beside)
        triangles += [np.column_stack(t) for t, r in (((a, c, b), profile[i, 0]), ((b, c, d), profile[i + 1, 0])) if r]
    return Mesh(np.vstack(rings), np.vstack(triangles).astype(np.int64))


def faceted(mesh: Mesh) -> Mesh:
    """Return a mesh whose faces share no vertices, for sharp edges in shading; coplanar triangles are one face."""
    a, b, c = (mesh.vertices[mesh.triangles[:, k]] for k in range(3))
    normals: Floats = np.cross(b - a, c - a)
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    side = np.unique(np.rint(1e6 * normals).astype(np.int64), axis=0, return_inverse=True)[1]
    corners = np.column_stack([np.repeat(side.reshape(-1), 3), mesh.triangles.reshape(-1)])
    kept, indices = np.unique(corners, axis=0, return_inverse=True)
    return Mesh(mesh.vertices[kept[:, 1]], indices.reshape(-1, 3).astype(np.int64))


_POINTS = Expected(
    "an array of shape (rows, n, 3), or (1, n, 3)",
    'record["arm.p_WG"][:, None, :]',
    lambda points: is_series(points, (None, None, 3)),
)
_RADII = Expected("an array of shape (n,), or None", "np.full(3, 0.01)", lambda r: r is None or is_series(r, (None,)))
_PLACES = Expected("an array of shape (rows, 3), or (1, 3)", 'record["robot.p_WB"]', lambda p: is_series(p, (None, 3)))
_TURNS = Expected(
    "an array of shape (rows, 4), or (1, 4)", 'record["robot.q_WB"]', lambda q: q is None or is_series(q, (None, 4))
)


@dataclass(frozen=True, kw_only=True)
class Line(Checked):
    """A line or a tube through points that move, such as a backbone.

    Attributes:
        label: what the legend says; lines and bodies of one label are shown and hidden together.
        colour: as "#rrggbb".
        points: shape (rows, n, 3), m; NaN leaves gaps in a line and hides a tube. A single row stays where it is.
        width: of a line, in pixels.
        markers: whether the points of a line are drawn too.
        radii: of a tube at each of its points, shape (n,), m; None for a line.
        trail: whether the path of a single point up to the time is drawn, instead of a line at the time.
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

    expected = {"colour": COLOUR, "points": _POINTS, "radii": _RADII}


@dataclass(frozen=True, kw_only=True)
class Body(Checked):
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

    expected = {"colour": COLOUR, "p_WB": _PLACES, "q_WB": _TURNS}


_LINES = sequence_of(Line, '[Line(label="arm", colour="#2f6db5", points=points)]')
_PHASES = Expected(
    "a list or tuple of Phase, or the name of a signal",
    'phases_of(record, "servo.phase")',
    lambda v: isinstance(v, str) or sequence_of(Phase, "").fits(v),
)
_WINDOW = Expected(
    "an array of shape (2, 3) or (n, 3), or None",
    "np.array([[-1.0, -1.0, 0.0], [1.0, 1.0, 2.0]])",
    lambda v: v is None or is_series(v, (None, 3)),
)
_BODIES = sequence_of(Body, '[Body(label="robot", colour="#2f6db5", mesh=ball(0.1), p_WB=record["robot.p_WB"])]')


class PersonView(NamedTuple):
    """How a person in a scene sees it: direction in W from the scene to the eye; corners of what is seen, (2, 3), m."""

    eye: tuple[float, float, float]
    window: Floats


@dataclass(frozen=True, kw_only=True)
class Replay(Checked):
    """A scene over a record's time.

    What is drawn, and in which order, does not depend on what was recorded, and where it is at a time depends on that
    time alone: a run under way is shown from its newest row.

    Attributes:
        lines, bodies: what moves; each has as many rows as the record, or one.
        fixed: lines that stay, of shape (1, n, 3), such as a path to follow or a table's edge.
        eye: direction in W from the scene to the viewer at first; the distance follows from what is shown.
        phases: what is shown beside the time: phases as in the plots (`phases_of`), or the signal of an enumeration
            whose value it is; "" for nothing.
        notes: sentences below the scene.
        window: what the views just show, m: the minimum and maximum corner of a box, shape (2, 3), or points, shape
            (n, 3); None: everything that is drawn.
        weightless: whether there is neither up nor down, so that stars are around and no floor is below.
        floor: height of the floor, m; None: below all that is drawn.
        follow: label of what the view can follow; "" for nothing.
        person_view: what the person in it sees who takes part; None where there is none.
    """

    lines: Sequence[Line] = ()
    bodies: Sequence[Body] = ()
    fixed: Sequence[Line] = ()
    eye: tuple[float, float, float] = (1.3, 1.3, 0.6)
    phases: str | Sequence[Phase] = ""
    notes: Sequence[str] = field(default_factory=tuple[str, ...])
    window: Floats | None = None
    weightless: bool = False
    floor: float | None = None
    follow: str = ""
    person_view: PersonView | None = None

    expected = {
        "lines": _LINES,
        "fixed": _LINES,
        "bodies": _BODIES,
        "eye": VECTOR,
        "phases": _PHASES,
        "window": _WINDOW,
    }
