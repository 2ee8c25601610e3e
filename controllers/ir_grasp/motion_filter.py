"""Distances, their Jacobian, and the object's motion across, estimated while the hand moves.

Each finger's distance and its row of the Jacobian are estimated by a Kalman filter, d' = J u + noise with J a random
walk: recursive least squares with forgetting, in which every input that moves is probed, several at once. The
middle between the surfaces that thumb and ring see moves, in W, with the object alone, whatever the hand does across,
so its motion that the hand's way ahead does not explain is the object's velocity.
"""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from handover.controllers.ir_grasp.moves import X
from handover.controllers.ir_grasp.parameters import Params
from handover.controllers.ir_grasp.sensor_geometry import nominal_jacobian, surface_points
from handover.cosim.blocks.ports import Floats

_FINGERS: Final = 3
_ROW: Final = 5  # distance, then its derivatives by [ahead, left, yaw, sigma]
_DIAGONAL: Final = np.arange(_ROW)

_DEVIATIONS: Final = 5.0  # by which a reading may be off what is predicted, besides `jump`
_MIDDLE_JUMP: Final = 2.0  # in `jump`, of the middle
_MIDDLE_SPREAD: Final = 2e-3  # m; standard deviation of the middle when it is first seen
_MIDDLE_NOISE: Final = 5e-4  # m; of a reading of the middle
"""Assumed, as the parameters are: tuned on seeds below 1000."""

_AGES: Final = (2.0 / 3.0, 1.0 / 3.0, 0.0)
"""Age of each sensor's reading, in rounds: they are read one after the other (sec. V-B), the ring's last."""


