"""Admittance control of a free-flyer's gripper, without a force sensor. [Fernandes2020] secs. 2.2.4 and 6.3.

A `VirtualBody` on a spring and a damper is displaced by the wrench that is felt; the controller follows it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from handover.controllers.free_flyer import impedance_controller, ports
from handover.controllers.free_flyer.body import FlyerBody, InvalidControllerParameters, stability_faults
from handover.controllers.free_flyer.flyer_controller import GripperController, LimitParams
from handover.controllers.free_flyer.gains import ImpedanceGains, PidGains
from handover.controllers.free_flyer.ports import Behaviour, Inputs, unit_quaternion
from handover.controllers.free_flyer.sampled_loop import LinearController, SampledLoop, discretised
from handover.controllers.free_flyer.wrench_observer import ThrustModel, WrenchObserver
from handover.cosim.blocks.origins import assumed
from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Matrix,
    Quaternion,
    Vector,
    add,
    cross,
    from_rotation_vector,
    inverse_rotate,
    multiply,
    norm,
    quaternion_multiply,
    relative_quaternion,
    rotate,
    rotation_matrix,
    rotation_vector,
    row_major,
    scale,
    subtract,
    vector,
)
from handover.cosim.blocks.ports import Floats, Vector3, output, parameter
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Newton, NewtonMetre, Number, PerSecond, PerSecond2

__all__ = ["AdmittanceController", "Behaviour", "Inputs", "InvalidControllerParameters", "Outputs", "Params"]


class VirtualBody:
    """k_M x'' + k_B x' + k_D x = F, the admittance of second order of eq. (2.17), sampled exactly with F held.

    x is the displacement from the goal: position, and rotation vector, whose rate is taken for the angular velocity, as
    it is where the body turns about one axis. All in the goal's axes, as (6,) or (6, n).

    Args:
        body: whose mass matrix k_M is a multiple of; the virtual one has its centre of mass in G.
        gains: stiffness k_D and damping k_B.
        ratio: virtual over real mass and inertia.
        period: for which F is held, s.
    """

    def __init__(self, body: FlyerBody, gains: ImpedanceGains, ratio: float, period: float) -> None:
        O, I = np.zeros((6, 6)), np.eye(6)
        inverse: Floats = np.linalg.inv(ratio * body.mass_matrix()).astype(np.float64)
        A = np.block([[O, I], [-inverse @ gains.stiffness(), -inverse @ gains.damping()]])
        self._A, self._B = discretised(A, np.vstack([O, inverse]), period)

    def moved(self, state: Floats, wrench: Floats) -> Floats:
        """Return displacement and twist, 12 rows, a period later."""
        return self._A @ state + self._B @ wrench


def _admittance_law(
    body: FlyerBody,
    virtual: VirtualBody,
    observer: WrenchObserver,
    thrust: ThrustModel,
    position: PidGains,
    attitude: PidGains,
    period: float,
) -> LinearController:
    """Return the law of `AdmittanceController` near the goal: commanded wrench on B from displacement and twist of G.

    Its state: the observer's memory (6), displacement and twist of the virtual body (12), thrust (6) and the commands
    that have not yet arrived (6 each). Each row block is followed as a linear function of state and measurement.
    """
    M, J = body.mass_matrix(), body.jacobian()
    base, to_gripper = np.linalg.inv(J), np.transpose(np.linalg.inv(J))
    P, D = (np.diag(np.repeat([getattr(position, k), getattr(attitude, k)], 3)) for k in ("k_P", "k_D"))
    sizes = [6, 12, 6] + [6] * thrust.remembered
    n = sum(sizes)
    memory, z, y, *rest = np.split(np.eye(n + 12), np.cumsum([*sizes, 6]))
    past, x_G, v_G = rest[:-2], rest[-2], rest[-1]
    momentum = M @ base @ v_G
    w = observer.estimate(memory, momentum)
    z_next = virtual.moved(z, to_gripper @ w)
    a = (z_next[6:] - z[6:]) / period
    u = M @ (base @ a + P @ base @ (z[:6] - x_G) + D @ base @ (z[6:] - v_G)) - w
    y_next, mean = thrust.over_period(y, [u, *past])
    waiting = [u, *past][: thrust.remembered]
    following = np.vstack([observer.following(memory, momentum, mean), z_next, y_next, *waiting])
    return LinearController(A=following[:, :n], B=following[:, n:], C=-u[:, :n], D=-u[:, n:])


_INNER_LOOP = assumed(
    "tracks a step of the virtual body's force in half a second, and leaves two thirds of the weakest thrust to it"
)


_NAME = "AdmittanceController"


@dataclass(frozen=True, kw_only=True)
class Params(impedance_controller.Params, LimitParams):
    """Stiffness and damping as of the impedance control, [Fernandes2020] table 4.1; what is added is assumed.

    The inner gains track a step of the virtual body's force in about half a second, and leave two thirds of the weakest
    thrust to it where the estimates have a noise of 1 mm and 1 mm/s.
    """

    inertia_ratio: Number = parameter(
        1.0,
        "virtual mass and inertia over the robot's own (assumed)",
        minimum=0.05,
        maximum=20.0,
        origin=assumed("the virtual body is as heavy as the robot"),
    )
    observer_rate: PerSecond = parameter(
        10.0,
        "at which the estimated wrench converges (assumed)",
        minimum=0.1,
        maximum=1000.0,
        origin=assumed("ten times as fast as the virtual body moves"),
    )
    k_x: PerSecond2 = parameter(
        9.0, "inner loop: acceleration per position error (assumed)", minimum=0.0, maximum=1e4, origin=_INNER_LOOP
    )
    k_v: PerSecond = parameter(
        6.0, "inner loop: acceleration per velocity error (assumed)", minimum=0.0, maximum=1e4, origin=_INNER_LOOP
    )
    k_R: PerSecond2 = parameter(
        16.0,
        "inner loop: angular acceleration per attitude error (assumed)",
        minimum=0.0,
        maximum=1e4,
        origin=_INNER_LOOP,
    )
    k_w: PerSecond = parameter(
        8.0, "inner loop: angular acceleration per rate error (assumed)", minimum=0.0, maximum=1e4, origin=_INNER_LOOP
    )

    def inner_gains(self, factor: float = 1.0) -> tuple[PidGains, PidGains]:
        """Return the inner loop's gains of position and attitude, times a factor."""
        return PidGains(k_P=factor * self.k_x, k_I=0.0, k_D=factor * self.k_v), PidGains(
            k_P=factor * self.k_R, k_I=0.0, k_D=factor * self.k_w
        )

    def virtual_body(self, period: float) -> VirtualBody:
        """Return what the wrench on the gripper moves, for a period between two samples, s."""
        return VirtualBody(self.body(), self.gains(), self.inertia_ratio, period)

    def law(self, factor: float, delay: float, T: float) -> LinearController:
        """Return the law near the goal at a period T, with inner gains and observer rate times a factor."""
        observer, thrust = WrenchObserver(factor * self.observer_rate, T), ThrustModel(self.lag, delay, T)
        return _admittance_law(self.body(), self.virtual_body(T), observer, thrust, *self.inner_gains(factor), T)

    def faults(self, period: float) -> list[str]:
        """Return what is wrong with body, gains and the loop that is closed at a period, s."""
        position, attitude = self.inner_gains()
        faults = self.body().faults() + (self.gains().faults() if self.behaviour is Behaviour.CUSTOM else [])
        faults += position.faults("inner position gains") + attitude.faults("inner attitude gains")
        return faults or stability_faults(
            self.body(), lambda factor, delay: self.law(factor, delay, period), period, self.delay, self.lag
        )


