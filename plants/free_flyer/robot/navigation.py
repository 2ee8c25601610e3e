"""A free-flyer's navigation: its pose and velocities with noise, bias, drift and delay."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar, NamedTuple

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, derived
from handover.cosim.blocks.plain_rotation import (
    IDENTITY,
    ZERO,
    Quaternion,
    Vector,
    add,
    lerp,
    nlerp,
    perturb,
    quaternion,
    vector,
)
from handover.cosim.blocks.ports import Floats, Vector3, Vector4, output, parameter, port
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Hertz, Metre, MetrePerSecond, Number, Radian, RadianPerSecond, Second

_WHITE = assumed("not given: white noise of the navigation's estimate")
_NONE = assumed("not given: none")

_ROUNDING = 1e-6
"""Part of an update's interval by which a host's time may be off."""
_DRAWN_AT_ONCE = 16
"""Updates whose noise is drawn together: the same numbers in a third of the time."""


class InvalidNavigationParameters(InvalidParameters):
    """Parameters out of range, or that contradict each other; `faults` lists all of them."""

    block = "Navigation"


class NoOrientation(ValueError):
    """The truth has an orientation that is none: its quaternion is zero."""

    def __init__(self, t: float) -> None:
        super().__init__(f"input q_WB is [0, 0, 0, 0] at {t:g} s, which is not an orientation: give a unit quaternion")
        self.t = t


@dataclass(frozen=True, kw_only=True)
class Params:
    """How far off the estimate is, how often it comes and how late. All is assumed.

    Deviations are of each axis; those of position, velocity and angular velocity along W's, that of the attitude a
    rotation about the robot's own.
    """

    position_noise: Metre = parameter(
        0.001, "deviation of the estimated position, white", minimum=0.0, maximum=1.0, origin=_WHITE
    )
    attitude_noise: Radian = parameter(
        0.002, "deviation of the estimated attitude, white", minimum=0.0, maximum=0.5, origin=_WHITE
    )
    velocity_noise: MetrePerSecond = parameter(
        0.001, "deviation of the estimated velocity, white", minimum=0.0, maximum=1.0, origin=_WHITE
    )
    rate_noise: RadianPerSecond = parameter(
        0.002, "deviation of the estimated angular velocity, white", minimum=0.0, maximum=1.0, origin=_WHITE
    )
    position_bias: Metre = parameter(
        0.0, "deviation of the estimated position, the same for a whole run", minimum=0.0, maximum=1.0, origin=_NONE
    )
    attitude_bias: Radian = parameter(
        0.0, "deviation of the estimated attitude, the same for a whole run", minimum=0.0, maximum=0.5, origin=_NONE
    )
    velocity_bias: MetrePerSecond = parameter(
        0.0, "deviation of the estimated velocity, the same for a whole run", minimum=0.0, maximum=1.0, origin=_NONE
    )
    rate_bias: RadianPerSecond = parameter(
        0.0,
        "deviation of the estimated angular velocity, the same for a whole run",
        minimum=0.0,
        maximum=1.0,
        origin=_NONE,
    )
    position_drift: Metre = parameter(
        0.0, "deviation of the estimated position, slow", minimum=0.0, maximum=1.0, origin=_NONE
    )
    attitude_drift: Radian = parameter(
        0.0, "deviation of the estimated attitude, slow", minimum=0.0, maximum=0.5, origin=_NONE
    )
    velocity_drift: MetrePerSecond = parameter(
        0.0, "deviation of the estimated velocity, slow", minimum=0.0, maximum=1.0, origin=_NONE
    )
    rate_drift: RadianPerSecond = parameter(
        0.0, "deviation of the estimated angular velocity, slow", minimum=0.0, maximum=1.0, origin=_NONE
    )
    drift_time: Second = parameter(
        0.0,
        "correlation time of what is slow",
        minimum=0.0,
        maximum=1e6,
        origin=assumed("not given: there is no drift"),
    )
    update_rate: Hertz = parameter(
        0.0,
        "how often there is another estimate; 0: at every step",
        minimum=0.0,
        maximum=1e4,
        origin=derived("not given: an estimate for every cycle, as sec. 4.1.2 calls the impedance control at each"),
    )
    delay: Second = parameter(0.0, "age of what is estimated", minimum=0.0, maximum=2.0, origin=NOT_GIVEN)
    seed: int = parameter(0, "seed of the random numbers", minimum=0)

    def check(self) -> None:
        """Raise InvalidNavigationParameters, with all faults, for values out of range or that contradict each other."""
        faults = parameter_faults(self)
        slow = [name for name in _SLOW if getattr(self, name) > 0.0]
        if not faults and slow and self.drift_time == 0.0:
            given = ", ".join(f"{name} {getattr(self, name):g}" for name in slow)
            faults = [f"{given} needs a correlation time: drift_time must be greater than 0 s"]
        if faults:
            raise InvalidNavigationParameters(faults)

    def deviations(self, kind: str) -> Floats:
        """Return the twelve deviations of noise, bias or drift: position, half the attitude's angle, velocity, rate."""
        position, attitude, velocity, rate = (
            getattr(self, f"{what}_{kind}") for what in ("position", "attitude", "velocity", "rate")
        )
        return np.repeat(np.array([position, 0.5 * attitude, velocity, rate], dtype=np.float64), 3)


