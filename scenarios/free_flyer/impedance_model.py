"""The error that the impedance model calls for, from the motion that took place. [Fernandes2020] eqs. (3.26), (4.4)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.behaviour import Behaviour

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

MOTION_SIGNALS = ("robot.p_WG", "robot.v_WG", "robot.q_WB", "robot.w_WB", "push.f_G", "push.tau_G")
"""Signals of a push that make up a `Motion`, in the order of its fields after time."""


@dataclass(frozen=True)
class Motion:
    """What was seen at communication points, one row each, in W and SI units; quaternions scalar first.

    The wrench `f_G`, `tau_G` of a row acted on the gripper from the row before until this one.
    """

    t: Floats
    p_WG: Floats
    v_WG: Floats
    q_WB: Floats
    w_WB: Floats
    f_G: Floats
    tau_G: Floats

    @classmethod
    def of(cls, rows: Sequence[Sequence[Any]]) -> "Motion":
        """Return the motion that rows of the fields' values make up."""
        return cls(*(np.array(column) for column in zip(*rows, strict=True)))


@dataclass(frozen=True)
class Errors:
    """Errors of the gripper's pose, rest minus actual, one row for the beginning of each step.

    Attributes:
        t: time, s.
        p, p_model: position error as it was and as the model calls for, shape (rows, 3), in W, m.
        R, R_model: orientation error likewise, as a rotation vector in W, rad; whole turns more or less do not count.
    """

    t: Floats
    p: Floats
    p_model: Floats
    R: Floats
    R_model: Floats

    @property
    def disagreement(self) -> tuple[float, float]:
        """Greatest difference along any axis, m and rad; of orientations, the turn from one to the other."""
        from scipy.spatial.transform import Rotation  # long to load, and used when a run has ended

        apart = Rotation.from_rotvec(-self.R) * Rotation.from_rotvec(self.R_model)
        turn: Floats = np.array(apart.as_rotvec())
        return float(np.max(np.abs(self.p - self.p_model))), float(np.max(np.abs(turn)))

    @property
    def without_jumps(self) -> tuple[Floats, Floats]:
        """R, and of the rotation vectors that mean R_model the ones nearest to R; not a number where they turn over."""
        both = np.array(self.R), _nearest(self.R_model, self.R)
        for turns in both:
            turns[1:][np.linalg.norm(np.diff(turns, axis=0), axis=1) > np.pi] = np.nan
        return both


def errors_of(motion: Motion, p_WG_goal: Floats, behaviour: Behaviour) -> Errors:
    """Return the errors by eq. (4.4), k_D xt' = B_x x'' + (C_x + k_B) x' - f_ext, with rest at no rotation.

    Velocities are twists, so B_x x'' + C_x x' - f_ext is the propulsion's wrench, taken at the gripper: what changes
    the body's momentum, less the push. It is got as the mean over a step, in which the push counts by its impulse. All
    else is of the instant at which the step begins, as for the controller; since thrust is held in the robot's frame,
    the mean is turned back by half the step's turn.
    """
    from scipy.spatial.transform import Rotation

    body = paper_values("free_flyer", "robot")
    gains = paper_values("free_flyer", f"gains_{behaviour.item}")
    m: float = body["mass"]
    I_B: Floats = np.array(body["I_B"])
    R_WB = Rotation.from_quat(motion.q_WB, scalar_first=True)
    r_W: Floats = R_WB.apply(np.array(body["p_BG"]))
    force, torque = _propulsion(motion, R_WB, r_W, m, I_B)
    v, w = motion.v_WG[:-1], motion.w_WB[:-1]
    torque_G: Floats = torque - np.cross(r_W[:-1], force) + gains["k_B_rotational"] * w
    softness_R: Floats = np.linalg.inv(I_B) / gains["k_D_rotational"]
    return Errors(
        t=motion.t[:-1],
        p=p_WG_goal - motion.p_WG[:-1],
        p_model=(force + gains["k_B_linear"] * v) / (gains["k_D_linear"] * m),
        R=-R_WB[:-1].as_rotvec(),
        R_model=_times(softness_R, torque_G),
    )


def _propulsion(motion: Motion, R_WB: "Rotation", r_W: Floats, m: float, I_B: Floats) -> tuple[Floats, Floats]:
    """Return force, and torque about B, of the propulsion in W at the beginning of each step."""
    from scipy.spatial.transform import Rotation

    dt = np.diff(motion.t)[:, np.newaxis]
    v_WB = motion.v_WG - np.cross(motion.w_WB, r_W)
    w_B: Floats = R_WB.apply(motion.w_WB, inverse=True)
    L_W: Floats = R_WB.apply(_times(I_B, w_B))
    f_G = motion.f_G[1:]
    force: Floats = m * np.diff(v_WB, axis=0) / dt - f_G
    torque: Floats = np.diff(L_W, axis=0) / dt - np.cross((r_W[:-1] + r_W[1:]) / 2, f_G) - motion.tau_G[1:]
    half_turn = Rotation.from_rotvec((motion.w_WB[:-1] + motion.w_WB[1:]) * dt / 4)
    return half_turn.apply(force, inverse=True), half_turn.apply(torque, inverse=True)


def _nearest(turns: Floats, to: Floats) -> Floats:
    """Return vectors of the same rotations, whole turns more or less about their own axes, nearest to others."""
    angle = np.linalg.norm(turns, axis=1, keepdims=True)
    axis = turns / np.maximum(angle, 1e-12)
    whole: Floats = np.rint((np.sum(axis * to, axis=1, keepdims=True) - angle) / (2 * np.pi))
    return turns + 2 * np.pi * whole * axis


def _times(M: Floats, v: Floats) -> Floats:
    """Return M v for each row of v."""
    return v @ np.transpose(M)
