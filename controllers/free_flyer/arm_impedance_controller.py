"""Impedance control of the gripper by base and arm together. [Fernandes2020] sec. 3.3.3, before it fixes the joints.

The law near rest, and the motions that the gripper ignores, come first; then the unit.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from handover.controllers.free_flyer.arm_model import ArmModel, Chain, OperationalSpace, mass_matrix
from handover.controllers.free_flyer.body import InvalidControllerParameters, stability_faults
from handover.controllers.free_flyer.flyer_controller import GainParams, GripperController
from handover.controllers.free_flyer.gains import ImpedanceGains, published_gains
from handover.controllers.free_flyer.ports import ARM, INERTIA, MASS, Behaviour, unit_quaternion
from handover.controllers.free_flyer.ports import Inputs as BaseInputs
from handover.controllers.free_flyer.ports import Outputs as BaseOutputs
from handover.controllers.free_flyer.sampled_loop import LinearController, LinearPlant, SampledLoop, without_memory
from handover.cosim.blocks.geometry import quaternion_of, rotation_of
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, derived, stated
from handover.cosim.blocks.plain_rotation import quaternion, rotation_vector
from handover.cosim.blocks.ports import Floats, Matrix3, Vector3, output, parameter, port
from handover.cosim.blocks.units import (
    Kilogram,
    KilogramMetre2,
    Metre,
    NewtonMetre,
    NewtonMetreSecondPerRadian,
    Number,
    Radian,
    RadianPerSecond,
    Second,
)


@dataclass(frozen=True, kw_only=True)
class _NullMotion:
    """How the joints go back to their posture while the gripper stays: frequency, rad/s, and damping ratio."""

    frequency: float
    damping_ratio: float

    @property
    def rate(self) -> float:
        """Damping over inertia, 1/s."""
        return 2.0 * self.damping_ratio * self.frequency

    def scaled(self, factor: float) -> "_NullMotion":
        """Return spring and damper times a factor."""
        root = factor**0.5
        return _NullMotion(frequency=root * self.frequency, damping_ratio=root * self.damping_ratio)


class ArmAtRest:
    """Base and arm near rest in a posture, in the axes of B.

    Args:
        model: base and arm.
        q_J: angles of the posture, (n,), rad.
    """

    def __init__(self, model: ArmModel, q_J: Floats) -> None:
        chain = Chain(model, np.eye(3), np.zeros(3), q_J)
        self.J, self.B, self.R_BG = chain.jacobian(-1), mass_matrix(chain), chain.R[-1]
        self.space = OperationalSpace.of(self.J, self.B)

    def linear_plant(self, lag: float) -> LinearPlant:
        """Return the robot near rest, the base's wrench behind a propulsion of first order, the joints' torques not.

        States: displacement (6 + n, in m and rad), its rate, thrust (6, if lag > 0). Inputs: commanded wrench on B with
        torques on the joints, external wrench on G. Outputs: displacement and its rate.

        Args:
            lag: time constant of the propulsion, s; 0 if thrust follows its command without delay.
        """
        n = len(self.B)
        inverse: Floats = np.linalg.inv(self.B).astype(np.float64)
        A, E = np.zeros((2 * n, 2 * n)), np.zeros((2 * n, 6))
        A[:n, n:], E[n:] = np.eye(n), inverse @ np.transpose(self.J)
        B: Floats = np.vstack([np.zeros((n, n)), inverse])
        C = np.eye(2 * n)
        if lag == 0.0:
            return LinearPlant(A=A, B=B, E=E, C=C)
        thrust = np.vstack([np.eye(6) / lag, np.zeros((n - 6, 6))])
        torques: Floats = np.hstack([np.zeros((2 * n, 6)), B[:, 6:]])
        return LinearPlant(
            A=np.block([[A, B[:, :6]], [np.zeros((6, 2 * n)), -np.eye(6) / lag]]),
            B=np.vstack([torques, np.transpose(thrust)]),
            E=np.vstack([E, np.zeros((6, 6))]),
            C=np.hstack([C, np.zeros((2 * n, 6))]),
        )

    def law(self, gains: ImpedanceGains, null: _NullMotion) -> LinearController:
        """Return the law of `ArmImpedanceController` near rest: commanded forces from displacement and its rate."""
        J, B, Z, n = self.J, self.B, self.space.Z, len(self.B)
        K, D = (_in_axes(self.R_BG, gain) for gain in (gains.stiffness(), gains.damping()))
        angles = np.hstack([np.zeros((n - 6, 6)), np.eye(n - 6)])
        rates = np.linalg.solve(self.space.inertia, np.transpose(Z) @ B)
        return without_memory(
            np.hstack(
                [
                    np.transpose(J) @ K @ J + null.frequency**2 * B @ Z @ angles,
                    np.transpose(J) @ D @ J + null.rate * B @ Z @ rates,
                ]
            )
        )


def _in_axes(R: Floats, gain: Floats) -> Floats:
    """Return a gain (6, 6) of translation and rotation whose axes R (3, 3) turns."""
    turned = np.kron(np.eye(2), R)
    return turned @ gain @ np.transpose(turned)


_NAME = "ArmImpedanceController"


@dataclass(frozen=True, kw_only=True)
class Params(GainParams):
    """Gains of table 4.1 or custom ones, and what the robot knows of itself: NASA's values of Astrobee and its arm.

    The arm's second link is the distal one with the gripper; a third joint, where the gripper is, where the links'
    centres of mass are, and all that belongs to the motion that the gripper ignores are assumed.
    """

    behaviour: Behaviour = parameter(
        Behaviour.RIGID,
        "gains of [Fernandes2020] table 4.1 but rotational k_B, or CUSTOM for the four matrices below",
        origin=stated("table 4.1"),
    )
    rotational_damping: NewtonMetreSecondPerRadian = parameter(
        1.0,
        "rotational k_B unless CUSTOM: table 4.1's 5 of RIGID is unstable with light links",
        minimum=0.0,
        origin=assumed("table 4.1, compliant; the rigid setting's 5 is unstable with light links"),
    )
    damping_rotation: Matrix3[NewtonMetreSecondPerRadian] = parameter(
        np.eye(3), "CUSTOM: rotational k_B, in the goal's axes", origin=stated("table 4.1, compliant")
    )
    q_J_goal: Vector3[Radian] = parameter(
        np.zeros(3),
        "the joints' posture",
        minimum=-7.0,
        maximum=7.0,
        origin=assumed("the arm straight ahead, as the thesis fixes it"),
    )
    null_frequency: RadianPerSecond = parameter(
        0.5,
        "frequency with which the joints go back to their posture",
        minimum=0.01,
        maximum=100.0,
        origin=assumed("slow beside the gripper's motion, which it must not disturb"),
    )
    null_damping: Number = parameter(
        1.0, "damping ratio of that motion", minimum=0.0, maximum=100.0, origin=assumed("critical damping")
    )
    joints: int = parameter(
        2,
        "number of the arm's joints",
        minimum=0,
        maximum=3,
        origin=stated("Astrobee's perching arm"),
    )
    mass: Kilogram = parameter(
        MASS,
        "mass of the base",
        minimum=0.0,
        maximum=1e4,
        origin=stated("Astrobee; the thesis prints 10 kg (sec. 2.1.1)"),
    )
    I_B: Matrix3[KilogramMetre2] = parameter(
        INERTIA, "inertia of the base about its centre of mass, in B", origin=stated("Astrobee")
    )
    p_BG: Vector3[Metre] = parameter(
        ARM,
        "gripper with all angles zero, seen from B",
        minimum=-5.0,
        maximum=5.0,
        origin=assumed("not given: Astrobee's arm stretched out"),
    )
    axis_J: Matrix3[Number] = parameter(
        np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
        "axes of the joints, a row each, in B, of any length",
        origin=derived(
            "Astrobee's description of its perching arm: stretched out, the proximal joint tilts, the "
            "distal one pans; a third joint is assumed"
        ),
    )
    link: Matrix3[Metre] = parameter(
        np.array([[-0.10, 0.0, 0.0], [-0.08, 0.0, 0.0], [-0.04, 0.0, 0.0]]),
        "links, a row each, in B with all angles zero",
        origin=assumed(
            "Astrobee's description of its perching arm: the proximal link; from the distal joint to "
            "where the fingers hold, and a third link, assumed"
        ),
    )
    centre_L: Vector3[Number] = parameter(
        np.full(3, 0.5),
        "where along its link a link's centre of mass is",
        origin=assumed("not given: the middles of the links"),
    )
    mass_L: Vector3[Kilogram] = parameter(
        np.array([0.1623, 0.2178, 0.1145]),
        "masses of the links",
        origin=derived(
            "Astrobee's description of its perching arm: the proximal link, the distal one with the "
            "fingers, and the fingers alone for a third"
        ),
    )
    I_L: Matrix3[KilogramMetre2] = parameter(
        np.array([[0.02705] * 3, [0.013525] * 3, [0.01082] * 3]),
        "principal moments of the links, a row each",
        origin=derived("Astrobee's description of its perching arm: its links' moments of inertia, the fingers' added"),
    )
    rotor_J: Vector3[KilogramMetre2] = parameter(
        np.zeros(3),
        "inertia of the drives' rotors about the joints",
        origin=assumed("not given: the links' moments in Astrobee's description are large enough to have them"),
    )
    delay: Second = parameter(
        0.0,
        "expected time from a measurement to its commands' arrival at base and joints",
        minimum=0.0,
        maximum=0.2,
        origin=NOT_GIVEN,
    )
    lag: Second = parameter(
        0.02,
        "expected time constant of the propulsion (assumed)",
        minimum=0.0,
        maximum=2.0,
        origin=assumed("as the thrusters have it"),
    )

    def model(self) -> ArmModel:
        """Return the robot's model of itself."""
        lengths = np.linalg.norm(self.axis_J, axis=1, keepdims=True)
        return ArmModel(
            joints=self.joints,
            mass=self.mass,
            I_B=self.I_B,
            p_BG=self.p_BG,
            axes=self.axis_J / np.where(lengths > 0.0, lengths, 1.0),
            links=self.link,
            centres=self.centre_L,
            masses=self.mass_L,
            inertias=self.I_L,
            rotors=self.rotor_J,
        )

    @property
    def posture(self) -> Floats:
        """The angles to which the joints go back, (n,), rad."""
        return self.q_J_goal[: self.joints]

    def gains(self) -> ImpedanceGains:
        """Return the gains of the behaviour: m and H of table 4.1 are the whole robot's in its posture, in G's axes."""
        if self.behaviour is Behaviour.CUSTOM:
            return self.custom_gains()
        model = self.model()
        whole, R_BG = model.whole(self.posture), Chain(model, np.eye(3), np.zeros(3), self.posture).R[-1]
        seen: Floats = np.transpose(R_BG) @ whole.I_B @ R_BG
        gains = published_gains(self.behaviour, replace(whole, I_B=(seen + np.transpose(seen)) / 2.0))
        return replace(gains, damping_rotation=self.rotational_damping * np.eye(3))

    def null(self) -> _NullMotion:
        """Return how the joints go back to their posture."""
        return _NullMotion(frequency=self.null_frequency, damping_ratio=self.null_damping)


