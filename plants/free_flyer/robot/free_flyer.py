"""A free-flying robot in microgravity with an arm that is fixed or has joints, after [Fernandes2020] secs. 3.3, 4.1."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import assumed, derived, stated
from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Vector,
    add,
    add_cross,
    inverse_rotate,
    normalize,
    quaternion,
    rotate,
    rotation_matrix,
    vector,
)
from handover.cosim.blocks.ports import Matrix3, Vector3, Vector4, output, parameter, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import (
    Kilogram,
    KilogramMetre2,
    Metre,
    MetrePerSecond,
    Newton,
    NewtonMetre,
    Number,
    Radian,
    RadianPerSecond,
    Second,
)
from handover.plants.free_flyer.rigid_body import RigidBody, TurnsTooFast, inertia_faults, unit_faults
from handover.plants.free_flyer.robot.arm import JOINTS_MAX
from handover.plants.free_flyer.robot.arm_parameters import ArmParameters
from handover.plants.free_flyer.robot.articulated_body import ArticulatedBody
from handover.plants.free_flyer.robot.stopping_joints import Motion, StoppingJoints

_HALF_A_TURN = math.pi
_ROUNDING = 1e-9
"""Seconds by which a step may begin before the time that it should."""


class InvalidFlyerParameters(InvalidParameters):
    """Parameters that no rigid body has; `faults` lists all of them."""

    block = "FreeFlyer"


@dataclass(frozen=True, kw_only=True)
class BodyParameters:
    """The robot, or with an arm that has joints its base, and where it starts.

    Mass and inertia are the published ones of NASA's Astrobee; the arm's length is assumed.
    """

    mass: Kilogram = parameter(
        9.584,
        "mass of the robot, with joints of its base",
        minimum=0.1,
        maximum=1000.0,
        origin=stated("Astrobee; the thesis prints 10 kg (sec. 2.1.1)"),
    )
    I_B: Matrix3[KilogramMetre2] = parameter(
        np.diag([0.1534, 0.1427, 0.1623]),
        "inertia about the centre of mass",
        minimum=-100.0,
        maximum=100.0,
        origin=stated("Astrobee"),
    )
    p_BG: Vector3[Metre] = parameter(
        np.array([-0.30, 0.0, 0.0]),
        "the gripper seen from the centre of mass, with all joints at zero",
        minimum=-5.0,
        maximum=5.0,
        origin=assumed("not given: Astrobee's arm stretched out"),
    )
    p_WB_0: Vector3[Metre] = parameter(
        np.array([0.30, -0.07, 0.0]),
        "position of the centre of mass at the start",
        origin=derived("sec. 4.1.3: the gripper at the handover place, with the arm as assumed"),
    )
    q_WB_0: Vector4[Number] = parameter(
        np.array([1.0, 0.0, 0.0, 0.0]), "orientation at the start, a unit quaternion", origin=stated("sec. 4.1.3")
    )
    v_WB_0: Vector3[MetrePerSecond] = parameter(
        np.zeros(3),
        "velocity at the start",
        minimum=-10.0,
        maximum=10.0,
        origin=derived("sec. 4.1.3: the initial state is the desired one, at rest"),
    )
    w_WB_0: Vector3[RadianPerSecond] = parameter(
        np.zeros(3),
        "angular velocity at the start, in the world",
        minimum=-100.0,
        maximum=100.0,
        origin=derived("sec. 4.1.3: the initial state is the desired one, at rest"),
    )
    substep: Second = parameter(
        0.016,
        "longest step of the integration",
        minimum=1e-5,
        maximum=0.1,
        origin=assumed("numerical: with `turn`, energy is kept to 1e-9 over 100 s of tumbling"),
    )
    turn: Radian = parameter(
        0.004,
        "largest turn in a step of the integration",
        minimum=1e-4,
        maximum=1.0,
        origin=assumed("numerical: see `substep`"),
    )


@dataclass(frozen=True, kw_only=True)
class Params(ArmParameters, BodyParameters):
    """The robot, where it starts, and its arm."""

    def check(self) -> None:
        """Raise InvalidFlyerParameters, with all faults, if no rigid body or no arm has these values."""
        faults = inertia_faults(self.mass, self.I_B) + unit_faults("q_WB_0", self.q_WB_0) + self.arm_faults()
        if faults:
            raise InvalidFlyerParameters(faults)


@dataclass(kw_only=True)
class Inputs:
    """What pushes the robot."""

    f_B: Vector3[Newton] = port(np.zeros(3), "force of the propulsion at the centre of mass, in the robot's frame")
    tau_B: Vector3[NewtonMetre] = port(np.zeros(3), "torque of the propulsion, in the robot's frame")
    f_G: Vector3[Newton] = port(np.zeros(3), "force on the gripper, acting at G, in the world")
    tau_G: Vector3[NewtonMetre] = port(np.zeros(3), "torque on the gripper, in the world")
    f_P: Vector3[Newton] = port(np.zeros(3), "force of a person's push on the robot, or its base, in the world")
    p_BP: Vector3[Metre] = port(
        np.zeros(3), "where it acts, seen from B in the robot's frame", minimum=-5.0, maximum=5.0
    )
    f_Q: Vector3[Newton] = port(np.zeros(3), "force of a person's push on the gripper, in the world")
    p_GQ: Vector3[Metre] = port(
        np.zeros(3), "where it acts, seen from G in the gripper's frame", minimum=-5.0, maximum=5.0
    )
    tau_J: Vector3[NewtonMetre] = port(np.zeros(3), "torques on the joints; beyond the last joint not used")


@dataclass(kw_only=True)
class Outputs:
    """Where the robot is and how it moves, in the world."""

    p_WB: Vector3[Metre] = output("position of the centre of mass, with joints of the base's")
    q_WB: Vector4[Number] = output("orientation")
    v_WB: Vector3[MetrePerSecond] = output("velocity of that centre of mass")
    w_WB: Vector3[RadianPerSecond] = output("angular velocity")
    p_WG: Vector3[Metre] = output("position of the gripper")
    q_WG: Vector4[Number] = output("orientation of the gripper, without joints the robot's own")
    v_WG: Vector3[MetrePerSecond] = output("velocity of the gripper")
    w_WG: Vector3[RadianPerSecond] = output("angular velocity of the gripper")
    q_J: Vector3[Radian] = output("angles of the joints, zero beyond the last")
    v_J: Vector3[RadianPerSecond] = output("speeds of the joints")


class FreeFlyer:
    """Moves as one rigid body (`RigidBody`), or as a base with an arm of 1 to 3 joints (`StoppingJoints`).

    Without joints: m v' = R f_B + f_G, L' = R tau_B + (R p_BG) x f_G + tau_G, [Fernandes2020] eqs. (3.18)-(3.24) with
    eq. (4.1). With joints: eq. (3.23) as it is, C of base and arm in the place of B where their momenta are concerned;
    B stays at the base's centre of mass. In place of Euler angles both have a unit quaternion whose sign is continuous.
    During a step propulsion and a push are held in the robot's frame, and what acts on the gripper in the world. The
    joints' torques, of at most `torque_max_J`, are held, too. Steps are cut into equal parts of at most `substep`, in
    which base and joints turn by at most `turn`. A robot at rest needs few of them, and one that tumbles is followed as
    closely.

    A joint that reaches an end stop, or the tolerance of its drive, stops there without rebound; no momentum is made.
    With `tolerance_J` zero the joints are fixed, as in the thesis; at the first step from `lock_time` on they lock.

    Raises:
        InvalidFlyerParameters: by the constructor, for an inertia that no rigid body has, a quaternion that is not
            unit, or an arm that cannot be.
        TurnsTooFast: by `step`, where base and joints turn by more than half a turn in it.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("base", TerminalKind.MOTION, "p_WB", "q_WB", "v_WB", "w_WB"),
        terminal("gripper", TerminalKind.MOTION, "p_WG", "q_WG", "v_WG", "w_WG"),
        terminal("thrust", TerminalKind.WRENCH, "f_B", "tau_B"),
        terminal("contact", TerminalKind.WRENCH, "f_G", "tau_G"),
    )
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self._substep, self._turn, self._lock_time = params.substep, params.turn, params.lock_time
        self._torque_max = params.of_joints(params.torque_max_J)
        q = normalize(quaternion(np.asarray(params.q_WB_0)))
        p_BG, p_WB, v_WB, w_WB = (vector(a) for a in (params.p_BG, params.p_WB_0, params.v_WB_0, params.w_WB_0))
        if params.joints == 0:
            self._body: RigidBody | StoppingJoints = RigidBody(params.mass, params.I_B, p_BG, p_WB, q, v_WB, w_WB)
        else:
            body = ArticulatedBody(params.mass, params.I_B, params.arm(params.p_BG))
            angles = params.of_joints(params.q_J_0)
            self._body = StoppingJoints(body, params.limits(), angles, (p_WB, q), (v_WB, w_WB))
        self._w = self._body.w if isinstance(self._body, RigidBody) else ZERO  # of the last outputs, without joints

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where the robot is; no time passes."""
        return self._outputs()

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt with u held."""
        f_B, tau_B = vector(u.f_B), vector(u.tau_B)
        if u.f_P.any():
            f_B, tau_B = self._pushed(f_B, tau_B, u)
        f_G, tau_G = vector(u.f_G), vector(u.tau_G)
        if u.f_Q.any():
            f_G, tau_G = self._gripper_pushed(f_G, tau_G, u)
        wrench = f_B, tau_B, f_G, tau_G
        h = dt / (count := self._substeps(dt))
        if isinstance(self._body, RigidBody):
            advance = self._body.advance
            for _ in range(count):
                advance(h, *wrench)
            return self._outputs()
        if not self._body.locked and t >= self._lock_time - _ROUNDING:
            self._body.lock()
        asked = zip(u.tau_J.tolist(), self._torque_max, strict=False)
        tau_J = tuple(min(max(torque, -most), most) for torque, most in asked)
        for _ in range(count):
            self._body.advance(h, wrench, tau_J)
        return self._outputs()

    def _pushed(self, f_B: Vector, tau_B: Vector, u: Inputs) -> tuple[Vector, Vector]:
        """Return force and torque in B with those of a push: f_B + R^T f_P, tau_B + p_BP x R^T f_P."""
        b = self._body
        R_WB = rotation_matrix(b.q if isinstance(b, RigidBody) else b.motion().q_WB)
        f_P = inverse_rotate(R_WB, vector(u.f_P))
        return add(f_B, f_P), add_cross(tau_B, vector(u.p_BP), f_P)

    def _gripper_pushed(self, f_G: Vector, tau_G: Vector, u: Inputs) -> tuple[Vector, Vector]:
        """Return force and torque on the gripper with those of a push: f_G + f_Q, tau_G + (R_WG p_GQ) x f_Q."""
        b, f_Q = self._body, vector(u.f_Q)
        q_WG = b.q if isinstance(b, RigidBody) else b.motion().q_WG
        return add(f_G, f_Q), add_cross(tau_G, rotate(rotation_matrix(q_WG), vector(u.p_GQ)), f_Q)

    def get_state(self) -> bytes:
        """Return the complete state."""
        b = self._body
        return pack_state((b.p, b.q, b.v, b.spin) if isinstance(b, RigidBody) else (b.state, b.still, b.locked))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this robot or of one with equal parameters."""
        b = self._body
        if isinstance(b, RigidBody):
            b.p, b.q, b.v, b.spin = unpack_state(state)
            self._w = b.w
        else:
            b.state, b.still, b.locked = unpack_state(state)

    def _substeps(self, dt: float) -> int:
        b = self._body
        rate = math.hypot(*self._w) if isinstance(b, RigidBody) else b.rate
        if not rate * dt < _HALF_A_TURN:
            raise TurnsTooFast(rate, dt)
        return max(1, math.ceil(dt / self._substep - 1e-6), math.ceil(rate * dt / self._turn))

    def _outputs(self) -> Outputs:
        """Return the outputs as pieces of one array, which costs less than an array each."""
        b = self._body
        if isinstance(b, StoppingJoints):
            return _outputs_with_joints(b.motion())
        R = rotation_matrix(b.q)
        w, r = b.angular_velocity(R), rotate(R, b.p_BG)
        self._w = w
        a = np.array([*b.p, *b.q, *b.v, *w, *add(b.p, r), *add_cross(b.v, w, r), *ZERO])
        return Outputs(
            p_WB=a[0:3],
            q_WB=a[3:7],
            v_WB=a[7:10],
            w_WB=a[10:13],
            p_WG=a[13:16],
            q_WG=a[3:7],
            v_WG=a[16:19],
            w_WG=a[10:13],
            q_J=a[19:22],
            v_J=a[19:22],
        )


def _outputs_with_joints(m: Motion) -> Outputs:
    idle = (0.0,) * (JOINTS_MAX - len(m.q_J))
    a = np.array([*m.p_WB, *m.q_WB, *m.v_WB, *m.w_WB, *m.p_WG, *m.q_WG, *m.v_WG, *m.w_WG, *m.q_J, *idle, *m.v_J, *idle])
    return Outputs(
        p_WB=a[0:3],
        q_WB=a[3:7],
        v_WB=a[7:10],
        w_WB=a[10:13],
        p_WG=a[13:16],
        q_WG=a[16:20],
        v_WG=a[20:23],
        w_WG=a[23:26],
        q_J=a[26:29],
        v_J=a[29:32],
    )
