"""Where the ball is from the gripper: an extended Kalman filter of what cameras, fingers and motors say.

Its state is x = [b, beta, s], shape (8,): b = p_WO - p_WG in W, m; beta, by how much the cameras have b wrong, m; and
s = (s_O, s_H), the logarithms of the reflectivities of ball and palm over the expected ones. Cameras measure b + beta,
fingers exp(s_O) h_O(R_GW b) + exp(s_H) h_H(R_GW b), and as the gripper is moved by m, b becomes b - m.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.helix.reflex.finger_model import FingerModel
from handover.cosim.blocks.ports import Floats

_B, _BETA, _S = slice(0, 3), slice(3, 6), slice(6, 8)
_SIZE = 8
_LEAST = 1e-4
"""Least deviation of a measurement by the cameras, m."""
_STEP = 0.0005
"""Displacement of the ball for differences of expected readings, m."""
_ITERATIONS = 8
_SETTLED = 1e-3
"""Gain of the cost, which is a sum of squared standard deviations, below which the iteration ends."""
_STARTS = (0.0, -0.02, -0.01, 0.01, 0.02)
"""How far along the gripper's axis the ball is tried at, m."""
_FAR_STARTS = (*_STARTS, -0.04, 0.04)
"""Likewise, where the belief fits no reading. These numbers are own choices (assumed)."""
_MISFIT, _REOPENED = 4.0, 0.01
"""Mean square of residuals, in their deviations, at which the belief counts as wrong, and the deviation that b gets
then, m: else a filter that has settled on the wrong one of two places stays there, however badly it fits."""


