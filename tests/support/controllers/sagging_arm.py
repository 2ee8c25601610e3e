"""An arm that sags, and a visual servo that leads it: it bends by 0.55 of the command, and a little by itself."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from handover.controllers.helix.servo.constant_curvature import forward_kinematics, state_of
from handover.controllers.helix.servo.visual_servo import Inputs, Outputs, Phase, VisualServo
from handover.cosim.blocks.ports import Floats

W_FROM_B = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
Q_CALIB = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])
COVARIANCE = 1e-7 * np.eye(3)
Edit = Callable[[float, Inputs], Inputs]


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

    def measured(self, p_WO: Floats, noise: float = 0.002) -> Inputs:
        wrist, gripper = self.pose()[:3], self.pose()[3:]
        p_O, p_R, p_G = (self.rng.normal(p, noise) for p in (p_WO, wrist, gripper))
        covariances = {"cov_O": COVARIANCE, "cov_R": COVARIANCE, "cov_G": COVARIANCE}
        return Inputs(p_WO_meas=p_O, p_WR_meas=p_R, p_WG_meas=p_G, **covariances, seen_O=True, seen_R=True)


def unchanged(_t: float, u: Inputs) -> Inputs:
    return u


@dataclass
class Loop:
    """Servo and arm, stepped together; `given` holds what the servo measures and `history` what it commands."""

    servo: VisualServo
    dt: float
    noise: float
    arm: SaggingArm = field(default_factory=SaggingArm)
    given: list[Inputs] = field(default_factory=list[Inputs])
    history: list[Outputs] = field(default_factory=list[Outputs])

    @property
    def t(self) -> float:
        return len(self.history) * self.dt

    def step(self, p_WO: Floats, edit: Edit = unchanged) -> Outputs:
        self.given.append(edit(self.t, self.arm.measured(p_WO, self.noise)))
        y = self.servo.step(self.t, self.dt, self.given[-1])
        self.arm.follow(state_of(y.dl_t + np.repeat([0.12, 0.24, 0.24], 3), 0.035), self.dt)
        self.history.append(y)
        return y

    def run(
        self, until: Phase, ball: Floats | Callable[[float], Floats], seconds: float = 200.0, edit: Edit = unchanged
    ) -> Outputs:
        """Go on until a phase begins, or for a time."""
        for _ in range(round(seconds / self.dt)):
            if self.step(ball(self.t) if callable(ball) else ball, edit).phase is until:
                break
        return self.history[-1]

    def phases(self) -> list[Phase]:
        return [y.phase for y in self.history]

    def miss(self, p_WO: Floats) -> float:
        return float(np.linalg.norm(self.arm.pose()[3:] - p_WO))
