"""A free-flying robot in microgravity whose arm is fixed: one rigid body, after [Fernandes2020] sec. 4.1."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.plain_rotation import (
    add,
    add_cross,
    quaternion,
    rotate,
    rotation_matrix,
    vector,
)
from handover.cosim.blocks.ports import Matrix3, Vector3, Vector4, output, parameter, port
from handover.cosim.blocks.state import pack_state, unpack_state
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

_HALF_A_TURN = math.pi


class InvalidFlyerParameters(InvalidParameters):
    """Parameters that no rigid body has; `faults` lists all of them."""

    block = "FreeFlyer"


@dataclass(frozen=True, kw_only=True)
class Params:
    """The robot, and where it starts.

    Mass and inertia are the published ones of NASA's Astrobee; the arm's length is assumed.
    """

    mass: Kilogram = parameter(9.584, "mass of the robot", minimum=0.1, maximum=1000.0)
    I_B: Matrix3[KilogramMetre2] = parameter(
        np.diag([0.1534, 0.1427, 0.1623]), "inertia about the centre of mass", minimum=-100.0, maximum=100.0
    )
    p_BG: Vector3[Metre] = parameter(
        np.array([-0.30, 0.0, 0.0]), "the gripper seen from the centre of mass", minimum=-5.0, maximum=5.0
    )
    p_WB_0: Vector3[Metre] = parameter(np.array([0.30, -0.07, 0.0]), "position of the centre of mass at the start")
    q_WB_0: Vector4[Number] = parameter(np.array([1.0, 0.0, 0.0, 0.0]), "orientation at the start, a unit quaternion")
    v_WB_0: Vector3[MetrePerSecond] = parameter(np.zeros(3), "velocity at the start", minimum=-10.0, maximum=10.0)
    w_WB_0: Vector3[RadianPerSecond] = parameter(
        np.zeros(3), "angular velocity at the start, in the world", minimum=-100.0, maximum=100.0
    )
    substep: Second = parameter(0.016, "longest step of the integration", minimum=1e-5, maximum=0.1)
    turn: Radian = parameter(0.004, "largest turn in a step of the integration", minimum=1e-4, maximum=1.0)

    def check(self) -> None:
        """Raise InvalidFlyerParameters, with all faults, if no rigid body has these values."""
        faults = inertia_faults(self.mass, self.I_B) + unit_faults("q_WB_0", self.q_WB_0)
        if faults:
            raise InvalidFlyerParameters(faults)


@dataclass(kw_only=True)
class Inputs:
    """What pushes the robot."""

    f_B: Vector3[Newton] = port(np.zeros(3), "force of the propulsion at the centre of mass, in the robot's frame")
    tau_B: Vector3[NewtonMetre] = port(np.zeros(3), "torque of the propulsion, in the robot's frame")
    f_G: Vector3[Newton] = port(np.zeros(3), "force on the gripper, acting at G, in the world")
    tau_G: Vector3[NewtonMetre] = port(np.zeros(3), "torque on the gripper, in the world")


@dataclass(kw_only=True)
class Outputs:
    """Where the robot is and how it moves, in the world."""

    p_WB: Vector3[Metre] = output("position of the centre of mass")
    q_WB: Vector4[Number] = output("orientation")
    v_WB: Vector3[MetrePerSecond] = output("velocity of the centre of mass")
    w_WB: Vector3[RadianPerSecond] = output("angular velocity")
    p_WG: Vector3[Metre] = output("position of the gripper")
    q_WG: Vector4[Number] = output("orientation of the gripper, the robot's own")
    v_WG: Vector3[MetrePerSecond] = output("velocity of the gripper")


class FreeFlyer:
    """Moves as one rigid body (`RigidBody`): m v' = R f_B + f_G, L' = R tau_B + (R p_BG) x f_G + tau_G.

    [Fernandes2020] eqs. (3.18)-(3.24) with the arm's joints fixed, eq. (4.1), in place of its Euler angles a unit
    quaternion whose sign is continuous. During a step the propulsion is held in the robot's frame and the wrench on the
    gripper in the world; steps are cut into equal parts of at most `substep`, in which the robot turns by at most
    `turn`: a robot at rest needs few of them, and one that tumbles is followed as closely.

    Raises:
        InvalidFlyerParameters: by the constructor, for an inertia that no rigid body has or a quaternion that is not
            unit.
        TurnsTooFast: by `step`, where the robot turns by more than half a turn in it.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self._substep, self._turn = params.substep, params.turn
        q = np.asarray(params.q_WB_0) / np.linalg.norm(params.q_WB_0)
        p_BG, p_WB, v_WB, w_WB = (vector(a) for a in (params.p_BG, params.p_WB_0, params.v_WB_0, params.w_WB_0))
        self._body = RigidBody(params.mass, params.I_B, p_BG, p_WB, quaternion(q), v_WB, w_WB)
        self._w = self._body.w

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return where the robot is; no time passes."""
        return self._outputs()

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Advance from t by dt with u held."""
        wrench = vector(u.f_B), vector(u.tau_B), vector(u.f_G), vector(u.tau_G)
        h = dt / (count := self._substeps(dt))
        advance = self._body.advance
        for _ in range(count):
            advance(h, *wrench)
        return self._outputs()

    def get_state(self) -> bytes:
        """Return the complete state."""
        b = self._body
        return pack_state((b.p, b.q, b.v, b.spin))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this robot or of one with equal parameters."""
        b = self._body
        b.p, b.q, b.v, b.spin = unpack_state(state)
        self._w = b.w

    def _substeps(self, dt: float) -> int:
        rate = math.hypot(*self._w)
        if not rate * dt < _HALF_A_TURN:
            raise TurnsTooFast(rate, dt)
        return max(1, math.ceil(dt / self._substep - 1e-6), math.ceil(rate * dt / self._turn))

    def _outputs(self) -> Outputs:
        """Return the outputs as pieces of one array, which costs less than an array each."""
        b = self._body
        R = rotation_matrix(b.q)
        w, r = b.angular_velocity(R), rotate(R, b.p_BG)
        self._w = w
        a = np.array([*b.p, *b.q, *b.v, *w, *add(b.p, r), *add_cross(b.v, w, r)])
        return Outputs(
            p_WB=a[0:3],
            q_WB=a[3:7],
            v_WB=a[7:10],
            w_WB=a[10:13],
            p_WG=a[13:16],
            q_WG=a[3:7],
            v_WG=a[16:19],
        )
