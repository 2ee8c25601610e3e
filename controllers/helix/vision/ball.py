"""Finds the ball's disc in a picture, roughly, after [Vervloet2025] sec. 3.2.3; `ball_fit` finds its position by it."""

from dataclasses import dataclass

import cv2
import numpy as np

from handover.controllers.helix.vision.stereo import Pixels, Region
from handover.cosim.blocks.ports import Floats

_GREEN_FROM = (38, 60, 25)  # hue (180 a turn), saturation, value
_GREEN_UNTIL = (85, 255, 255)
_COARSE = 4  # reduction of a whole picture in a search; the ball is a dozen pixels wide then
_INSIDE = 0.5  # px; contours run through the middles of the outermost pixels
SPECK = 30.0
"""Area of a green patch, px^2, below which it is noise (assumed)."""
_SPREAD = (0.12, 0.2, 0.33)  # spacings, in shares of the outline, of the three points of a candidate circle
_ON_CIRCLE = 0.8  # px
_HULL_POINTS = 16  # points of the hull through which candidate circles go
_TRIPLES = [  # which of these points a circle's first one is, its second one and its third one
    np.concatenate([(np.arange(_HULL_POINTS) + k * round(s * _HULL_POINTS)) % _HULL_POINTS for s in _SPREAD])
    for k in range(3)
]
_SCORED_POINTS = 32  # points of the outline, about, by which candidates are scored
_MIN_ARC = 0.22  # share of a circle that must be seen
_SECTORS = 36
_MIN_POINTS = 12  # fewer are no outline


@dataclass(frozen=True)
class Disc:
    """The circle on which most of a green patch's outline lies, in px, and the share of it that is seen."""

    centre: Floats
    radius: float
    arc: float


class BallFinder:
    """Takes what is green, its contour's convex hull, and the circle on which most of the hull lies.

    The thesis takes the smallest circle around the contour, which shifts where fingers cover the ball. What hides a
    part of a disc makes dents or chords; the hull skips the dents, and points on a chord are not on the circle.
    """

    def find(self, picture: Pixels, region: Region) -> Disc | None:
        """Return the ball's disc in a region of a picture, to a pixel or two, or None."""
        if region.empty:
            return None
        part = region.of(picture)
        contours = _patches(green_mask(part), SPECK)
        if not contours:
            return None
        edge = np.concatenate(contours)
        h, w = part.shape[:2]
        edge = edge[((edge > 1.0) & (edge < [w - 2.0, h - 2.0])).all(axis=1)]  # not the region's edge
        if len(edge) < _MIN_POINTS:
            return None
        hull = np.asarray(cv2.convexHull(edge.astype(np.float32)), dtype=np.float64).reshape(-1, 2)
        circle = _best_circle(_evenly_spaced(hull), edge)
        if circle is None:
            return None
        centre, radius = circle
        arc = _arc(edge, centre, radius)
        return None if arc < _MIN_ARC else Disc(centre + region.origin, radius + _INSIDE, arc)

    def search(self, picture: Pixels) -> Region:
        """Return the region of a picture around the largest green patch; empty if there is none."""
        h, w = picture.shape[:2]
        small = cv2.resize(picture, (w // _COARSE, h // _COARSE), interpolation=cv2.INTER_LINEAR)
        contours = _patches(green_mask(np.asarray(small, dtype=np.uint8)), SPECK / _COARSE**2)
        if not contours:
            return Region(0, 0, 0, 0)
        _, radius = cv2.minEnclosingCircle(contours[0].astype(np.float32))
        return Region.around(_COARSE * contours[0], _COARSE * float(radius) + 8.0, picture)


def green_mask(picture: Pixels) -> Pixels:
    """Return 255 where a picture's hue, saturation and value are within the bounds of the ball's green, else 0."""
    return np.asarray(cv2.inRange(cv2.cvtColor(picture, cv2.COLOR_BGR2HSV), _GREEN_FROM, _GREEN_UNTIL), dtype=np.uint8)


def _patches(mask: Pixels, speck: float) -> list[Floats]:
    """Return contours, shape (n, 2) each, of the largest patch and of those near it, parts of the same ball."""
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    patches = sorted(((cv2.contourArea(c), i) for i, c in enumerate(outlines)), reverse=True)
    if not patches or patches[0][0] < speck:
        return []
    contours = [np.asarray(outlines[i], dtype=np.float64).reshape(-1, 2) for area, i in patches if area >= speck]
    middle, reach = contours[0].mean(axis=0), 3.0 * np.sqrt(patches[0][0])
    return [c for c in contours if np.linalg.norm(c.mean(axis=0) - middle) < reach]


def _evenly_spaced(hull: Floats) -> Floats:
    """Return points, shape (16, 2), at equal distances along the hull's sides."""
    closed = np.concatenate([hull, hull[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    at = np.arange(_HULL_POINTS) * float(length[-1]) / _HULL_POINTS
    x, y = (np.interp(at, length, closed[:, i]) for i in (0, 1))
    return np.column_stack([x, y])


def _best_circle(hull: Floats, edge: Floats) -> tuple[Floats, float] | None:
    """Return centre and radius of the circle through three points of the hull that has most of the edge on it."""
    a = hull[_TRIPLES[0]]
    p, q = hull[_TRIPLES[1]] - a, hull[_TRIPLES[2]] - a
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


def _arc(edge: Floats, centre: Floats, radius: float) -> float:
    """Return the share of a circle, by sectors, that has points of the edge on it."""
    d = edge - centre
    d = d[np.abs(np.sqrt(np.einsum("ij,ij->i", d, d)) - radius) < _ON_CIRCLE]
    sector = np.floor((np.arctan2(d[:, 1], d[:, 0]) / (2.0 * np.pi) + 0.5) * _SECTORS).astype(np.int64) % _SECTORS
    return float(np.count_nonzero(np.bincount(sector, minlength=_SECTORS))) / _SECTORS