@dataclass(kw_only=True)
class Outputs(ports.Outputs):
    """Besides: the wrench on the gripper as it is estimated, zero when not active."""

    f_G_est: Vector3[Newton] = output("estimated external force on the gripper, in the world")
    tau_G_est: Vector3[NewtonMetre] = output("estimated external torque about the gripper, in the world")


class AdmittanceController(GripperController[Inputs, Outputs]):
    """Moves a virtual mass on a spring and a damper by the wrench on the gripper, and lets the robot follow it.

    - The wrench is estimated (`WrenchObserver`) from the navigation's velocities and the controller's own commands,
      which the propulsion is expected to follow with `delay` and `lag` (`ThrustModel`). Limits are known, since
      commands are clipped to them, axis by axis. Thrust that is otherwise lost counts as a wrench from outside, and so
      does what a wrong mass makes of an acceleration.
    - With x_v the virtual body's displacement from the goal, k_M x_v'' + k_B x_v' + k_D x_v = F (`VirtualBody`): k_D
      and k_B of table 4.1 by behaviour, k_M = inertia_ratio times the robot's mass and inertia. The gripper's
      pose and the virtual one differ by what the observer has not estimated yet. Unlike under eq. (3.25), where the
      body behind the arm is felt, a force at G does not turn the gripper.
    - The base follows the pose that puts the gripper there: with e, phi its errors in W and B and f, tau the estimate,

        F = R_WB^T (m (k_x e + k_v e' + a_v) - f),  M = I_B (k_R phi + k_w phi' + dw_v) + w x I_B w - R_WB^T tau.

    On activation, and where the goal changes, the virtual body is at the gripper and moves with it.

    At construction the loop near the goal is closed at the period with python-control. It has observer, virtual body
    and the model of the propulsion, with the expected delay and lag but without limits.

    Raises:
        InvalidControllerParameters: by the constructor, for an impossible body, gains that are not positive definite,
            or a loop that is not stable.
        InvalidOrientation: a quaternion is zero or not finite.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "f_cmd": ("p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas", "p_WG_goal", "q_WG_goal", "active"),
        "tau_cmd": ("q_WB_meas", "v_WB_meas", "w_WB_meas", "p_WG_goal", "q_WG_goal", "active"),
        "error_p": ("p_WB_meas", "q_WB_meas", "p_WG_goal", "q_WG_goal"),
        "error_R": ("q_WB_meas", "q_WG_goal"),
        "f_G_est": ("v_WB_meas", "active"),
        "tau_G_est": ("q_WB_meas", "v_WB_meas", "w_WB_meas", "active"),
    }

    def __init__(self, params: Params) -> None:
        self._T = float(self.period)
        if faults := params.faults(self._T):
            raise InvalidControllerParameters(_NAME, faults)
        self.loop = SampledLoop(
            params.body().linear_plant(params.lag), params.law(1.0, params.delay, self._T), self._T, params.delay
        )
        self._loop_figures = self.loop.figures
        self._virtual, self._thrust_model = params.virtual_body(self._T), ThrustModel(params.lag, params.delay, self._T)
        self._observer = WrenchObserver(params.observer_rate, self._T)
        self._position, self._attitude = params.inner_gains()
        self._mass, self._I_B, self._p_BG = params.mass, row_major(params.I_B), vector(params.p_BG)
        self._limit = np.concatenate([params.f_max, params.tau_max])
        self._reset()

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command for the measurements of t, which holds until t + dt."""
        now = _seen(u, self._p_BG)
        command, w_G = np.zeros(6), np.zeros(6)
        if u.active:
            command, w_G = self._command(now, (u.p_WG_goal.tolist(), u.q_WG_goal.tolist()))
        elif self._memory is not None:
            self._reset()
        return Outputs(
            f_cmd=command[:3],
            tau_cmd=command[3:],
            error_p=norm(now.x),
            error_R=norm(now.phi),
            f_G_est=w_G[:3],
            tau_G_est=w_G[3:],
            **self._loop_figures,
        )

    def get_state(self) -> bytes:
        """Return observer, virtual body, its goal, thrust and the commands that have not yet arrived."""
        return pack_state((self._memory, self._goal, self._moved, self._thrust, self._commands))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this controller or of one with equal parameters."""
        self._memory, self._goal, self._moved, self._thrust, self._commands = unpack_state(state)

    def _reset(self) -> None:
        self._memory: Floats | None = None
        self._goal: tuple[list[float], list[float]] | None = None
        self._moved: Floats = np.zeros(12)
        self._thrust: Floats = np.zeros(6)
        self._commands: list[Floats] = [np.zeros(6)] * self._thrust_model.remembered

    def _command(self, now: "_Seen", goal: tuple[list[float], list[float]]) -> tuple[Floats, Floats]:
        """Return the clipped command, in B, and the estimated wrench on the gripper, in W; step observer and model."""
        turned = inverse_rotate(now.R_WB, now.w)
        momentum = np.array([*scale(self._mass, now.v), *rotate(now.R_WB, multiply(self._I_B, turned))])
        if self._memory is None:
            self._memory = self._observer.begun(momentum)
        if goal != self._goal:
            v_G = add(now.v, cross(now.w, now.r))
            there = (now.x, now.phi, inverse_rotate(now.R_WD, v_G), inverse_rotate(now.R_WD, now.w))
            self._goal, self._moved = goal, np.concatenate(there)
        felt = self._observer.estimate(self._memory, momentum)
        f, tau = vector(felt[:3]), vector(felt[3:])
        tau_G = subtract(tau, cross(now.r, f))
        on_virtual = np.array([*inverse_rotate(now.R_WD, f), *inverse_rotate(now.R_WD, tau_G)])
        moved = self._virtual.moved(self._moved, on_virtual)
        wanted = np.array([*self._force(now, moved, f), *self._torque(now, moved, tau)])
        command: Floats = np.clip(wanted, -self._limit, self._limit)
        given = [command, *self._commands]
        self._thrust, mean = self._thrust_model.over_period(self._thrust, given)
        in_W = np.array([*rotate(now.R_WB, vector(mean[:3])), *rotate(now.R_WB, vector(mean[3:]))])
        self._memory = self._observer.following(self._memory, momentum, in_W)
        self._moved, self._commands = moved, given[: self._thrust_model.remembered]
        return command, np.array([*f, *tau_G])

    def _force(self, now: "_Seen", moved: Floats, f: Vector) -> Vector:
        """Return the force, in B, by which the base follows the virtual body, whose next state is `moved`."""
        z, a = self._moved, (moved - self._moved) / self._T
        R_WV = rotation_matrix(quaternion_multiply(now.q_WD, from_rotation_vector(vector(z[3:6]))))
        r = rotate(R_WV, self._p_BG)
        v, w, a_G, dw = (rotate(now.R_WD, vector(part)) for part in (z[6:9], z[9:], a[6:9], a[9:]))
        x, away = rotate(now.R_WD, vector(z[:3])), rotate(now.R_WD, now.x)
        e = subtract(subtract(x, away), subtract(r, now.r))
        e_rate = subtract(subtract(v, cross(w, r)), now.v)
        a_B = subtract(a_G, add(cross(dw, r), cross(w, cross(w, r))))
        wanted = add(self._position.acceleration(e, ZERO, e_rate), a_B)
        return inverse_rotate(now.R_WB, subtract(scale(self._mass, wanted), f))

    def _torque(self, now: "_Seen", moved: Floats, tau: Vector) -> Vector:
        """Return the torque likewise."""
        z, a = self._moved, (moved - self._moved) / self._T
        q_WV = quaternion_multiply(now.q_WD, from_rotation_vector(vector(z[3:6])))
        phi, w = rotation_vector(relative_quaternion(now.q_WB, q_WV)), inverse_rotate(now.R_WB, now.w)
        w_V, dw_V = (inverse_rotate(now.R_WB, rotate(now.R_WD, vector(part))) for part in (z[9:], a[9:]))
        wanted = add(self._attitude.acceleration(phi, ZERO, subtract(w_V, w)), dw_V)
        gyroscopic = cross(w, multiply(self._I_B, w))
        return subtract(add(multiply(self._I_B, wanted), gyroscopic), inverse_rotate(now.R_WB, tau))


class _Seen(NamedTuple):
    """The estimate: orientations, arm r, velocities in W, and the gripper's displacement x, phi from the goal in D."""

    q_WB: Quaternion
    q_WD: Quaternion
    R_WB: Matrix
    R_WD: Matrix
    r: Vector
    v: Vector
    w: Vector
    x: Vector
    phi: Vector


def _seen(u: Inputs, p_BG: Vector) -> _Seen:
    q_WB, q_WD = unit_quaternion(u.q_WB_meas, _NAME, "q_WB_meas"), unit_quaternion(u.q_WG_goal, _NAME, "q_WG_goal")
    R_WB, R_WD = rotation_matrix(q_WB), rotation_matrix(q_WD)
    r = rotate(R_WB, p_BG)
    away = subtract(add(vector(u.p_WB_meas), r), vector(u.p_WG_goal))
    return _Seen(
        q_WB=q_WB,
        q_WD=q_WD,
        R_WB=R_WB,
        R_WD=R_WD,
        r=r,
        v=vector(u.v_WB_meas),
        w=vector(u.w_WB_meas),
        x=inverse_rotate(R_WD, away),
        phi=rotation_vector(relative_quaternion(q_WD, q_WB)),
    )
