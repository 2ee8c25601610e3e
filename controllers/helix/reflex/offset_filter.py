"""Where the ball is from the gripper: an extended Kalman filter of what cameras, fingers and motors say.

Its state is x = [b, beta, s], shape (7,): b = p_WO - p_WG in W, m; beta, by how much the cameras have b wrong, m; and
s, the logarithm of the ball's reflectivity over the reference's. Cameras measure b + beta, fingers exp(s) h(R_GW b),
and as the gripper is moved by m, b becomes b - m.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.helix.reflex.finger_model import FingerModel
from handover.cosim.blocks.ports import Floats

_B, _BETA = slice(0, 3), slice(3, 6)
_S = 6
_STEP = 0.0005
"""Displacement of the ball for differences of expected readings, m."""
_ITERATIONS = 8
_SETTLED = 1e-5
"""Change of the state below which the iteration ends."""


@dataclass(frozen=True, kw_only=True)
class Doubts:
    """Standard deviations of what the filter believes.

    Attributes:
        wander: of b after a second, m: ball and arm move by themselves.
        bias: of beta, m.
        brightness: of s.
        reading: of a reading, as a part of the expected one; it stays alike for `memory`.
        noise: of a reading, ticks.
        memory: time for which errors of readings stay alike, s.
    """

    wander: float
    bias: float
    brightness: float
    reading: float
    noise: float
    memory: float


class OffsetFilter:
    """Follows x; an update by the fingers is Gauss-Newton's iteration on the residuals of readings and of the belief.

    Minimising |z - exp(s) h|^2_R + |x - x_0|^2_P by Gauss-Newton ([Luberto] eqs. (4)-(10), with a model's derivatives
    in the place of probing moves) is the iterated extended Kalman filter (B. M. Bell, F. W. Cathey, IEEE Trans. Autom.
    Control 38 (1993)).

    Args:
        model: of the fingers.
        doubts: what is believed of errors.

    Attributes:
        x: the state, shape (7,).
        cov: its covariance, shape (7, 7).
        known: whether cameras have given b.
    """

    def __init__(self, model: FingerModel, doubts: Doubts) -> None:
        self._model, self._doubts = model, doubts
        self.x: Floats = np.zeros(7)
        self.cov: Floats = np.diag([1.0] * 3 + [doubts.bias**2] * 3 + [doubts.brightness**2])
        self.known = False

    @property
    def offset(self) -> Floats:
        """b, shape (3,), in W, m."""
        return self.x[_B]

    @property
    def bias(self) -> Floats:
        """beta, shape (3,), in W, m."""
        return self.x[_BETA]

    @property
    def offset_covariance(self) -> Floats:
        """Covariance of b, shape (3, 3), m2."""
        return self.cov[_B, _B]

    @property
    def deviation(self) -> float:
        """Standard deviation of b: the root of its covariance's trace, m."""
        return math.sqrt(float(np.trace(self.offset_covariance)))

    @property
    def reflectivity(self) -> float:
        """Reflectivity of the ball over the reference's, as estimated."""
        return math.exp(self.x[_S])

    def move(self, motion: Floats, dt: float, slip: float) -> None:
        """Let the gripper move by `motion`, shape (3,), in W, m, in a time dt, s, give or take a part `slip` of it."""
        self.x[_B] -= motion
        doubt = slip**2 * float(motion @ motion) + self._doubts.wander**2 * dt
        self.cov[_B, _B] += doubt * np.eye(3)

    def see(self, b: Floats, R: Floats) -> None:
        """Take the cameras' measurement of b, shape (3,), m, with its covariance R, shape (3, 3)."""
        if not self.known:
            self.x[_B], self.cov[_B, _B], self.known = b, R + self.cov[_BETA, _BETA], True
            self.cov[_B, _BETA] = self.cov[_BETA, _B] = -self.cov[_BETA, _BETA]
            return
        H = np.zeros((3, 7))
        H[:, _B], H[:, _BETA] = np.eye(3), np.eye(3)
        self._update(H, b - self.x[_B] - self.x[_BETA], R)

    def feel(self, ticks: Floats, R_WG: Floats, grip: float, dt: float) -> None:
        """Take the fingers' readings, shape (6,).

        Args:
            ticks: of the sensors.
            R_WG: orientation of the gripper, shape (3, 3).
            grip: its closure.
            dt: time since the last readings, s: what stays alike for `memory` is not taken for new in each.
        """
        beams, before = self._model.beams(grip), self.x
        x, doubts = before, self._doubts
        weight = max(doubts.memory / dt, 1.0) if dt > 0.0 else 1.0
        H = np.zeros((len(ticks), 7))
        gain = np.zeros((7, len(ticks)))
        for _ in range(_ITERATIONS):
            h, dh = self._expected(beams, x, R_WG)
            H[:, _B], H[:, _S] = dh, h
            palm = self._model.of_palm(beams, np.transpose(R_WG) @ x[_B], -R_WG[2])
            variance = doubts.noise**2 + (doubts.reading * np.maximum(h, ticks)) ** 2 + palm**2
            gain = self._gain(H, weight * np.diag(variance))
            following = before + gain @ (ticks - h - H @ (before - x))
            change = np.abs(following - x).max()
            x = following
            if change < _SETTLED:
                break
        self.x = x
        self.cov = self._reduced(gain, H)

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        return np.array(self.x), np.array(self.cov), self.known

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        self.x, self.cov, self.known = state

    def _expected(self, beams: tuple[Floats, Floats], x: Floats, R_WG: Floats) -> tuple[Floats, Floats]:
        """Return expected readings, shape (6,), and their derivatives by b, shape (6, 3), 1/m."""
        p_GO = np.transpose(R_WG) @ x[_B]
        moved = np.concatenate([p_GO + _STEP * np.eye(3), p_GO - _STEP * np.eye(3), p_GO[None]])
        h = math.exp(x[_S]) * self._model.readings(beams, moved)
        return h[6], np.transpose(R_WG @ (h[:3] - h[3:6]) / (2.0 * _STEP))

    def _update(self, H: Floats, innovation: Floats, R: Floats) -> None:
        K = self._gain(H, R)
        self.x = self.x + K @ innovation
        self.cov = self._reduced(K, H)

    def _gain(self, H: Floats, R: Floats) -> Floats:
        PH = self.cov @ np.transpose(H)
        K_transposed: Floats = np.linalg.solve(H @ PH + R, np.transpose(PH)).astype(np.float64)
        return np.transpose(K_transposed)

    def _reduced(self, K: Floats, H: Floats) -> Floats:
        P = (np.eye(7) - K @ H) @ self.cov
        return 0.5 * (P + np.transpose(P))
