"""Control gains of a free-flyer: impedance of its gripper, [Fernandes2020] table 4.1, and PID of its base.

Both kinds give their control law near the goal as a `LinearController`, for the analysis of its stability.
"""

from dataclasses import dataclass

import numpy as np

from handover.controllers.free_flyer.body import FlyerBody, positive_definite
from handover.controllers.free_flyer.ports import Behaviour
from handover.controllers.free_flyer.sampled_loop import LinearController, without_memory
from handover.cosim.blocks.plain_rotation import Vector, weighted_sum
from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True, kw_only=True)
class ImpedanceGains:
    """k_D and k_B of eq. (3.25), each (3, 3), for translation (N/m, N s/m) and rotation (N m/rad, N m s/rad)."""

    stiffness_translation: Floats
    damping_translation: Floats
    stiffness_rotation: Floats
    damping_rotation: Floats

    def faults(self) -> list[str]:
        """Return which of the four matrices is not symmetric and positive definite, as eq. (3.25) requires."""
        return [
            f"{name} = {np.asarray(M).tolist()} must be symmetric and positive definite"
            for name, M in vars(self).items()
            if not positive_definite(M)
        ]

    def scaled(self, factor: float) -> "ImpedanceGains":
        """Return all gains times a factor."""
        return ImpedanceGains(**{name: factor * M for name, M in vars(self).items()})

    def stiffness(self) -> Floats:
        """Return k_D of translation and rotation as one matrix (6, 6)."""
        return _block_diagonal(self.stiffness_translation, self.stiffness_rotation)

    def damping(self) -> Floats:
        """Return k_B of both, likewise."""
        return _block_diagonal(self.damping_translation, self.damping_rotation)

    def law(self, body: FlyerBody) -> LinearController:
        """Return eq. (3.25) near the goal: commanded wrench on B from displacement and twist of G."""
        return without_memory(np.transpose(body.jacobian()) @ np.hstack([self.stiffness(), self.damping()]))


def _block_diagonal(upper: Floats, lower: Floats) -> Floats:
    M: Floats = np.zeros((6, 6))
    M[:3, :3], M[3:, 3:] = upper, lower
    return M


def published_gains(behaviour: Behaviour, body: FlyerBody) -> ImpedanceGains:
    """Return the rigid or the compliant column of table 4.1: 7 m, 15, 70 H, 5 or 0.7 m, 5, 7 H, 1."""
    k, d, k_R, d_R = {Behaviour.RIGID: (7.0, 15.0, 70.0, 5.0), Behaviour.COMPLIANT: (0.7, 5.0, 7.0, 1.0)}[behaviour]
    I = np.eye(3)
    return ImpedanceGains(
        stiffness_translation=np.diag([k * body.mass] * 3),
        damping_translation=d * I,
        stiffness_rotation=k_R * body.I_B,
        damping_rotation=d_R * I,
    )


@dataclass(frozen=True, kw_only=True)
class PidGains:
    """Accelerations for error, its integral and its rate: 1/s2, 1/s3, 1/s."""

    k_P: float
    k_I: float
    k_D: float

    def faults(self, name: str) -> list[str]:
        """Return what makes the continuous loop of a free body unstable, by Routh: k_P k_D > k_I >= 0 must hold."""
        if not (self.k_P > 0.0 and self.k_D > 0.0):
            return [f"{name}: k_P = {self.k_P:g} and k_D = {self.k_D:g} must be positive"]
        if not 0.0 <= self.k_I < self.k_P * self.k_D:
            return [f"{name}: k_I = {self.k_I:g} must be from 0 to less than k_P k_D = {self.k_P * self.k_D:g} 1/s3"]
        return []

    def acceleration(self, e: Vector, integral: Vector, rate: Vector) -> Vector:
        """Return k_P e + k_I integral + k_D rate, in m/s2 or rad/s2, for an error's integral and rate."""
        return weighted_sum(self.k_P, e, self.k_I, integral, self.k_D, rate)

    def scaled(self, factor: float) -> "PidGains":
        """Return all gains times a factor."""
        return PidGains(k_P=factor * self.k_P, k_I=factor * self.k_I, k_D=factor * self.k_D)


def pid_law(body: FlyerBody, position: PidGains, attitude: PidGains, period: float) -> LinearController:
    """Return both laws near the goal: commanded wrench on B from displacement and twist of G (6 and 6).

    The integral of a sample counts from the next one on. A channel without integral has no state for it: that would
    be an unobservable pole at one.
    """
    M, O = body.mass_matrix(), np.zeros((6, 6))
    base: Floats = np.linalg.inv(body.jacobian()).astype(np.float64)
    P, integral, D = (
        np.diag(np.repeat([getattr(position, k), getattr(attitude, k)], 3)) for k in ("k_P", "k_I", "k_D")
    )
    integrated = np.eye(6)[np.diag(integral) > 0.0]
    return LinearController(
        A=np.eye(len(integrated)),
        B=period * integrated @ np.hstack([base, O]),
        C=M @ integral @ np.transpose(integrated),
        D=M @ np.hstack([P @ base, D @ base]),
    )
