"""The ball's position by the sphere whose outline lies on the edges in all pictures, its radius being known.

[Vervloet2025] sec. 3.2.3 triangulates the middles of two circles; this is own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from handover.controllers.helix.vision.ball import Disc
from handover.controllers.helix.vision.ball_edges import Edges, edges, green_ends, outline_of
from handover.controllers.helix.vision.stereo import BallPosition, Pixels, covariance, triangulate
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

_PASSES = 8
_CAPTURED = 1.0  # px; step of the outline after which it is known roughly
_SETTLED, _SETTLED_ALONE = 0.2, 0.1  # px; likewise well enough: a tenth of it is 2 mm where size alone tells depth
_ROUGHLY, _EXACTLY = (5.0, 2.5), (1.0, 0.4)  # px; tolerances of the first and the second solution of a pass
_STRIDE = 0.02  # m; standard deviation that is expected of a step: it holds what few edges leave free
_MIN_WEIGHT = 4.0  # sum of the edges' weights; less is not a ball
_STILL_THERE = 4.0  # px; the fit finds edges within 7 px
_MAX_SHIFT = 2.0  # px; an edge that is farther off is that of something larger or smaller


class BallFit:
    """Weighted least squares on the distances, in px, between a sphere's outline and the edges across it.

    It looks for edges along the outline's normals, at first for where green ends at all, so that a start that is 7 px
    off will do, and then exactly. Each pass solves for a step of p_WO and of the edges' shift, twice, with Tukey's
    weights (1 - (e / c)^2)^2 of the distances e times the edges' own. The tolerance c shrinks from 5 px to 0.4 px, so
    that edges of fingers, which hide a part of the ball, drop out.

    Blur and light may move the whole edge in or out; so this shift, in px, is estimated too. Seen by several cameras,
    the ball's depth then comes from the angles between them; seen by one, from its size, as uncertain as the shift
    makes it.

    Args:
        cameras: two or more.
        radius: of the ball, in m.
        noise: standard deviation of an edge that counts fully, in px, as if they were independent.
        shift: mean and standard deviation of the edges' shift outwards, in px.
        gap: largest distance, in m, at which the cameras' rays through the ball's middle may pass each other.
    """

    def __init__(
        self, cameras: Sequence[Pinhole], radius: float, noise: float, shift: tuple[float, float], gap: float
    ) -> None:
        self._cameras = cameras
        self._radius = radius
        self._noise = noise
        self._shift = shift
        self._gap = gap

    def fit(
        self, pictures: Sequence[Pixels], discs: Sequence[Disc | None], near: Floats | None = None
    ) -> BallPosition | None:
        """Return the ball's position, or None if no picture shows it.

        Where pictures contradict each other, the largest set that agrees counts, or else the one with most of the disc.

        Args:
            pictures: of each camera.
            discs: as which they show the ball, roughly.
            near: p_WO of a moment ago, at which to begin if all discs are still there, or None.
        """
        views = [_View(c, p, d) for c, p, d in zip(self._cameras, pictures, discs, strict=True) if d]
        if len(views) > 1 and near is not None and all(view.shows(near) for view in views):
            return self._solve(views, near)
        for n in range(len(views), 1, -1):
            starts = [(*_meeting(some), some) for some in combinations(views, n)]
            gap, start, some = min(starts, key=lambda found: found[0])
            if gap <= self._gap:
                return self._solve(some, start)
        alone = max(views, key=lambda view: view.disc.arc, default=None)
        return self._solve([alone], alone.by_size(self._radius)) if alone else None

    def _solve(self, views: Sequence["_View"], p_WO: Floats) -> BallPosition | None:
        cameras, pictures = [view.camera for view in views], [view.picture for view in views]
        settled = _SETTLED if len(views) > 1 else _SETTLED_ALONE
        mean, deviation = self._shift
        doubt = (self._noise / np.array([_STRIDE, _STRIDE, _STRIDE, deviation])) ** 2
        x, captured = np.array([*p_WO, mean]), False
        outlines = [outline_of(c, p_WO, self._radius) for c in cameras]
        J = np.concatenate([o.slope for o in outlines])
        for _ in range(_PASSES):
            find, tolerances = (edges, _EXACTLY) if captured else (green_ends, _ROUGHLY)
            expected = np.array([0.0, 0.0, 0.0, mean - x[3]])
            dx, information, counted = _step(J, find(pictures, outlines), x[3], (expected, doubt), tolerances)
            x = x + dx
            behind = not min(float(c.depth(x[:3])) for c in cameras) > self._radius
            if counted < _MIN_WEIGHT or behind or abs(x[3] - mean) > _MAX_SHIFT:
                return None
            moved = float(np.abs(np.einsum("ij,j->i", J[:, :3], dx[:3])).max())
            if captured and moved < settled:
                cov = covariance(information, self._noise)
                return BallPosition(x[:3], cov[:3, :3], float(x[3]), float(cov[3, 3]))
            captured = captured or moved < _CAPTURED
            outlines = [o.moved_to(c, x[:3], self._radius) for o, c in zip(outlines, cameras, strict=True)]
        return None


@dataclass(frozen=True)
class _View:
    """A camera, its picture, and the disc as which it shows the ball."""

    camera: Pinhole
    picture: Pixels
    disc: Disc

    def shows(self, p_WO: Floats) -> bool:
        """Return whether the disc is where a ball at p_WO would be: near enough to find its edges from there."""
        return float(np.abs(self.disc.centre - self.camera.project(p_WO)).max()) < _STILL_THERE

    def by_size(self, radius: float) -> Floats:
        """Return where a ball of a radius, m, would be seen as large as the disc."""
        d = self.camera.rays(self.disc.centre[None])[0]
        return self.camera.p_WC + d * radius * float(self.camera.f.mean()) / self.disc.radius


def _meeting(views: Sequence[_View]) -> tuple[float, Floats]:
    """Return how far the rays through the discs' middles pass each other, m, and the point between them.

    The distance is infinite if the point is behind a camera.
    """
    cameras = [view.camera for view in views]
    p_WO, gap = triangulate(cameras, [view.disc.centre for view in views])
    return (gap if min(float(c.depth(p_WO)) for c in cameras) > 0.0 else float("inf")), p_WO


def _step(
    J: Floats, found: Edges, shift: float, prior: tuple[Floats, Floats], tolerances: Sequence[float]
) -> tuple[Floats, Floats, float]:
    """Return the step of p_WO and shift, shape (4,), its information, shape (4, 4), and the sum of weights.

    The information is in units of the noise: that of n edges that count fully is J^T J.

    Args:
        J: slope of the outline, shape (n, 4).
        found: edges across it.
        shift: that is assumed so far, in px.
        prior: step that is expected, and its information, each of shape (4,).
        tolerances: of the solutions one after another, in px.
    """
    expected, doubt = prior
    e, dx, information, weight = found.offset - shift, np.zeros(4), np.zeros((4, 4)), found.weight
    for tolerance in tolerances:
        off = (e - np.einsum("ij,j->i", J, dx)) / tolerance
        weight = found.weight * np.maximum(1.0 - off * off, 0.0) ** 2
        weighted = weight[:, None] * J
        information = np.asarray(np.einsum("ij,ik->jk", weighted, J), dtype=np.float64)
        information.flat[:: len(doubt) + 1] += doubt
        slope = np.asarray(np.einsum("ij,i->j", weighted, e), dtype=np.float64) + doubt * expected
        dx = np.asarray(np.linalg.solve(information, slope), dtype=np.float64)
    return dx, information, float(weight.sum())
