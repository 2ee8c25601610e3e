"""The ball's position from its outlines in two pictures, its radius being known, after [Vervloet2025] sec. 3.2.3.

`BallFinder` finds the outline of the green ball in one picture, `BallFit` the sphere that the outlines' rays touch.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from handover.controllers.helix.stereo import Pixels, Region, StereoRig, covariance, least_squares
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

_GREEN_FROM = (38, 60, 25)  # hue (180 a turn), saturation, value
_GREEN_UNTIL = (85, 255, 255)
_ZOOM = 2  # enlargement of a region: its outline is finer by that
_BLUR = 1.4  # px of the enlarged region
_COARSE = 2  # reduction of a whole picture in a search
_NEIGHBOURHOOD = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (9, 9))
_INSIDE = 0.5 / _ZOOM  # px; contours run through the middles of the outermost pixels
_SPECK = 30.0  # px^2; smaller green patches are noise
_SPREAD = (0.12, 0.2, 0.33)  # spacings, in shares of the outline, of the three points of a candidate circle
_ON_CIRCLE = 0.45  # px; three standard deviations of a free edge
_HULL_POINTS = 48  # points of the hull through which candidate circles go
_SCORED_POINTS = 120  # points of the outline, about, by which candidates are scored
_MIN_ARC = 0.22  # share of a circle that must be seen
_SECTORS = 36
_MIN_POINTS = 12  # fewer are no outline


@dataclass(frozen=True)
class BallOutline:
    """Points on the ball's edge, shape (n, 2), in px, the circle through them, and the share of it that is seen."""

    points: Floats
    centre: Floats
    radius: float
    arc: float


