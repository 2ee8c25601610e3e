"""Estimates from pictures how far the detector's corners and edges lie off the true ones.

Blur and thresholds move what is found: refined corners come out inside of the printed ones, by `corner_shift` along the
diagonal, and the ball's edge comes out shifted outwards by `edge_shift` (inwards where it is negative). Both show
without anybody knowing where ring and ball are, because the angle between two cameras tells how far away they are and
so how large they should look.

[Vervloet2025] calibrates lenses and poses of the cameras (sec. 3.2.2), but not the detector: this is own.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from handover.controllers.helix.vision.ball import BallFinder
from handover.controllers.helix.vision.ball_fit import BallFit
from handover.controllers.helix.vision.markers import MarkerReader, MarkerRing, Markers
from handover.controllers.helix.vision.ring_fit import RingFit
from handover.controllers.helix.vision.stereo import Pixels, least_squares
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

_ITERATIONS = 4
_TOLERANCE = 3.0  # px; RMS misfit of a marker, which is larger while its shift is not known
_FREE = 5.0  # px; standard deviation of the edge's shift, of which nothing is known
_FAR = 0.012  # m; largest distance between both cameras' rays to the ball
_FEWEST = 3  # estimates that tell a deviation


class TooFewPictures(ValueError):
    """Too few of the pictures show what a shift is estimated from, in both cameras."""

    def __init__(self, what: str, found: int) -> None:
        super().__init__(f"{found} pairs of pictures show the {what} to both cameras; {_FEWEST} are needed at least")
        self.what, self.found = what, found


@dataclass(frozen=True)
class Shift:
    """A shift of what is found, in px, its standard error, in px, and by how many pairs of pictures it is known."""

    value: float
    error: float
    pairs: int

    def __str__(self) -> str:
        return f"{self.value:+.3f} +- {self.error:.3f} px, by {self.pairs} pairs of pictures"


@dataclass(frozen=True)
class DetectorCalibration:
    """What `HandoverVision` has as its parameters `corner_shift` and `edge_shift`."""

    corner_shift: Shift
    edge_shift: Shift

    def __str__(self) -> str:
        return f"corner_shift {self.corner_shift}\nedge_shift   {self.edge_shift}"


def calibrate_detector(
    pairs: Iterable[Sequence[Pixels]], cameras: Sequence[Pinhole], ring: MarkerRing, ball_radius: float
) -> DetectorCalibration:
    """Return both shifts, estimated from pairs of pictures of ring and ball in several unknown poses.

    Of each pair, the ring's pose and the shift of its corners are fitted together, seven unknowns to all corners; and
    so are the ball's centre and the shift of its edge, four unknowns to the outlines. A shift is the mean over the
    pairs, each weighed by what its fit knows about it; its error follows from the scatter about the mean.

    Args:
        pairs: pictures of the left and the right camera, shape (h, w, 3), of the same time.
        cameras: both, calibrated.
        ring: the markers.
        ball_radius: in m.

    Raises:
        TooFewPictures: fewer than three pairs show the ring, or the ball, to both cameras.
    """
    corners: list[tuple[float, float]] = []
    edges: list[tuple[float, float]] = []
    reader, finder = MarkerReader(0.0, len(ring.corners) // 8), BallFinder()
    ring_fit = RingFit(ring, cameras, _TOLERANCE)
    ball_fit = BallFit(cameras, ball_radius, 1.0, (0.0, _FREE), _FAR)
    for pictures in pairs:
        corner = corner_shift([reader.read(p, reader.search(p)) for p in pictures], ring_fit)
        discs = [finder.find(p, finder.search(p)) for p in pictures]
        ball = ball_fit.fit(pictures, discs) if all(discs) else None
        if corner:
            corners.append(corner)
        if ball and ball.shift_variance < 0.5 * _FREE**2:
            edges.append((ball.shift, 1.0 / ball.shift_variance))
    return DetectorCalibration(_mean("marker ring", corners), _mean("ball", edges))


def corner_shift(seen: Sequence[Markers], ring_fit: RingFit) -> tuple[float, float] | None:
    """Return the shift of corners, in px, by one pair of pictures, and how much is known of it; None where too little.

    Gauss-Newton on e(x, s) = seen + s outwards - projected(x) by pose x and shift s together; what is known is the
    inverse variance of s for corners of unit variance, the pose being unknown.

    Args:
        seen: the markers in each camera's picture, corners as they are found.
        ring_fit: that fits the ring's pose.
    """
    if not all(len(m.ids) for m in seen):
        return None
    outwards = [m.corners - m.corners.mean(axis=1, keepdims=True) for m in seen]
    outwards = [d / np.linalg.norm(d, axis=2, keepdims=True) for d in outwards]
    by_shift = np.concatenate([d.ravel() for d in outwards])
    s, known, near = 0.0, 0.0, None
    for _ in range(_ITERATIONS):
        moved = [Markers(m.ids, m.corners + s * d) for m, d in zip(seen, outwards, strict=True)]
        pose = ring_fit.fit(moved, near)
        if pose is None:
            return None
        near = pose.p_WR, pose.R_WR
        e, J = ring_fit.misfit(moved, *near)
        dx, information = least_squares(np.column_stack([J, -by_shift]), e)
        s, known = s + float(dx[6]), 1.0 / float(np.linalg.inv(information)[6, 6])
    return s, known


def _mean(what: str, estimates: Sequence[tuple[float, float]]) -> Shift:
    if len(estimates) < _FEWEST:
        raise TooFewPictures(what, len(estimates))
    values, weights = (np.array(x) for x in zip(*estimates, strict=True))
    values, weights = _without_outliers(values, weights)
    mean = float(weights @ values / weights.sum())
    scatter = weights @ (values - mean) ** 2 / weights.sum() / max(len(values) - 1, 1)
    return Shift(mean, float(np.sqrt(scatter)), len(values))


def _without_outliers(values: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Leave out what is more than five median deviations off the median: half-hidden discs, misread markers."""
    off = np.abs(values - np.median(values))
    good = off <= 5.0 * np.median(off) + 1e-9
    return values[good], weights[good]
