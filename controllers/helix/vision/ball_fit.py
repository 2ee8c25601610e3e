"""The ball's position by the sphere whose outline lies on the edges in all pictures, its radius being known.

Edges of the green ball across a sphere's outline are found to a part of a pixel. [Vervloet2025] sec. 3.2.3 triangulates
the middles of two circles; this is own.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import cv2
import numpy as np
from numpy.typing import NDArray

from handover.controllers.helix.vision.ball import Disc
from handover.controllers.helix.vision.stereo import BallPosition, Pixels, covariance, triangulate
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

_DIRECTIONS = 60  # around the outline, in which an edge is looked for
_ANGLE = np.arange(_DIRECTIONS) * 2.0 * np.pi / _DIRECTIONS
_CIRCLE = np.column_stack([np.cos(_ANGLE), np.sin(_ANGLE)])
_NEXT, _PREVIOUS = np.roll(np.arange(_DIRECTIONS), -1), np.roll(np.arange(_DIRECTIONS), 1)
_FAR = np.arange(-7.5, 8.0, 1.5)  # px outwards of the outline; where colours are looked at for the end of green
_NEAR = np.arange(-2.25, 2.5, 0.75)  # px; where an exact edge is looked for: fingers are three times as broad
_BESIDE = 2  # outermost samples on either side, whose mean is the colour there: blur does not reach so far
_LEAST_GREEN = 0.2  # of green over blue and red, relative to green; what is less is another colour
_DARKEST = 8.0  # level; noise hides what is darker
_PURE = 0.06  # impurity at which an edge counts half; the usual noise alone makes 0.03
_NOISY = 1.5  # half-count impurity over that of the purest fourth of the edges, where noise makes this more
_DARKER, _AT_DARKER = 0.7, 0.2  # brightness outside over green inside below which an edge counts less, and by how much


@dataclass(frozen=True)
class Outline:
    """Where rays from a camera touch a sphere.

    Attributes:
        pixels: shape (60, 2), in px, in directions evenly spread about the ball's middle.
        outwards: unit normals of the outline in the picture, shape (60, 2).
        slope: of the outline's shift along them by p_WO, in px/m, and by a shift of all edges outwards, shape (60, 4).
    """

    pixels: Floats
    outwards: Floats
    slope: Floats

    def moved_to(self, camera: Pinhole, p_WO: Floats, radius: float) -> "Outline":
        """Return the outline of a sphere nearby; its normals and slope change so little that they are kept."""
        return Outline(camera.project(_touching(camera, p_WO, radius)), self.outwards, self.slope)


@dataclass(frozen=True)
class Edges:
    """Distance of edges from the outlines, outwards, in px, and by how much each counts, 0 to 1; shapes (60 n,)."""

    offset: Floats
    weight: Floats


def outline_of(camera: Pinhole, p_WO: Floats, radius: float) -> Outline:
    """Return the outline of a sphere of a radius, in m, around p_WO.

    The slope leaves the lens's distortion out, a few per cent, which costs no exactness: steps end where edges are.
    """
    touching = _touching(camera, p_WO, radius)
    pixels = camera.project(touching)
    along = pixels[_NEXT] - pixels[_PREVIOUS]
    outwards = np.column_stack([along[:, 1], -along[:, 0]]) / np.sqrt(np.einsum("ij,ij->i", along, along))[:, None]
    sideways = (outwards * camera.f) @ camera.R_CW[:2]
    in_depth = np.einsum("ij,ij->i", outwards, pixels - camera.c)[:, None] * camera.R_CW[2]
    slope = np.ones((_DIRECTIONS, 4))
    slope[:, :3] = (sideways - in_depth) / camera.depth(touching)[:, None]
    return Outline(pixels, outwards, slope)


def _touching(camera: Pinhole, p_WO: Floats, radius: float) -> Floats:
    """Return the points, shape (60, 3), at which rays from the camera touch a sphere.

    They are a circle about p_WC + cos^2(a) (p_WO - p_WC), of radius r cos(a), with sin(a) = r / |p_WO - p_WC|. Two rows
    of Householder's reflection that turns the sphere's direction into the optical axis span its plane.
    """
    to_ball = p_WO - camera.p_WC
    squared = float(to_ball @ to_ball)
    cosine2 = 1.0 - radius**2 / squared
    v = to_ball / math.sqrt(squared) + camera.R_CW[2]
    across = camera.R_CW[:2] - (2.0 / (v @ v)) * (camera.R_CW[:2] @ v)[:, None] * v
    return camera.p_WC + cosine2 * to_ball + radius * math.sqrt(cosine2) * _CIRCLE @ across


def green_ends(pictures: Sequence[Pixels], outlines: Sequence[Outline]) -> Edges:
    """Return where green ends within 7.5 px of the outlines, to half a pixel; each end counts fully, or not at all.

    It ends where green's excess over blue and red falls below half its largest across the outline, for the last time
    outwards.
    """
    colours, held = _sampled(pictures, outlines, _FAR)
    blue, green, red = cv2.split(colours)
    excess = cv2.subtract(green, cv2.max(blue, red)).astype(np.float64)
    half = 0.5 * np.maximum(excess.max(axis=1), _DARKEST)
    last = len(_FAR) - 1 - np.argmax((excess > half[:, None])[:, ::-1], axis=1)
    ends = last < len(_FAR) - 1
    last = np.minimum(last, len(_FAR) - 2)
    offset, falls = _crossing(excess - half[:, None], last, _FAR)
    return Edges(offset, held * (ends & falls))


def edges(pictures: Sequence[Pixels], outlines: Sequence[Outline]) -> Edges:
    """Return the edges between green and another colour within 2 px of the outlines.

    An edge is where the colour is halfway between that inside and that outside, which blur does not move. It counts
    1 / (1 + (s / 0.06)^4), with s the impurity: the largest distance of a colour from the line between both, relative
    to the line's length; noise that makes the purest fourth worse than 0.04 raises the 0.06. A third colour, as of a
    finger that ends there, makes an edge impure, and moves those beside it; so it counts less where its neighbours are
    impure. It counts a fifth where it is darker outside, because that may be a finger of the gripper, before the ball.
    """
    colours, held = _sampled(pictures, outlines, _NEAR)
    colours = colours.astype(np.float64)
    c_in, c_out = colours[:, :_BESIDE].mean(axis=1), colours[:, -_BESIDE:].mean(axis=1)
    excess_in, excess_out = (c[:, 1] - np.maximum(c[:, 0], c[:, 2]) for c in (c_in, c_out))
    green_in = (excess_in > _LEAST_GREEN * c_in[:, 1]) & (c_in[:, 1] > _DARKEST) & (excess_out < 0.5 * excess_in)
    line = c_in - c_out
    squared = np.einsum("ij,ij->i", line, line) + 1e-9
    beyond = colours - c_out[:, None]
    share = np.einsum("ijk,ik->ij", beyond, line) / squared[:, None]
    beside = beyond - share[..., None] * line[:, None]
    third = np.einsum("ijk,ijk->ij", beside, beside).max(axis=1)
    candidates = np.sort(third[green_in])
    usual = candidates[len(candidates) // 4] if len(candidates) else 0.0
    impurity = third / np.maximum(_PURE**2 * squared, _NOISY**2 * usual)
    first_out = np.argmin(share > 0.5, axis=1)
    offset, falls = _crossing(share - 0.5, np.maximum(first_out - 1, 0), _NEAR)
    pure = (held * (green_in & falls) / (1.0 + impurity**2)).reshape(-1, _DIRECTIONS)
    pure = 0.5 * pure * (pure + pure[:, _NEXT] * pure[:, _PREVIOUS])
    is_darker = c_out.max(axis=1) < _DARKER * c_in[:, 1]
    return Edges(offset, np.where(is_darker, _AT_DARKER, 1.0) * pure.ravel())


def _crossing(values: Floats, before: NDArray[np.int64], at: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """Return where values, shape (n, m), at equal distances `at`, fall to 0 after an index, and whether they do."""
    n = np.arange(len(values))
    high, low = values[n, before], values[n, before + 1]
    falls = (high > 0.0) & (low <= 0.0)
    return at[before] + (at[1] - at[0]) * high / np.where(falls, high - low, 1.0), falls


def _sampled(pictures: Sequence[Pixels], outlines: Sequence[Outline], at: Floats) -> tuple[Pixels, Floats]:
    """Return colours at distances outwards of the outlines, shape (60 n, m, 3), and 1 where the picture holds them.

    The second has shape (60 n,); it is 0 where a part of the line is out of the picture.
    """
    colours: list[Pixels] = []
    held: list[Floats] = []
    margin = float(at[-1]) + 1.0
    for picture, outline in zip(pictures, outlines, strict=True):
        lines = (outline.pixels[:, :, None] + outline.outwards[:, :, None] * at).astype(np.float32)
        colours.append(np.asarray(cv2.remap(picture, lines[:, 0], lines[:, 1], cv2.INTER_LINEAR), dtype=np.uint8))
        h, w = picture.shape[:2]
        inside = (outline.pixels > margin) & (outline.pixels < [w - 1.0 - margin, h - 1.0 - margin])
        held.append(np.asarray(inside.all(axis=1), dtype=np.float64))
    return np.concatenate(colours), np.concatenate(held)


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