class BallFinder:
    """Takes what is green, its contour's convex hull, and the circle on which most of the hull lies.

    The thesis takes the smallest circle around the contour, which shifts where fingers cover the ball. What hides a
    part of a disc makes dents or chords; the hull skips the dents, and points on a chord are not on the circle.
    """

    def find(self, picture: Pixels, region: Region) -> BallOutline | None:
        """Return the outline of the ball in a region of a picture, or None."""
        if region.empty:
            return None
        part = region.of(picture)
        enlarged = cv2.resize(part, None, fx=_ZOOM, fy=_ZOOM, interpolation=cv2.INTER_LINEAR)
        contours = _green_contours(np.asarray(enlarged, dtype=np.uint8), _BLUR, _SPECK * _ZOOM**2)
        if not contours:
            return None
        edge = (np.concatenate(contours) + 0.5) / _ZOOM - 0.5  # the centres of pixels have whole coordinates
        h, w = part.shape[:2]
        edge = (
            edge[((edge > 1.0) & (edge < np.array([w, h]) - 2.0)).all(axis=1)] + region.origin
        )  # not the region's edge
        if len(edge) < _MIN_POINTS:
            return None
        hull = np.asarray(cv2.convexHull(edge.astype(np.float32)), dtype=np.float64).reshape(-1, 2)
        circle = _best_circle(_evenly_spaced(hull), edge)
        return None if circle is None else _outline(edge, *circle)

    def search(self, picture: Pixels) -> Region:
        """Return the region of a picture around the largest green patch; empty if there is none."""
        h, w = picture.shape[:2]
        small = cv2.resize(picture, (w // _COARSE, h // _COARSE), interpolation=cv2.INTER_AREA)
        contours = _green_contours(np.asarray(small, dtype=np.uint8), 0.0, _SPECK / _COARSE**2)
        if not contours:
            return Region(0, 0, 0, 0)
        _, radius = cv2.minEnclosingCircle(contours[0].astype(np.float32))
        return Region.around(_COARSE * contours[0], _COARSE * float(radius) + 8.0, picture)


def _green_contours(part: Pixels, blur: float, speck: float) -> list[Floats]:
    """Return contours, shape (n, 2) each, of the largest green patch and of those near it, parts of the same ball."""
    smooth = cv2.GaussianBlur(part, (0, 0), blur) if blur else part
    mask = cv2.inRange(cv2.cvtColor(smooth, cv2.COLOR_BGR2HSV), _GREEN_FROM, _GREEN_UNTIL)
    if blur:
        mask = cv2.bitwise_and(mask, _half_as_green(np.asarray(smooth, dtype=np.uint8)))
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    patches = sorted(((cv2.contourArea(c), i) for i, c in enumerate(outlines)), reverse=True)
    if not patches or patches[0][0] < speck:
        return []
    contours = [np.asarray(outlines[i], dtype=np.float64).reshape(-1, 2) for area, i in patches if area >= speck]
    middle, reach = contours[0].mean(axis=0), 3.0 * np.sqrt(patches[0][0])
    return [c for c in contours if np.linalg.norm(c.mean(axis=0) - middle) < reach]


def _half_as_green(part: Pixels) -> Pixels:
    """Return a mask of what is at least half as green as what is next to it: its edge, in any light, on any ground."""
    blue, green, red = cv2.split(part)
    over = cv2.subtract(green, cv2.max(blue, red))
    around = cv2.dilate(over, _NEIGHBOURHOOD)
    return np.asarray(cv2.compare(over, cv2.convertScaleAbs(around, alpha=0.5), cv2.CMP_GE), dtype=np.uint8)


def _evenly_spaced(hull: Floats) -> Floats:
    """Return points, shape (48, 2), at equal distances along the hull's sides."""
    closed = np.concatenate([hull, hull[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.arange(_HULL_POINTS) * float(length[-1]) / _HULL_POINTS
    x, y = (np.interp(at, length, closed[:, i]) for i in (0, 1))
    return np.column_stack([x, y])


def _best_circle(hull: Floats, edge: Floats) -> tuple[Floats, float] | None:
    """Return centre and radius of the circle through three points of the hull that has most of the edge on it."""
    n = len(hull)
    first = np.arange(n)
    a = np.concatenate([hull[first] for _ in _SPREAD])
    b = np.concatenate([hull[(first + round(s * n)) % n] for s in _SPREAD])
    c = np.concatenate([hull[(first + 2 * round(s * n)) % n] for s in _SPREAD])
    p, q = b - a, c - a
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    good = np.abs(cross) > 1e-3 * (np.einsum("ij,ij->i", p, p) + 1e-9)
    a, p, q, cross = a[good], p[good], q[good], cross[good]
    if not len(a):
        return None
    pp, qq = np.einsum("ij,ij->i", p, p), np.einsum("ij,ij->i", q, q)
    shift = np.column_stack([q[:, 1] * pp - p[:, 1] * qq, p[:, 0] * qq - q[:, 0] * pp]) / (2.0 * cross)[:, None]
    centre, radius = a + shift, np.linalg.norm(shift, axis=1)
    some = edge[:: 1 + len(edge) // _SCORED_POINTS]
    x, y = (some[:, i] - centre[:, i : i + 1] for i in (0, 1))
    distance = np.sqrt(x * x + y * y) - radius[:, None]
    score = (np.abs(distance) < _ON_CIRCLE).sum(axis=1) - 2 * (distance > 3.0 * _ON_CIRCLE).sum(axis=1)
    best = int(np.argmax(score))
    return centre[best], float(radius[best])


def _outline(edge: Floats, centre: Floats, radius: float) -> BallOutline | None:
    """Return the points on the circle, after fitting it to them twice; None if too little of the circle is seen."""
    on = _on_circle(edge, centre, radius)
    for _ in range(2):
        if len(on) < _MIN_POINTS:
            return None
        d = on - centre
        A = np.column_stack([2.0 * d, np.ones(len(d))])
        moved, _ = least_squares(A, np.einsum("ij,ij->i", d, d))
        centre = centre + moved[:2]
        radius = math.sqrt(max(float(moved[2] + moved[:2] @ moved[:2]), 0.0))
        on = _on_circle(edge, centre, radius)
    d = on - centre
    sector = np.floor((np.arctan2(d[:, 1], d[:, 0]) / (2.0 * np.pi) + 0.5) * _SECTORS).astype(int) % _SECTORS
    arc = len(np.unique(sector)) / _SECTORS
    if arc < _MIN_ARC:
        return None
    outwards = _INSIDE * d / np.linalg.norm(d, axis=1, keepdims=True)
    return BallOutline((on + outwards)[::_ZOOM], centre, radius + _INSIDE, arc)


def _on_circle(edge: Floats, centre: Floats, radius: float) -> Floats:
    return edge[np.abs(np.linalg.norm(edge - centre, axis=1) - radius) < _ON_CIRCLE]


_ITERATIONS = 6
_MAX_SHIFT = 2.0  # px; an edge that is farther off is that of something larger or smaller


@dataclass(frozen=True)
class BallPosition:
    """Centre p_WO, shape (3,), in m, and its covariance, shape (3, 3), in m^2."""

    p_WO: Floats
    covariance: Floats


class BallFit:
    """Least squares on the distances between the rays of the outlines and the sphere, which they touch.

    A ray from a camera at C in direction d touches the sphere if |(p_WO - p_WC) x d| = r. Blur and thresholds move the
    whole edge in or out; so its shift, in px, is estimated too. Seen by two cameras, the ball's depth then comes from
    the angle between them; seen by one, from its size, as uncertain as the shift makes it.

    Args:
        rig: the cameras.
        radius: r, in m.
        noise: standard deviation of an outline's points across it, in px, as if they were independent.
        shift: mean and standard deviation of the edge's shift outwards, in px.
        gap: largest distance, in m, at which the two cameras' rays through the ball's middle may pass each other.
    """

    def __init__(self, rig: StereoRig, radius: float, noise: float, shift: tuple[float, float], gap: float) -> None:
        self._rig = rig
        self._radius = radius
        self._noise = noise
        self._shift = shift
        self._gap = gap

    def fit(self, left: BallOutline | None, right: BallOutline | None) -> BallPosition | None:
        """Return the ball's position, or None if no picture shows it.

        Where the pictures contradict each other, the one with more of the outline counts.
        """
        if left and right:
            start, gap = self._rig.triangulate(left.centre, right.centre)
            if gap <= self._gap and min(float(c.depth(start)) for c in self._rig.cameras) > 0.0:
                return self._solve([left, right], self._rig.cameras, start)
            left, right = (left, None) if left.arc >= right.arc else (None, right)
        for outline, camera in ((left, self._rig.left), (right, self._rig.right)):
            if outline:
                d = camera.rays(outline.centre[None])[0]
                f = float(camera.f.mean())
                return self._solve([outline], [camera], camera.p_WC + d * self._radius * f / outline.radius)
        return None

    def _solve(self, outlines: Sequence[BallOutline], cameras: Sequence[Pinhole], p_WO: Floats) -> BallPosition | None:
        rays = [c.rays(o.points) for o, c in zip(outlines, cameras, strict=True)]
        mean, deviation = self._shift
        shift = mean
        doubt = np.array([0.0, 0.0, 0.0, self._noise / deviation])  # the shift's prior, as one more equation
        information = np.eye(4)
        for _ in range(_ITERATIONS):
            rows = [_misfit(p_WO, shift, self._radius, camera, d) for camera, d in zip(cameras, rays, strict=True)]
            e = np.concatenate([*(e for e, _ in rows), [doubt[3] * (mean - shift)]])
            J = np.concatenate([*(J for _, J in rows), doubt[None]])
            dx, information = least_squares(J, e)
            p_WO, shift = p_WO + dx[:3], shift + float(dx[3])
        behind = min(float(c.depth(p_WO)) for c in cameras) <= self._radius
        if not np.isfinite(p_WO).all() or behind or abs(shift - mean) > _MAX_SHIFT:
            return None
        return BallPosition(p_WO, covariance(information, self._noise)[:3, :3])


def _misfit(p_WO: Floats, shift: float, radius: float, camera: Pinhole, rays: Floats) -> tuple[Floats, Floats]:
    """Return the distance, in px, of rays from a sphere's shifted edge, and minus its slope by p_WO and the shift."""
    to_ball = p_WO - camera.p_WC
    beside = to_ball - (rays @ to_ball)[:, None] * rays  # from the rays to the ball's middle
    distance = np.linalg.norm(beside, axis=1)
    scale = float(camera.f.mean()) / float(camera.depth(p_WO))  # px/m
    e = scale * (distance - radius) - shift
    return e, np.column_stack([-scale * beside / distance[:, None], np.ones(len(rays))])
