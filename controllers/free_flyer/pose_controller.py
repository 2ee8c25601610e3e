"""Pose control of a free-flyer's gripper, by a PID along a trajectory. [Fernandes2020] sec. 3.1.1 and 4.1.2.

The trajectory is of minimum jerk, within bounds of speed and acceleration.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from handover.controllers.free_flyer.body import InvalidControllerParameters, stability_faults
from handover.controllers.free_flyer.flyer_controller import GripperController, LimitParams, RobotParams
from handover.controllers.free_flyer.gains import PidGains, pid_law
from handover.controllers.free_flyer.ports import (
    Inputs,
    Outputs,
    unit_quaternion,
)
from handover.controllers.free_flyer.sampled_loop import SampledLoop
from handover.cosim.blocks.origins import assumed, stated
from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Matrix,
    Quaternion,
    Vector,
    add,
    add_scaled,
    angle_between,
    clip,
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
from handover.cosim.blocks.ports import parameter
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import (
    MetrePerSecond,
    MetrePerSecond2,
    PerSecond,
    PerSecond2,
    PerSecond3,
    RadianPerSecond,
    RadianPerSecond2,
)

__all__ = ["Inputs", "InvalidControllerParameters", "Outputs", "Params", "PoseController"]

_PEAK_SPEED = 1.875  # of s(x) = 10 x^3 - 15 x^4 + 6 x^5, from 0 to 1 in unit time
_PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)
_PEAK_BRAKING = 3.94  # of h(x) = x - 6 x^3 + 8 x^4 - 3 x^5, which begins with unit speed and ends where it began


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Largest speed and acceleration of the trajectory's translation (m/s, m/s2) and rotation (rad/s, rad/s2)."""

    speed: float
    acceleration: float
    rate: float
    turning: float


class Reference(NamedTuple):
    """Where the base is to be: position, velocity, acceleration in W, attitude, rate, its derivative in W."""

    p: Vector
    v: Vector
    a: Vector
    q: Quaternion
    w: Vector
    dw: Vector


@dataclass(frozen=True, kw_only=True)
class Profile:
    """A straight line and a turn about one axis, both of minimum jerk, over the same time.

    p(t) = p_0 + s(t/T) d + h(t/T) T v_0 and q(t) = q_0 exp(s(t/T) phi), with v_0 the velocity at the beginning: the
    line bends while that is braked. T is the shortest with which every bound holds, but that on speed only as far as
    v_0 itself keeps it: there the two parts' peaks are added. phi is in q_0's axes, phi_W the same turn in W.
    """

    p_0: Vector
    d: Vector
    v_0: Vector
    q_0: Quaternion
    phi: Vector
    phi_W: Vector
    T: float

    def at(self, t: float) -> Reference:
        """Return the reference a time t after the beginning; at rest at the goal from T on."""
        T = self.T
        x = min(max(t / T, 0.0), 1.0) if T > 0.0 else 1.0
        y = 1.0 - x
        s = x * x * x * (10.0 + x * (-15.0 + 6.0 * x))
        if x == 1.0:
            q = quaternion_multiply(self.q_0, from_rotation_vector(self.phi))
            return Reference(p=add(self.p_0, self.d), v=ZERO, a=ZERO, q=q, w=ZERO, dw=ZERO)
        ds, dds = 30.0 * x * x * y * y / T, 60.0 * x * y * (1.0 - x - x) / (T * T)
        h = T * x * (1.0 + x * x * (-6.0 + x * (8.0 - 3.0 * x)))
        dh, ddh = 1.0 + x * x * (-18.0 + x * (32.0 - 15.0 * x)), x * (-36.0 + x * (96.0 - 60.0 * x)) / T
        d, v_0, phi_W = self.d, self.v_0, self.phi_W
        return Reference(
            p=add_scaled(add_scaled(self.p_0, s, d), h, v_0),
            v=add_scaled(scale(ds, d), dh, v_0),
            a=add_scaled(scale(dds, d), ddh, v_0),
            q=quaternion_multiply(self.q_0, from_rotation_vector(scale(s, self.phi))),
            w=scale(ds, phi_W),
            dw=scale(dds, phi_W),
        )


def profile_between(p_0: Vector, v_0: Vector, q_0: Quaternion, p_1: Vector, q_1: Quaternion, bounds: Bounds) -> Profile:
    """Return the trajectory from one pose, with a velocity, to rest at another."""
    d = subtract(p_1, p_0)
    phi = rotation_vector(relative_quaternion(q_0, q_1))
    length, angle, speed = norm(d), norm(phi), norm(v_0)
    braking = _PEAK_BRAKING * speed
    return Profile(
        p_0=p_0,
        d=d,
        v_0=v_0,
        q_0=q_0,
        phi=phi,
        phi_W=rotate(rotation_matrix(q_0), phi),
        T=max(
            _PEAK_SPEED * length / max(bounds.speed - speed, bounds.speed / 2.0),
            (braking + math.sqrt(braking**2 + 4.0 * bounds.acceleration * _PEAK_ACCELERATION * length))
            / (2.0 * bounds.acceleration),
            _PEAK_SPEED * angle / bounds.rate,
            math.sqrt(_PEAK_ACCELERATION * angle / bounds.turning),
        ),
    )


