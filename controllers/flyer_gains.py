"""Stiffness and damping of a free-flyer's gripper. [Fernandes2020] table 4.1."""

from dataclasses import dataclass

import numpy as np

from handover.controllers.flyer_behaviour import Behaviour
from handover.controllers.flyer_body import FlyerBody, positive_definite
from handover.controllers.sampled_loop import LinearController, without_memory
from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True, kw_only=True)
class ImpedanceGains:
    """k_D and k_B of eq. (3.25), each (3, 3), for translation (N/m, N s/m) and rotation (N m/rad, N m s/rad)."""

    stiffness_translation: Floats
    damping_translation: Floats
    stiffness_rotation: Floats
    damping_rotation: Floats

    def faults(self) -> list[str]:
        """Return which of the four matrices is not symmetric and positive definite, as eq. (3.25) wants them."""
        return [
            f"{name} = {np.asarray(M).tolist()} must be symmetric and positive definite"
            for name, M in vars(self).items()
            if not positive_definite(M)
        ]

    def scaled(self, factor: float) -> "ImpedanceGains":
        """Return all gains times a factor."""
        return ImpedanceGains(**{name: factor * M for name, M in vars(self).items()})

    def law(self, body: FlyerBody) -> LinearController:
        """Return eq. (3.25) near the goal: commanded wrench on B from displacement and twist of G."""
        K: Floats = np.zeros((6, 6))
        D: Floats = np.zeros((6, 6))
        K[:3, :3], K[3:, 3:] = self.stiffness_translation, self.stiffness_rotation
        D[:3, :3], D[3:, 3:] = self.damping_translation, self.damping_rotation
        return without_memory(np.transpose(body.jacobian()) @ np.hstack([K, D]))


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