_SLOW = tuple(f"{what}_drift" for what in ("position", "attitude", "velocity", "rate"))


@dataclass(kw_only=True)
class Inputs:
    """The truth, in the world."""

    p_WB: Vector3[Metre] = port(np.zeros(3), "position of the centre of mass")
    q_WB: Vector4[Number] = port(np.array([1.0, 0.0, 0.0, 0.0]), "orientation, a unit quaternion")
    v_WB: Vector3[MetrePerSecond] = port(np.zeros(3), "velocity of the centre of mass")
    w_WB: Vector3[RadianPerSecond] = port(np.zeros(3), "angular velocity")


@dataclass(kw_only=True)
class Outputs:
    """The estimate of it, in the world."""

    p_WB_meas: Vector3[Metre] = output("estimated position of the centre of mass")
    q_WB_meas: Vector4[Number] = output("estimated orientation")
    v_WB_meas: Vector3[MetrePerSecond] = output("estimated velocity of the centre of mass")
    w_WB_meas: Vector3[RadianPerSecond] = output("estimated angular velocity")


class _Motion(NamedTuple):
    """Pose and velocities in the world at a time, s."""

    t: float
    p: Vector
    q: Quaternion
    v: Vector
    w: Vector


class Navigation:
    """Gives the truth of `delay` ago plus noise, bias and drift, as a filter of cameras and IMU is off from it.

    [Fernandes2020] sec. 4.1.1-4.1.2: the robot's extended Kalman filter, of which the thesis gives no figures. What
    is modelled is its error, not the filter:

    - noise: white and Gaussian, drawn at each update;
    - bias: constant, drawn once a run;
    - drift: first-order Gauss-Markov, x' = -x / drift_time + white noise, by its exact transition, so that its
      statistics do not depend on the steps. It is stationary from the start, since the filter has run before the run.

    Errors of the four outputs and of their axes are independent. The attitude's three add up to one small turn in the
    robot's frame. Noise has random numbers of its own: it is the same with bias and drift and without.

    Inputs are the truth at the end of a step: in a system the navigation comes after the robot, and sees where the
    robot got in the same step. Between communication points the truth is interpolated linearly, orientations with
    normalisation. So a delay or an interval of updates need not be a multiple of the step. Before the start the robot
    counts as having been where it starts. Updates are at multiples of 1 / `update_rate`, and the estimate is held
    between them; of those within one step the last one counts.

    Raises:
        InvalidNavigationParameters: by the constructor, for values out of range, or a drift without correlation time.
        NoOrientation: the input q_WB is zero.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "p_WB_meas": ("p_WB",),
        "q_WB_meas": ("q_WB",),
        "v_WB_meas": ("v_WB",),
        "w_WB_meas": ("w_WB",),
    }
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("base", TerminalKind.MOTION, "p_WB", "q_WB", "v_WB", "w_WB"),
        terminal("estimate", TerminalKind.MOTION, "p_WB_meas", "q_WB_meas", "v_WB_meas", "w_WB_meas"),
    )
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self._delay, self._update_rate, self._drift_time = params.delay, params.update_rate, params.drift_time
        self._noise_deviations, self._drift_deviations = params.deviations("noise"), params.deviations("drift")
        self._rng = np.random.default_rng(params.seed)
        self._slow_rng = self._rng.spawn(1)[0]
        self._bias: Floats = params.deviations("bias") * self._slow_rng.standard_normal(12)
        self._drift: Floats = self._drift_deviations * self._slow_rng.standard_normal(12)
        self._drifts = bool(np.any(self._drift_deviations))
        self._slow = self._drifts or bool(np.any(self._bias))
        self._past: list[_Motion] = []  # as far back as an update may reach, oldest first
        self._updated: float | None = None  # time of the latest update
        self._noise: list[list[float]] = []  # of the next updates, the last one first
        self._errors: list[float] = []
        self._estimate = _Motion(0.0, ZERO, IDENTITY, ZERO, ZERO)
        self._draw()

    def outputs(self, t: float, u: Inputs) -> Outputs:
        """Return the estimate; no time passes. Before the first step, u is the truth at the start."""
        if self._updated is None:
            self._past = [_motion(t, u)]
            return self._outputs(self._past[0])
        return self._outputs(self._estimate)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        """Advance from t by dt; u is the truth at t + dt."""
        end = t + dt
        self._past.append(_motion(end, u))
        if self._updated is None:
            self._updated, self._estimate = t, self._past[0]
        due = self._latest_update(end)
        if due > self._updated:
            self._advance_drift(due - self._updated)
            self._draw()
            self._updated, self._estimate = due, self._at(due - self._delay)
        return self._outputs(self._estimate)

    def get_state(self) -> bytes:
        """Return the complete state."""
        return pack_state(
            (
                [tuple(m) for m in self._past],
                self._updated,
                tuple(self._estimate),
                self._errors,
                self._drift,
                self._noise,
                self._rng.bit_generator,
                self._slow_rng.bit_generator,
            )
        )

    def set_state(self, state: bytes) -> None:
        """Restore a state of this navigation or of one with equal parameters."""
        past, self._updated, estimate, self._errors, self._drift, noise, rng, slow = unpack_state(state)
        self._past, self._estimate = [_Motion(*m) for m in past], _Motion(*estimate)
        self._noise = list(noise)
        self._rng.bit_generator.state, self._slow_rng.bit_generator.state = rng, slow

    def _latest_update(self, t: float) -> float:
        """Return the time of the latest update at t or before."""
        if self._update_rate == 0.0:
            return t
        return math.floor(t * self._update_rate + _ROUNDING) / self._update_rate

    def _at(self, t: float) -> _Motion:
        """Return the motion at a time, interpolated, and forget what came before: no later update reaches back to it.

        Times before the start have the motion at the start.
        """
        past = self._past
        first = len(past) - 1
        while first > 0 and past[first].t > t:
            first -= 1
        del past[:first]
        a = past[0]
        if t <= a.t or len(past) == 1:
            return a
        b = past[1]
        s = (t - a.t) / (b.t - a.t)
        return _Motion(t, lerp(a.p, b.p, s), nlerp(a.q, b.q, s), lerp(a.v, b.v, s), lerp(a.w, b.w, s))

    def _advance_drift(self, dt: float) -> None:
        if not self._drifts:
            return
        decay = math.exp(-dt / self._drift_time)
        added = math.sqrt(-math.expm1(-2.0 * dt / self._drift_time)) * self._drift_deviations
        self._drift = decay * self._drift + added * self._slow_rng.standard_normal(12)

    def _draw(self) -> None:
        if not self._noise:
            drawn = self._noise_deviations * self._rng.standard_normal((_DRAWN_AT_ONCE, 12))
            self._noise = drawn[::-1].tolist()
        noise = self._noise.pop()
        self._errors = (np.array(noise) + self._bias + self._drift).tolist() if self._slow else noise

    def _outputs(self, m: _Motion) -> Outputs:
        """Return the outputs as pieces of one array, which costs less than an array each."""
        p_x, p_y, p_z, h_x, h_y, h_z, v_x, v_y, v_z, w_x, w_y, w_z = self._errors
        a = np.array(
            [
                *add(m.p, (p_x, p_y, p_z)),
                *perturb(m.q, (h_x, h_y, h_z)),
                *add(m.v, (v_x, v_y, v_z)),
                *add(m.w, (w_x, w_y, w_z)),
            ]
        )
        return Outputs(p_WB_meas=a[0:3], q_WB_meas=a[3:7], v_WB_meas=a[7:10], w_WB_meas=a[10:13])


def _motion(t: float, u: Inputs) -> _Motion:
    if not np.any(u.q_WB):
        raise NoOrientation(t)
    return _Motion(t, vector(u.p_WB), quaternion(u.q_WB), vector(u.v_WB), vector(u.w_WB))
