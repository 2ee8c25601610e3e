"""An arm that sags, for tests of the visual servo: it bends by 0.55 of the command, and a little by itself."""

import math

import numpy as np

from handover.controllers.helix.servo.constant_curvature import forward_kinematics
from handover.controllers.helix.servo.visual_servo import Inputs
from handover.cosim.blocks.ports import Floats

W_FROM_B = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
Q_CALIB = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])


def ball_at(degrees: float, reach: float = 0.18) -> Floats:
    angle = math.radians(degrees)
    return np.array([reach * math.cos(angle), reach * math.sin(angle), -0.6])


class SaggingArm:
    def __init__(self, seed: int = 0, lag: float = 0.5) -> None:
        self.rng, self.lag = np.random.default_rng(seed), lag
        self.own_bend = self.rng.normal(0.0, 0.03, (3, 2))
        self.q: Floats = self.rest(Q_CALIB)

    def rest(self, q_sys: Floats) -> Floats:
        segments = q_sys.reshape(3, 3)
        return np.column_stack(
            [0.55 * segments[:, :2] + self.own_bend, segments[:, 2] * np.array([1.01, 1.02, 1.02])]
        ).reshape(9)

    def follow(self, q_sys: Floats, dt: float) -> None:
        self.q = self.q + (1.0 - math.exp(-dt / self.lag)) * (self.rest(q_sys) - self.q)

    def pose(self) -> Floats:
        return W_FROM_B * forward_kinematics(self.q, 0.10)

    def measured(self, p_WO: Floats, noise: float = 0.002, seen: bool = True) -> Inputs:
        wrist, gripper = self.pose()[:3], self.pose()[3:]
        p_O, p_R, p_G = (self.rng.normal(p, noise) for p in (p_WO, wrist, gripper))
        return Inputs(p_WO_meas=p_O, p_WR_meas=p_R, p_WG_meas=p_G, seen_O=seen, seen_R=seen)