class MotionFilter:
    """Estimates distances (m), their Jacobian by [ahead, left, yaw, sigma] of the hand, and the object's velocity.

    Args:
        params: of the reflex.
        period: of the readings, in s.
    """

    def __init__(self, params: Params, period: float) -> None:
        self._params, self._dt = params, period
        self._m: Floats = np.zeros((_FINGERS, _ROW))
        self._cov: Floats = np.zeros((_FINGERS, _ROW, _ROW))
        self._x: X = ()
        self.seen: tuple[bool, ...] = (False,) * _FINGERS
        yaw = params.yaw_pregrasp
        self._ahead, self._left = np.array([math.cos(yaw), math.sin(yaw)]), np.array([-math.sin(yaw), math.cos(yaw)])
        self._middle: Floats = np.zeros(3)  # place across, its change by way ahead, velocity across
        self._spread: Floats = np.zeros((3, 3))
        self._rounds = 0  # in which thumb and ring saw

    @property
    def distances(self) -> Floats:
        """Estimated distances of thumb, index and ring, (3,), in m; of a finger that sees nothing, NaN."""
        return np.where(self.seen, np.array(self._m[:, 0]), math.nan)

    @property
    def jacobian(self) -> Floats:
        """Estimated d(distance)/d[ahead, left, yaw, sigma], (3, 4)."""
        return np.array(self._m[:, 1:])

    @property
    def jacobian_offset(self) -> Floats:
        """What was learnt: the estimated Jacobian less that of the hand's design at the last closure, (3, 4)."""
        return self.jacobian - nominal_jacobian(self._x[3]) if self._x else np.array(self._params.jacobian_offset_0)

    @property
    def velocity(self) -> Floats:
        """Estimated velocity of the object across the pre-grasp heading, (2,) in W, in m/s.

        The estimate times v^2 / (v^2 + variance + rest_speed^2): what may be noise is not followed.
        """
        p, v = self._params, float(self._middle[2])
        if self._rounds * self._dt < p.velocity_after:
            return np.zeros(2)
        sure = v**2 / (v**2 + float(self._spread[2, 2]) + p.rest_speed**2)
        return self._left * max(-p.follow_speed, min(sure * v, p.follow_speed))

    def advance(self, x: X, distances: Sequence[float], seen: Sequence[bool], noise: Sequence[float]) -> None:
        """Take the encoders, and the readings of the last round.

        Args:
            x: encoders [p_x, p_y, yaw, sigma].
            distances: by eq. (11), in m.
            seen: which of them are of the object.
            noise: standard deviation of each, in m.
        """
        if not self._x:
            self._m[:, 1:] = self._first_jacobian(x[3])
        before = self._x or x
        self._x = x
        d_W = np.array([x[0] - before[0], x[1] - before[1]])
        c, s = math.cos(x[2]), math.sin(x[2])
        relative = d_W - self._dt * self.velocity
        moved = np.array(
            [
                c * relative[0] + s * relative[1],
                c * relative[1] - s * relative[0],
                x[2] - before[2],
                x[3] - before[3],
            ]
        )
        self._predict(moved, x[3])
        for i in range(_FINGERS):
            if seen[i] and not (self.seen[i] and self._correct(i, moved, distances[i], noise[i])):
                self._begin(i, x[3], distances[i], noise[i])
        self._follow_middle(x, float(self._ahead @ d_W), np.array(distances), seen)
        self.seen = tuple(bool(v) for v in seen)

    def _predict(self, moved: Floats, sigma: float) -> None:
        """Advance by one round; what was learnt of the Jacobian fades towards that to begin with."""
        p, first = self._params, self._first_jacobian(sigma)
        keep = 1.0 - self._dt / p.jacobian_memory
        self._m[:, 1:] = first + keep * (self._m[:, 1:] - first)
        F: Floats = np.diag([1.0, keep, keep, keep, keep])
        F[0, 1:] = keep * moved
        self._m[:, 0] += self._m[:, 1:] @ moved
        self._cov = np.matmul(np.matmul(F, self._cov), np.transpose(F))
        self._cov[:, _DIAGONAL, _DIAGONAL] += np.concatenate([[p.distance_drift], p.jacobian_drift]) ** 2

    def _correct(self, i: int, moved: Floats, distance: float, noise: float) -> bool:
        """Take a finger's reading; return False if it does not fit, as when a beam leaves an edge."""
        h = np.concatenate([[1.0], -_AGES[i] * moved])  # the reading is that old
        innovation = distance - float(h @ self._m[i])
        Ph = self._cov[i] @ h
        variance = float(h @ Ph) + noise**2
        if innovation**2 > self._params.jump**2 + _DEVIATIONS**2 * variance:
            return False
        self._m[i] += Ph * (innovation / variance)
        self._cov[i] -= np.outer(Ph, Ph) / variance
        return True

    def _begin(self, i: int, sigma: float, distance: float, noise: float) -> None:
        """Begin a finger's row by what is known without a move."""
        self._m[i] = np.concatenate([[distance], self._first_jacobian(sigma)[i]])
        self._cov[i] = np.diag(np.concatenate([[noise], self._params.jacobian_spread]) ** 2)

    def _first_jacobian(self, sigma: float) -> Floats:
        """Return the Jacobian of the hand's design, with what an earlier grasp found it to be off by."""
        return nominal_jacobian(sigma) + self._params.jacobian_offset_0

    def _follow_middle(self, x: X, ahead: float, distances: Floats, seen: Sequence[bool]) -> None:
        """Take the middle between thumb's and ring's surface as a place across, y' = slope (way ahead)' + v.

        Both readings are taken for present ones: a hand at 0.1 m/s across shifts the middle by 0.5 mm, as by its noise.
        """
        p = self._params
        F: Floats = np.array([[1.0, ahead, self._dt], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        self._middle = np.dot(F, self._middle)
        self._spread = np.dot(np.dot(F, self._spread), np.transpose(F))
        self._spread[[0, 1, 2], [0, 1, 2]] += np.array([p.distance_drift, p.slope_drift, p.velocity_drift]) ** 2
        if not (seen[0] and seen[2]):
            return
        points = surface_points(x[3], distances)
        a, b = 0.5 * (points[0] + points[2])
        c, s = math.cos(x[2]), math.sin(x[2])
        y = float(self._left @ np.array([x[0] + c * a - s * b, x[1] + s * a + c * b]))
        if not self._rounds or abs(y - self._middle[0]) > _MIDDLE_JUMP * p.jump:
            spread = [_MIDDLE_SPREAD, p.slope_spread, p.velocity_spread]
            if not self._rounds:
                self._middle, self._spread = np.array([y, 0.0, 0.0]), np.diag(np.array(spread) ** 2)
            else:
                self._middle[0] = y
                self._spread[0, :], self._spread[:, 0] = 0.0, 0.0
                self._spread[0, 0] = spread[0] ** 2
        self._rounds += 1
        gain = self._spread[:, 0] / (self._spread[0, 0] + _MIDDLE_NOISE**2)
        self._middle += gain * (y - self._middle[0])
        self._spread -= np.outer(gain, self._spread[0, :])

    def get_state(self) -> tuple[tuple[Floats, Floats, Floats, Floats], X, tuple[bool, ...], int]:
        """Return means and covariances, the encoders, who sees, and for how long."""
        arrays = (np.array(self._m), np.array(self._cov), np.array(self._middle), np.array(self._spread))
        return arrays, self._x, self.seen, self._rounds

    def set_state(self, state: tuple[tuple[Floats, Floats, Floats, Floats], X, tuple[bool, ...], int]) -> None:
        """Restore a state that `get_state` gave."""
        arrays, self._x, self.seen, self._rounds = state
        self._m, self._cov, self._middle, self._spread = (np.array(a) for a in arrays)