_PUBLIC = stated("Astrobee's public software")
_ASSUMED_BOUNDS = assumed("not given: bounds of the way that leave thrust for control")


_NAME = "PoseController"


@dataclass(frozen=True, kw_only=True)
class Params(RobotParams, LimitParams):
    """Gains of Astrobee's public software; the trajectory's bounds leave half of the weakest thrust for control."""

    k_P: PerSecond2 = parameter(0.6, "acceleration per position error", minimum=0.0, maximum=1e4, origin=_PUBLIC)
    k_I: PerSecond3 = parameter(
        1e-4, "acceleration per integral of the position error", minimum=0.0, maximum=1e4, origin=_PUBLIC
    )
    k_D: PerSecond = parameter(1.2, "acceleration per velocity error", minimum=0.0, maximum=1e4, origin=_PUBLIC)
    k_P_R: PerSecond2 = parameter(
        4.0, "angular acceleration per attitude error", minimum=0.0, maximum=1e4, origin=_PUBLIC
    )
    k_I_R: PerSecond3 = parameter(
        0.002, "angular acceleration per integral of that", minimum=0.0, maximum=1e4, origin=_PUBLIC
    )
    k_D_R: PerSecond = parameter(3.2, "angular acceleration per rate error", minimum=0.0, maximum=1e4, origin=_PUBLIC)
    speed: MetrePerSecond = parameter(
        0.1, "largest speed of the trajectory (assumed)", minimum=1e-3, maximum=10.0, origin=_ASSUMED_BOUNDS
    )
    acceleration: MetrePerSecond2 = parameter(
        0.02, "largest acceleration of the trajectory (assumed)", minimum=1e-4, maximum=100.0, origin=_ASSUMED_BOUNDS
    )
    rate: RadianPerSecond = parameter(
        0.17, "largest turning rate of the trajectory (assumed)", minimum=1e-3, maximum=10.0, origin=_ASSUMED_BOUNDS
    )
    turning: RadianPerSecond2 = parameter(
        0.1,
        "largest angular acceleration of the trajectory (assumed)",
        minimum=1e-4,
        maximum=100.0,
        origin=_ASSUMED_BOUNDS,
    )

    def position_gains(self) -> PidGains:
        """Return the gains of the translation."""
        return PidGains(k_P=self.k_P, k_I=self.k_I, k_D=self.k_D)

    def attitude_gains(self) -> PidGains:
        """Return the gains of the rotation."""
        return PidGains(k_P=self.k_P_R, k_I=self.k_I_R, k_D=self.k_D_R)

    def faults(self) -> list[str]:
        """Return what is wrong with gains, body and bounds."""
        faults = self.body().faults()
        faults += self.position_gains().faults("position gains") + self.attitude_gains().faults("attitude gains")
        inertia = float(np.max(np.abs(self.I_B)))
        force, torque = self.mass * self.acceleration, self.turning * inertia
        least_f, least_tau = float(np.min(self.f_max)), float(np.min(self.tau_max))
        if force > least_f:
            faults.append(
                f"mass = {self.mass:.4g} kg at acceleration = {self.acceleration:g} m/s2 takes {force:.3g} N, more "
                f"than the least of f_max = {self.f_max.tolist()} N; at most {least_f / self.acceleration:.3g} kg, or "
                f"{least_f / self.mass:.3g} m/s2"
            )
        if torque > least_tau:
            faults.append(
                f"I_B, up to {inertia:.4g} kg m2, at turning = {self.turning:g} rad/s2 takes {torque:.3g} N m, more "
                f"than the least of tau_max = {self.tau_max.tolist()} N m; at most {least_tau / self.turning:.3g} "
                f"kg m2, or {least_tau / inertia:.3g} rad/s2"
            )
        return faults


