"""The ball's position from its outlines in the pictures, its radius being known."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handover.controllers.ball_outline import BallOutline
from handover.controllers.normal_equations import covariance, least_squares
from handover.controllers.stereo_rig import StereoRig
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

_ITERATIONS = 6
_LARGEST_SHIFT = 2.0  # px; an edge that is farther off is that of something larger or smaller


@dataclass(frozen=True)
class BallPosition:
    """Centre p_WO, shape (3,), in m, and its covariance, shape (3, 3), in m^2."""

    p_WO: Floats
    covariance: Floats


class BallFit:
    """Least squares on the distances between the rays of the outlines and the sphere, which they touch.

    A ray from a camera at C in direction d touches the sphere if |(p_WO - p_WC) x d| = r. Blur and thresholds move the
    whole edge in or out; so its shift, in px, is estimated too. That leaves what two cameras see to the angle between
    them; what one camera sees has a depth from its size, as uncertain as the shift makes it.

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
            start, gap = self._rig.meeting_point(left.centre, right.centre)
            if gap <= self._gap and min(float(c.depth(start)) for c in self._rig.cameras) > 0.0:
                return self._settle([left, right], self._rig.cameras, start)
            left, right = (left, None) if left.arc >= right.arc else (None, right)
        for outline, camera in ((left, self._rig.left), (right, self._rig.right)):
            if outline:
                d = camera.rays(outline.centre[None])[0]
                f = float(camera.f.mean())
                return self._settle([outline], [camera], camera.p_WC + d * self._radius * f / outline.radius)
        return None

    def _settle(self, outlines: Sequence[BallOutline], cameras: Sequence[Pinhole], p_WO: Floats) -> BallPosition | None:
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
        if not np.isfinite(p_WO).all() or behind or abs(shift - mean) > _LARGEST_SHIFT:
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