@dataclass(kw_only=True)
class Inputs(BaseInputs):
    """The navigation's estimate of the base, the joints' encoders, the gripper's goal, and whether to act."""

    q_J: Vector3[Radian] = port(np.zeros(3), "angles of the joints; beyond the last joint not used")
    v_J: Vector3[RadianPerSecond] = port(np.zeros(3), "speeds of the joints")


@dataclass(kw_only=True)
class Outputs(BaseOutputs):
    """Commands to base and joints, zero when not active; the gripper's error; the linearised loop's poles."""

    tau_J_cmd: Vector3[NewtonMetre] = output("commanded torques on the joints")


class ArmImpedanceController(GripperController[Inputs, Outputs]):
    """u = J^T (-k_B x' + k_D x~) + B Z (w_0^2 q~ - 2 zeta w_0 q_n'): eq. (3.25) with joints that move.

    x~ and x' are those of `ImpedanceController`, in the goal's axes. J is (6, 6 + n), so that n motions xi' = Z q_J'
    leave the gripper where it is: the joints turn and the base makes up for it. The second term is the dynamically
    consistent one, J B^-1 (B Z) = J Z = 0: it accelerates the joints without the gripper, whose motion is eq. (3.26)
    with B_x = (J B^-1 J^T)^-1 alone. q~ is the posture's error and q_n' = (Z^T B Z)^-1 Z^T B xi' the part of the motion
    that the gripper ignores. Without damping it would last for ever, and without a posture the base would stay where a
    push has left it. Of u = (f, tau, tau_J), with twists in W, the command is f and tau turned into B, and tau_J.

    At construction the loop near rest in the posture, with 12 + 2 n states (18 + 2 n with a lag), is closed as that of
    `ImpedanceController`. Rotational damping must suit the lightest of what turns with the gripper: with table 4.1's
    rigid gains and Astrobee's arm the loop is not stable at this rate.

    Raises:
        InvalidControllerParameters: by the constructor, for an impossible robot, gains that are not positive definite,
            or a loop that is not stable.
        InvalidOrientation: a quaternion is zero or not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **dict.fromkeys(
            ("f_cmd", "tau_cmd", "tau_J_cmd"),
            ("p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas", "q_J", "v_J", "p_WG_goal", "q_WG_goal", "active"),
        ),
        "error_p": ("p_WB_meas", "q_WB_meas", "q_J", "p_WG_goal"),
        "error_R": ("q_WB_meas", "q_J", "q_WG_goal"),
    }

    def __init__(self, params: Params) -> None:
        model, period = params.model(), float(self.period)
        if faults := model.faults():
            raise InvalidControllerParameters(_NAME, faults)
        rest, gains, null = ArmAtRest(model, params.posture), params.gains(), params.null()
        faults = gains.faults() or stability_faults(
            rest,
            lambda factor, _: rest.law(gains.scaled(factor), null.scaled(factor)),
            period,
            params.delay,
            params.lag,
        )
        if faults:
            raise InvalidControllerParameters(_NAME, faults)
        loop = SampledLoop(rest.linear_plant(params.lag), rest.law(gains, null), period, params.delay)
        self._loop_figures = loop.figures
        self._model, self._gains, self._null, self._posture = model, gains, null, params.posture

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command for the measurements of t, which holds until t + dt."""
        n = self._model.joints
        R_WB = rotation_of(np.array(unit_quaternion(u.q_WB_meas, _NAME, "q_WB_meas")))
        R_WD = rotation_of(np.array(unit_quaternion(u.q_WG_goal, _NAME, "q_WG_goal")))
        chain = Chain(self._model, R_WB, u.w_WB_meas, u.q_J[:n])
        e = u.p_WG_goal - u.p_WB_meas - chain.p[-1]
        phi = np.array(rotation_vector(quaternion(quaternion_of(np.transpose(R_WD) @ chain.R[-1]))))
        tau_J, f, tau = np.zeros(3), np.zeros(3), np.zeros(3)
        if u.active:
            xi_dot = np.concatenate([u.v_WB_meas, u.w_WB_meas, u.v_J[:n]])
            forces = self._forces(chain, R_WD, e, phi, xi_dot, u.q_J[:n])
            f, tau, tau_J[:n] = np.transpose(R_WB) @ forces[:3], np.transpose(R_WB) @ forces[3:6], forces[6:]
        return Outputs(
            f_cmd=f,
            tau_cmd=tau,
            tau_J_cmd=tau_J,
            error_p=float(np.linalg.norm(e)),
            error_R=float(np.linalg.norm(phi)),
            **self._loop_figures,
        )

    def _forces(self, chain: Chain, R_WD: Floats, e: Floats, phi: Floats, xi_dot: Floats, q_J: Floats) -> Floats:
        """Return u, (6 + n,), for the gripper's errors e in W and phi in D."""
        J, g, null = chain.jacobian(-1), self._gains, self._null
        x_dot = J @ xi_dot
        v_D, w_D, e_D = np.transpose(R_WD) @ x_dot[:3], np.transpose(R_WD) @ x_dot[3:], np.transpose(R_WD) @ e
        f = R_WD @ (g.stiffness_translation @ e_D - g.damping_translation @ v_D)
        tau = -R_WD @ (g.stiffness_rotation @ phi + g.damping_rotation @ w_D)
        u = np.transpose(J) @ np.concatenate([f, tau])
        if len(q_J) == 0:
            return u
        B = mass_matrix(chain)
        space = OperationalSpace.of(J, B)
        momentum = B @ space.Z
        unnoticed = np.linalg.solve(space.inertia, np.transpose(momentum) @ xi_dot)
        return u + momentum @ (null.frequency**2 * (self._posture - q_J) - null.rate * unnoticed)