class PoseController(GripperController[Inputs, Outputs]):
    """Takes the gripper to a pose by a PID of the base along a planned trajectory, as Astrobee's mobility does.

    When it becomes active, and whenever the goal changes, a trajectory (`Profile`) begins where the base is, with its
    velocity, and ends at rest where the gripper is at its goal. Along it, with e the position error in W, phi the
    rotation vector of the attitude error in B, and sums over past samples for the integrals,

        F = R_WB^T m (k_P e + k_I sum e T + k_D (v_ref - v) + a_ref)
        M = I_B (k_P_R phi + k_I_R sum phi T + k_D_R (w_ref - w) + dw_ref) + w x I_B w.

    Both are clipped to the propulsion's limits, axis by axis. While F is clipped, its sum is not updated, nor is M's
    while M is (anti-windup). Deactivation resets sums and trajectory.

    At construction the loop near the goal is closed at the period with python-control, with the expected delay and
    lag but without saturation.

    Raises:
        InvalidControllerParameters: by the constructor, for an impossible body, bounds beyond the thrust, or a loop
            that is not stable.
        InvalidOrientation: a quaternion is zero or not finite.
    """

    def __init__(self, params: Params) -> None:
        body, self._T = params.body(), float(self.period)
        position, attitude = params.position_gains(), params.attitude_gains()
        faults = params.faults() or stability_faults(
            body,
            lambda factor, _: pid_law(body, position.scaled(factor), attitude.scaled(factor), self._T),
            self._T,
            params.delay,
            params.lag,
        )
        if faults:
            raise InvalidControllerParameters(_NAME, faults)
        self.loop = SampledLoop(
            body.linear_plant(params.lag), pid_law(body, position, attitude, self._T), self._T, params.delay
        )
        self._loop_figures = self.loop.figures
        self._position, self._attitude, self._mass = position, attitude, params.mass
        self._I_B, self._p_BG = row_major(params.I_B), vector(params.p_BG)
        self._f_max, self._tau_max = vector(params.f_max), vector(params.tau_max)
        self._bounds = Bounds(
            speed=params.speed, acceleration=params.acceleration, rate=params.rate, turning=params.turning
        )
        self._reset()

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the command for the measurements of t, which holds until t + dt."""
        q_WB = unit_quaternion(u.q_WB_meas, _NAME, "q_WB_meas")
        q_goal = unit_quaternion(u.q_WG_goal, _NAME, "q_WG_goal")
        p, goal, R_WB = vector(u.p_WB_meas), vector(u.p_WG_goal), rotation_matrix(q_WB)
        e = subtract(subtract(goal, p), rotate(R_WB, self._p_BG))
        f, tau = ZERO, ZERO
        if u.active:
            v = vector(u.v_WB_meas)
            reference = self._profile_to(p, v, q_WB, goal, q_goal).at(self._elapsed * self._T)
            f = self._force(reference, p, v, R_WB)
            tau = self._torque(reference, q_WB, vector(u.w_WB_meas), R_WB)
            self._elapsed += 1
        elif self._profile is not None:
            self._reset()
        return Outputs(
            f_cmd=np.array(f) if u.active else np.zeros(3),
            tau_cmd=np.array(tau) if u.active else np.zeros(3),
            error_p=norm(e),
            error_R=angle_between(q_goal, q_WB),
            **self._loop_figures,
        )

    def get_state(self) -> bytes:
        """Return the trajectory, the samples since its start, its goal and the sums."""
        profile = None if self._profile is None else vars(self._profile)
        return pack_state((profile, self._elapsed, self._goal, self._sum_e, self._sum_phi))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this controller or of one with equal parameters."""
        profile, self._elapsed, self._goal, self._sum_e, self._sum_phi = unpack_state(state)
        self._profile = None if profile is None else Profile(**profile)

    def _reset(self) -> None:
        self._profile: Profile | None = None
        self._elapsed = 0
        self._goal: tuple[Vector, Quaternion] | None = None
        self._sum_e: Vector = ZERO
        self._sum_phi: Vector = ZERO

    def _profile_to(self, p: Vector, v: Vector, q_WB: Quaternion, goal: Vector, q_goal: Quaternion) -> Profile:
        """Return the trajectory to the goal: the current one, or, for another goal, one that starts here.

        The sums are kept when the goal changes, since the disturbances that they compensate do not change with it.
        """
        if self._profile is not None and self._goal == (goal, q_goal):
            return self._profile
        base_goal = subtract(goal, rotate(rotation_matrix(q_goal), self._p_BG))
        self._profile = profile_between(p, v, q_WB, base_goal, q_goal, self._bounds)
        self._goal, self._elapsed = (goal, q_goal), 0
        return self._profile

    def _force(self, reference: Reference, p: Vector, v: Vector, R_WB: Matrix) -> Vector:
        e, e_rate = subtract(reference.p, p), subtract(reference.v, v)
        a = add(self._position.acceleration(e, self._sum_e, e_rate), reference.a)
        f = inverse_rotate(R_WB, scale(self._mass, a))
        clipped = clip(f, self._f_max)
        if clipped == f:
            self._sum_e = add_scaled(self._sum_e, self._T, e)
        return clipped

    def _torque(self, reference: Reference, q_WB: Quaternion, w_WB: Vector, R_WB: Matrix) -> Vector:
        phi, w = rotation_vector(relative_quaternion(q_WB, reference.q)), inverse_rotate(R_WB, w_WB)
        phi_rate = subtract(inverse_rotate(R_WB, reference.w), w)
        dw = add(self._attitude.acceleration(phi, self._sum_phi, phi_rate), inverse_rotate(R_WB, reference.dw))
        tau = add(multiply(self._I_B, dw), cross(w, multiply(self._I_B, w)))
        clipped = clip(tau, self._tau_max)
        if clipped == tau:
            self._sum_phi = add_scaled(self._sum_phi, self._T, phi)
        return clipped