@dataclass(frozen=True, kw_only=True)
class Doubts:
    """Standard deviations of what the filter believes.

    Attributes:
        wander: of b after a second, m: ball and arm move by themselves.
        bias: of beta, m.
        brightness: of s_O and s_H.
        reading: of a reading, as a part of it; it stays alike for `memory`.
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

    Minimising |z - h|^2_R + |x - x_0|^2_P by Gauss-Newton ([Luberto] eqs. (4)-(10), with a model's derivatives
    in the place of probing moves) is the iterated extended Kalman filter (B. M. Bell, F. W. Cathey, IEEE Trans. Autom.
    Control 38 (1993)).

    Args:
        model: of the fingers.
        doubts: what is believed of errors.
        palm: expected reflectivity of the palm under the ball over the reference's; 0: there is none.

    Attributes:
        x: the state, shape (8,).
        cov: its covariance, shape (8, 8).
        known: whether cameras have given b.
    """

    def __init__(self, model: FingerModel, doubts: Doubts, palm: float = 0.0) -> None:
        self._model, self._doubts, self._palm = model, doubts, palm
        self.x: Floats = np.zeros(_SIZE)
        self.cov: Floats = np.diag([1.0] * 3 + [doubts.bias**2] * 3 + [doubts.brightness**2] * 2)
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
        return math.exp(self.x[_S][0])

    def move(self, motion: Floats, dt: float, slip: float) -> None:
        """Let the gripper move by `motion`, shape (3,), in W, m, in a time dt, s, give or take a part `slip` of it."""
        self.x[_B] -= motion
        doubt = slip**2 * float(motion @ motion) + self._doubts.wander**2 * dt
        self.cov[_B, _B] += doubt * np.eye(3)

    def see(self, b: Floats, R: Floats) -> None:
        """Take the cameras' measurement of b, shape (3,), m, with its covariance R, shape (3, 3).

        What is negative in R, or below 0.1 mm, is taken for 0.1 mm: a unit in vision's place may give no covariances.
        """
        spread, axes = np.linalg.eigh(0.5 * (R + np.transpose(R)))
        measured = (axes * np.maximum(spread, _LEAST**2)) @ np.transpose(axes)
        if not self.known:
            self.x[_B], self.cov[_B, _B], self.known = b, measured + self.cov[_BETA, _BETA], True
            self.cov[_B, _BETA] = self.cov[_BETA, _B] = -self.cov[_BETA, _BETA]
            return
        H = np.zeros((3, _SIZE))
        H[:, _B], H[:, _BETA] = np.eye(3), np.eye(3)
        self._update(H, b - self.x[_B] - self.x[_BETA], measured)

    def feel(self, ticks: Floats, R_WG: Floats, grip: float, dt: float) -> None:
        """Take the fingers' readings, shape (6,).

        Args:
            ticks: of the sensors.
            R_WG: orientation of the gripper, shape (3, 3).
            grip: its closure.
            dt: time since the last readings, s: what stays alike for `memory` is not taken for new in each.
        """
        beams = self._model.beams(grip)
        weight = max(self._doubts.memory / dt, 1.0) if dt > 0.0 else 1.0
        x, cov, misfit = self._fitted(beams, ticks, R_WG, weight, _STARTS)
        if misfit > _MISFIT:
            self.cov[_B, _B] += _REOPENED**2 * np.eye(3)
            x, cov, _ = self._fitted(beams, ticks, R_WG, weight, _FAR_STARTS)
        self.x, self.cov = x, cov

    def _fitted(
        self, beams: tuple[Floats, Floats], ticks: Floats, R_WG: Floats, weight: float, starts: tuple[float, ...]
    ) -> tuple[Floats, Floats, float]:
        """Return the likeliest state, its covariance, and the mean square of its residuals in their deviations."""
        information: Floats = np.linalg.inv(self.cov).astype(np.float64)
        before, x = self.x, self._start(beams, ticks, R_WG, weight, information, np.array(starts))
        best, posterior, least, misfit = before, self.cov, math.inf, 0.0
        for _ in range(_ITERATIONS):
            ball, palm, dh = self._expected(beams, x, R_WG)
            R, off = self._variance(ball, palm, ticks), x - before
            cost = float(_cost(ticks - ball - palm, weight * R) + off @ information @ off)
            if cost >= least:
                x = 0.5 * (best + x)  # the step was too long
                continue
            is_settled = cost > least - _SETTLED
            best, least, misfit = x, cost, float(np.mean((ticks - ball - palm) ** 2 / R))
            H = np.column_stack([dh, np.zeros((len(ticks), 3)), ball, palm])
            gain = self._gain(H, np.diag(weight * R))
            posterior = self._reduced(gain, H)
            if is_settled:
                break
            x = before + gain @ (ticks - ball - palm + H @ off)
        return best, posterior, misfit

    def _start(
        self,
        beams: tuple[Floats, Floats],
        ticks: Floats,
        R_WG: Floats,
        weight: float,
        information: Floats,
        along: Floats,
    ) -> Floats:
        """Return the state from which to iterate: the belief, or one moved along the gripper's axis that is likelier.

        What a beam reads is the same of a ball before its axis and beyond, so that the cost has more than one minimum.
        """
        moved = self.x[_B] + along[:, None] * R_WG[:, 2]
        ball, palm = self._readings(beams, moved @ R_WG, R_WG, self.x[_S])
        R = weight * self._variance(ball, palm, ticks)
        prior = along**2 * float(R_WG[:, 2] @ information[_B, _B] @ R_WG[:, 2])
        x = np.array(self.x)
        x[_B] = moved[int(np.argmin(_cost(ticks - ball - palm, R) + prior))]
        return x

    def _variance(self, ball: Floats, palm: Floats, ticks: Floats) -> Floats:
        """Return the variance of readings of which ball and palm make these parts, shapes (..., 6)."""
        return self._doubts.noise**2 + (self._doubts.reading * np.maximum(ball + palm, ticks)) ** 2

    def get_state(self) -> tuple[Any, ...]:
        """Return the complete state."""
        return np.array(self.x), np.array(self.cov), self.known

    def set_state(self, state: tuple[Any, ...]) -> None:
        """Restore what `get_state` gave."""
        self.x, self.cov, self.known = state

    def _expected(self, beams: tuple[Floats, Floats], x: Floats, R_WG: Floats) -> tuple[Floats, Floats, Floats]:
        """Return what ball and palm add to readings, shapes (6,), and derivatives of both by b, shape (6, 3), 1/m."""
        p_GO = np.transpose(R_WG) @ x[_B]
        moved = np.concatenate([p_GO + _STEP * np.eye(3), p_GO - _STEP * np.eye(3), p_GO[None]])
        ball, palm = self._readings(beams, moved, R_WG, x[_S])
        h = ball + palm
        return ball[6], palm[6], np.transpose(R_WG @ (h[:3] - h[3:6]) / (2.0 * _STEP))

    def _readings(self, beams: tuple[Floats, Floats], p_GO: Floats, R_WG: Floats, s: Floats) -> tuple[Floats, Floats]:
        """Return what ball and palm add to readings, shapes (n, 6), with the ball at places p_GO, shape (n, 3)."""
        ball = math.exp(s[0]) * self._model.readings(beams, p_GO)
        return ball, math.exp(s[1]) * self._palm * self._model.of_palm(beams, p_GO, -R_WG[2])

    def _update(self, H: Floats, innovation: Floats, R: Floats) -> None:
        K = self._gain(H, R)
        self.x = self.x + K @ innovation
        self.cov = self._reduced(K, H)

    def _gain(self, H: Floats, R: Floats) -> Floats:
        PH = self.cov @ np.transpose(H)
        K_transposed: Floats = np.linalg.solve(H @ PH + R, np.transpose(PH)).astype(np.float64)
        return np.transpose(K_transposed)

    def _reduced(self, K: Floats, H: Floats) -> Floats:
        P = (np.eye(_SIZE) - K @ H) @ self.cov
        return 0.5 * (P + np.transpose(P))


def _cost(off: Floats, R: Floats) -> Floats:
    """Return twice the negative logarithm of the density of residuals of variances R, but for a constant: over axis -1.

    The variances depend on the state, too: without their logarithm a place of which nothing is expected would win.
    """
    return np.sum(off**2 / R + np.log(R), axis=-1)
