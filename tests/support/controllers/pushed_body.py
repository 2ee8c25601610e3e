"""A rigid body in fine steps, apart from the library's own, that a controller holds against a wrench on G."""

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from handover.controllers.free_flyer.ports import Inputs, Outputs
from handover.cosim.blocks.geometry import quaternion_of
from handover.cosim.blocks.ports import Floats

T = 0.016
MASS, INERTIA, ARM = 9.584, np.diag([0.1534, 0.1427, 0.1623]), np.array([-0.30, 0.0, 0.0])
GOAL = np.array([0.0, -0.07, 0.0])


class Controller(Protocol):
    """What takes an estimate and gives a command."""

    def step(self, t: float, dt: float, u: Inputs) -> Outputs: ...


def cross_matrix(v: Floats) -> Floats:
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def rotation_vector(R: Floats) -> Floats:
    return Rotation.from_matrix(R).as_rotvec()


@dataclass
class Body:
    """Where it is and how it moves; `turn` is R_WB, w in B."""

    p: Floats = field(default_factory=lambda: GOAL - ARM)
    turn: Floats = field(default_factory=lambda: np.eye(3))
    v: Floats = field(default_factory=lambda: np.zeros(3))
    w: Floats = field(default_factory=lambda: np.zeros(3))

    def push(self, f_B: Floats, tau_B: Floats, f_G: Floats, tau_G: Floats, dt: float, parts: int = 2) -> None:
        h = dt / parts
        for _ in range(parts):
            torque = tau_B + np.transpose(self.turn) @ tau_G + cross_matrix(ARM) @ (np.transpose(self.turn) @ f_G)
            a = (self.turn @ f_B + f_G) / MASS
            dw = (torque - np.cross(self.w, INERTIA @ self.w)) / INERTIA.diagonal()
            self.p = self.p + h * self.v + h * h / 2.0 * a
            self.v = self.v + h * a
            self.turn = self.turn @ Rotation.from_rotvec(h * self.w + h * h / 2.0 * dw).as_matrix()
            self.w = self.w + h * dw

    def measured(self) -> Inputs:
        return Inputs(
            p_WB_meas=self.p,
            q_WB_meas=quaternion_of(self.turn),
            v_WB_meas=self.v,
            w_WB_meas=self.turn @ self.w,
            p_WG_goal=GOAL,
            active=True,
        )

    def displacement(self) -> Floats:
        return np.concatenate([self.p + self.turn @ ARM - GOAL, rotation_vector(self.turn)])


def pushed(controller: Controller, wrench: Floats, delay: int = 0) -> Floats:
    """Displacement of the gripper, position and rotation vector, at the beginning of each step of a wrench on it."""
    body, queue, path = Body(), [(np.zeros(3), np.zeros(3))] * delay, list[Floats]()
    for n, d in enumerate(wrench):
        path.append(body.displacement())
        y = controller.step(n * T, T, body.measured())
        queue.append((y.f_cmd, y.tau_cmd))
        f, tau = queue.pop(0)
        body.push(f, tau, d[:3], d[3:], T)
    return np.array(path)
