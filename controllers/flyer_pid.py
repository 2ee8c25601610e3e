"""PID laws of a free-flyer's base, for its translation and its attitude."""

from dataclasses import dataclass

import numpy as np

from handover.controllers.flyer_body import FlyerBody
from handover.controllers.sampled_loop import LinearController
from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True, kw_only=True)
class PidGains:
    """Accelerations for error, its integral and its rate: 1/s2, 1/s3, 1/s."""

    k_P: float
    k_I: float
    k_D: float

    def faults(self, name: str) -> list[str]:
        """Return what keeps the continuous loop of a free body from being stable: Routh's k_P k_D > k_I >= 0."""
        if not (self.k_P > 0.0 and self.k_D > 0.0):
            return [f"{name}: k_P = {self.k_P:g} and k_D = {self.k_D:g} must be positive"]
        if not 0.0 <= self.k_I < self.k_P * self.k_D:
            return [f"{name}: k_I = {self.k_I:g} must be from 0 to less than k_P k_D = {self.k_P * self.k_D:g} 1/s3"]
        return []

    def scaled(self, factor: float) -> "PidGains":
        """Return all gains times a factor."""
        return PidGains(k_P=factor * self.k_P, k_I=factor * self.k_I, k_D=factor * self.k_D)


def pid_law(body: FlyerBody, position: PidGains, attitude: PidGains, period: float) -> LinearController:
    """Return both laws near the goal: commanded wrench on B from displacement and twist of G (6 and 6).

    The integral of a sample counts from the next one on. A channel without integral has no state for it: that would
    be a pole at one which nothing sees.
    """
    M, O = body.mass_matrix(), np.zeros((6, 6))
    base: Floats = np.linalg.inv(body.jacobian()).astype(np.float64)
    P, integral, D = (
        np.diag(np.repeat([getattr(position, k), getattr(attitude, k)], 3)) for k in ("k_P", "k_I", "k_D")
    )
    kept = np.eye(6)[np.diag(integral) > 0.0]
    return LinearController(
        A=np.eye(len(kept)),
        B=period * kept @ np.hstack([base, O]),
        C=M @ integral @ np.transpose(kept),
        D=M @ np.hstack([P @ base, D @ base]),
    )
