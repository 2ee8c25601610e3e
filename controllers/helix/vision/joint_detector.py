"""One pose from all marker corners and one sphere from both outlines, tracked from picture to picture.

It takes the place of the thesis's averages ([Vervloet2025] sec. 3.2.3 and 3.2.4, `published_detector`). What a detector
gives, `BallPosition` and `WristPosition`, is the same of either.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.helix.vision.ball import BallFinder
from handover.controllers.helix.vision.ball_fit import BallFit
from handover.controllers.helix.vision.markers import NO_MARKERS, MarkerReader, MarkerRing, Markers
from handover.controllers.helix.vision.ring_fit import RingFit, RingPose
from handover.controllers.helix.vision.stereo import BallPosition, Pixels, Region, WristPosition, covariance
from handover.cosim.blocks.geometry import Pinhole, rotation_angle
from handover.cosim.blocks.ports import Floats

_BALL_MARGIN = 22.0  # px around where the ball was; at ten pictures a second, one faster than 0.2 m/s is searched anew
_BALL_MOVED = 0.012  # m; from there on, the region around where it was may show a part of it only
_RING_MARGIN = 16.0  # px
_LEVER = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # w -> w x e_z
_DEVIATIONS = 3.0  # standard deviations of both fits, by which they may differ besides the motion


@dataclass(frozen=True)
class Bounds:
    """Of what is accepted as a pose of the ring.

    Attributes:
        speed: largest speed of the wrist, in m/s.
        turn: largest rate of turn of the wrist, in rad/s.
        deviation: largest root mean square error of p_WR that is expected of a pose, in m.
    """

    speed: float
    turn: float
    deviation: float


@dataclass(frozen=True)
class _Fitted:
    """A pose of the ring that was accepted, when, and its deviations: of p_WR in m, of R_WR in rad."""

    t: float
    p_WR: Floats
    R_WR: Floats
    deviation: tuple[float, float]


class JointDetector:
    """Finds the ball as a sphere and the ring by one fit of six unknowns, in regions around where they were.

    Where nothing is found in the regions, it searches the whole pictures. One camera is enough for both, at a larger
    covariance.

    A pose of the ring is refused, and counts as not seen, if a single view of a marker carries it (`RingFit.fit`), if
    it is worth little, or if it contradicts its prediction. It is worth little if the error that its covariance lets
    expect is beyond a bound: two small markers in one picture leave errors of five times their deviation. The
    prediction is the last accepted pose, moved no faster than the bounds: with dt the time since, a pose may be off
    by speed dt and turn dt, plus three standard deviations of both fits. As dt grows, so does what is allowed, so that
    an arm that was hidden for long is found again wherever it is.

    Args:
        cameras: two or more.
        ring: the markers.
        reader: reads markers of that many rings.
        ring_fit: fits the ring's pose.
        ball_fit: fits the ball.
        bounds: of what is accepted.
        corner_noise: standard deviation of a marker's corners, in px.
        ball_radius: in m.
        d_gripper: distance of the gripper from the wrist, in m, eq. (13).
    """

    def __init__(
        self,
        cameras: Sequence[Pinhole],
        ring: MarkerRing,
        reader: MarkerReader,
        ring_fit: RingFit,
        ball_fit: BallFit,
        bounds: Bounds,
        *,
        corner_noise: float,
        ball_radius: float,
        d_gripper: float,
    ) -> None:
        self._cameras, self._ring, self._reader = cameras, ring, reader
        self._ring_fit, self._ball_fit, self._finder = ring_fit, ball_fit, BallFinder()
        self._bounds = bounds
        self._corner_noise, self._ball_radius, self._d_gripper = corner_noise, ball_radius, d_gripper
        self._p_WO: Floats | None = None  # where the ball was in the last pictures
        self._fitted: _Fitted | None = None
        self._sees_ring = False  # whether the last pictures showed it

    def find_ball(self, pictures: Sequence[Pixels]) -> BallPosition | None:
        """Return the ball's position, or None."""
        ball = None
        if self._p_WO is not None:
            ball = self._ball_near(pictures, self._p_WO)
            if ball and float(np.linalg.norm(ball.p_WO - self._p_WO)) > _BALL_MOVED:
                ball = self._ball_near(pictures, ball.p_WO)
        if ball is None:
            ball = self._ball_in(pictures, [self._finder.search(p) for p in pictures], None)
        self._p_WO = None if ball is None else ball.p_WO
        return ball

    def find_wrist(self, t: float, pictures: Sequence[Pixels]) -> WristPosition | None:
        """Return wrist and gripper at time t, in s, or None."""
        accepted = None
        if self._fitted and self._sees_ring:
            accepted = self._plausible(t, self._track(pictures, (self._fitted.p_WR, self._fitted.R_WR)))
        accepted = accepted or self._plausible(t, self._search(pictures))
        self._sees_ring = accepted is not None
        if accepted is None:
            return None
        self._fitted, cov = accepted
        return self._measured(self._fitted, cov)

    def get_state(self) -> Any:
        """Return the last ball and the last accepted pose, as plain data."""
        fitted = self._fitted and tuple(vars(self._fitted).values())
        return self._p_WO, self._sees_ring, fitted

    def set_state(self, state: Any) -> None:
        """Restore a state that `get_state` gave."""
        self._p_WO, self._sees_ring, fitted = state
        self._fitted = None if fitted is None else _Fitted(*fitted)

    def _ball_near(self, pictures: Sequence[Pixels], p_WO: Floats) -> BallPosition | None:
        regions = [self._ball_region(c, p, p_WO) for c, p in zip(self._cameras, pictures, strict=True)]
        return self._ball_in(pictures, regions, p_WO)

    def _ball_in(
        self, pictures: Sequence[Pixels], regions: Sequence[Region], near: Floats | None
    ) -> BallPosition | None:
        return self._ball_fit.fit(
            pictures, [self._finder.find(p, r) for p, r in zip(pictures, regions, strict=True)], near
        )

    def _ball_region(self, camera: Pinhole, picture: Pixels, p_WO: Floats) -> Region:
        depth = max(float(camera.depth(p_WO)), self._ball_radius)
        radius = float(camera.f.max()) * self._ball_radius / depth
        return Region.around(camera.project(p_WO)[None], radius + _BALL_MARGIN, picture)

    def _ring_region(self, camera: Pinhole, picture: Pixels, near: tuple[Floats, Floats]) -> Region:
        p_WR, R_WR = near
        outline = p_WR + self._ring.outline @ np.transpose(R_WR)
        return Region.around(camera.project(outline), _RING_MARGIN, picture)

    def _track(self, pictures: Sequence[Pixels], near: tuple[Floats, Floats]) -> RingPose | None:
        regions = [self._ring_region(c, p, near) for c, p in zip(self._cameras, pictures, strict=True)]
        return self._ring_fit.fit([self._reader.read(p, r) for p, r in zip(pictures, regions, strict=True)], near)

    def _search(self, pictures: Sequence[Pixels]) -> RingPose | None:
        """Return the pose of a ring that may be anywhere: what one picture tells says where to look in the next.

        A search of a whole picture costs several times a look into a region.
        """
        seen = [NO_MARKERS] * len(pictures)
        near: tuple[Floats, Floats] | None = None
        for i, (camera, picture) in enumerate(zip(self._cameras, pictures, strict=True)):
            if pose := self._ring_fit.fit(seen, near):
                near = pose.p_WR, pose.R_WR
                seen[i] = self._reader.read(picture, self._ring_region(camera, picture, near))
            if not len(seen[i].ids):
                seen[i] = self._reader.read(picture, self._reader.search(picture))
        return self._fit_from(seen, near)

    def _fit_from(self, seen: Sequence[Markers], near: tuple[Floats, Floats] | None) -> RingPose | None:
        pose = self._ring_fit.fit(seen, near)
        return self._ring_fit.fit(seen, None) if pose is None and near else pose

    def _plausible(self, t: float, pose: RingPose | None) -> tuple[_Fitted, Floats] | None:
        """Return the pose and its covariance, shape (6, 6), unless it is worth little or contradicts its prediction."""
        if pose is None:
            return None
        cov = covariance(pose.information, self._corner_noise)
        variance = np.diagonal(cov)
        apart, turn = math.sqrt(variance[:3].sum()), math.sqrt(variance[3:].sum())  # expected errors, RMS
        fitted = _Fitted(t, pose.p_WR, pose.R_WR, (apart, turn))
        if apart > self._bounds.deviation:
            return None
        if self._fitted is None:
            return fitted, cov
        last, dt = self._fitted, max(t - self._fitted.t, 0.0)
        shifted = float(np.linalg.norm(pose.p_WR - last.p_WR))
        turned = rotation_angle(np.transpose(last.R_WR) @ pose.R_WR)
        is_near = shifted <= self._bounds.speed * dt + _DEVIATIONS * math.hypot(apart, last.deviation[0])
        is_like = turned <= self._bounds.turn * dt + _DEVIATIONS * math.hypot(turn, last.deviation[1])
        return (fitted, cov) if is_near and is_like else None

    def _measured(self, pose: _Fitted, cov: Floats) -> WristPosition:
        """Return wrist and gripper; d p_WG / d w = d_gripper R [w]x e_z for a turn w in R."""
        J = np.concatenate([np.eye(3), self._d_gripper * pose.R_WR @ _LEVER], axis=1)
        p_WG = pose.p_WR + self._d_gripper * pose.R_WR[:, 2]
        return WristPosition(pose.p_WR, p_WG, cov[:3, :3], J @ cov @ np.transpose(J))
