"""How a person's hand moves: a minimum-jerk course, and as random processes tremor and drift of one held out."""

import math
from typing import NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.state import pack_state, unpack_state


def minimum_jerk(s: float) -> float:
    """Return 10 s^3 - 15 s^4 + 6 s^5, the part of the way at a part s of the time; 0 before and 1 after it."""
    s = min(max(s, 0.0), 1.0)
    return 10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5


class _Step(NamedTuple):
    """An advance by dt: transition F, root L of the noise's covariance, the drift's decay and the noise added to it."""

    dt: float
    F: tuple[float, ...]
    L: tuple[float, ...]
    decay: float
    drift_noise: float


class HandTremor:
    """Displacement of a held-out hand: band-limited tremor and slow drift, both stationary Gaussian processes.

    Tremor, per axis: x'' + 2 zeta w x' + w^2 x = white noise, w = 2 pi frequency, zeta = bandwidth / (2 frequency).
    Drift, per axis: first-order Gauss-Markov, x' = -x / T + white noise. Both are advanced by their exact transition,
    so their statistics do not depend on the steps. Both start at 0.

    Args:
        tremor_rms: root mean square length of the tremor, in m.
        frequency: middle of the tremor's band, in Hz.
        bandwidth: width of the band at half power, in Hz, less than twice the frequency.
        drift_rms: root mean square length of the drift, in m.
        drift_time: correlation time T of the drift, in s.
        seed: of the random numbers.
    """

    def __init__(
        self, tremor_rms: float, frequency: float, bandwidth: float, drift_rms: float, drift_time: float, seed: int
    ) -> None:
        self._omega = 2.0 * math.pi * frequency
        self._zeta = bandwidth / (2.0 * frequency)
        sigma = tremor_rms / math.sqrt(3.0)
        self._covariance = np.diag([sigma**2, (sigma * self._omega) ** 2])  # stationary: of displacement and velocity
        self._drift_sigma = drift_rms / math.sqrt(3.0)
        self._drift_time = drift_time
        self._rng = np.random.default_rng(seed)
        self._tremor = [(0.0, 0.0)] * 3  # displacement and velocity of each axis
        self._drift = [0.0] * 3
        self._step = _Step(0.0, (1.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), 1.0, 0.0)

    @property
    def displacement(self) -> Floats:
        """Displacement of the hand from where the person holds it, (3,), in m."""
        return np.array([x + d for (x, _), d in zip(self._tremor, self._drift, strict=True)])

    def advance(self, dt: float) -> None:
        """Advance by dt; the noise added in it has the covariance P - F P F^T, P the stationary one."""
        if dt != self._step.dt:
            self._step = self._step_of(dt)
        _, (F_xx, F_xv, F_vx, F_vv), (L_xx, L_vx, L_vv), decay, drift_noise = self._step
        n = self._rng.standard_normal(9).tolist()
        self._tremor = [
            (F_xx * x + F_xv * v + L_xx * n_x, F_vx * x + F_vv * v + L_vx * n_x + L_vv * n_v)
            for (x, v), n_x, n_v in zip(self._tremor, n[:3], n[3:6], strict=True)
        ]
        self._drift = [decay * d + drift_noise * n_d for d, n_d in zip(self._drift, n[6:], strict=True)]

    def get_state(self) -> bytes:
        """Return the complete state."""
        return pack_state((self._tremor, self._drift, self._rng.bit_generator))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this process or of one with equal arguments."""
        self._tremor, self._drift, self._rng.bit_generator.state = unpack_state(state)

    def _step_of(self, dt: float) -> "_Step":
        F = self._transition(dt)
        L = _root(self._covariance - F @ self._covariance @ np.transpose(F))
        decay = math.exp(-dt / self._drift_time)
        drift_noise = self._drift_sigma * math.sqrt(1.0 - decay * decay)
        return _Step(dt, tuple(F.reshape(-1).tolist()), tuple(L[np.tril_indices(2)].tolist()), decay, drift_noise)

    def _transition(self, dt: float) -> Floats:
        """Return the matrix that takes displacement and velocity, undisturbed, from t to t + dt."""
        decay, damped = self._zeta * self._omega, self._omega * math.sqrt(1.0 - self._zeta**2)
        c, s = math.cos(damped * dt), math.sin(damped * dt) / damped
        return math.exp(-decay * dt) * np.array([[c + decay * s, s], [-(self._omega**2) * s, c - decay * s]])


def _root(covariance: Floats) -> Floats:
    """Return the lower L of L L^T = covariance, (2, 2), also for one that is 0."""
    first = math.sqrt(max(covariance[0, 0], 0.0))
    mixed = covariance[1, 0] / first if first > 0.0 else 0.0
    return np.array([[first, 0.0], [mixed, math.sqrt(max(covariance[1, 1] - mixed**2, 0.0))]])
