"""Propulsion of a free-flyer: limits, delay and lag of commanded wrenches, after [Fernandes2020] sec. 4.1.1."""

import enum
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Vector3, output, parameter, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Newton, NewtonMetre, Second

_Command = list[float]
_COMMANDS = ("f_pose", "tau_pose", "f_impedance", "tau_impedance")


class Propulsion(enum.IntEnum):
    """How commands become thrust; the delay is in all."""

    IDEAL = 0
    """At once and without limits."""
    LIMITED = 1
    """With limits of each axis, and a lag."""


@dataclass(frozen=True, kw_only=True)
class Params:
    """Limits of NASA's Astrobee as published; lag and delay are assumed."""

    f_max: Vector3[Newton] = parameter(
        np.array([0.55, 0.39, 0.45]), "largest force, an axis", minimum=0.0, maximum=1000.0
    )
    tau_max: Vector3[NewtonMetre] = parameter(
        np.array([0.064, 0.040, 0.075]), "largest torque, an axis", minimum=0.0, maximum=1000.0
    )
    lag: Second = parameter(0.02, "time constant of the first-order lag", minimum=0.0, maximum=10.0)
    delay: Second = parameter(0.0, "how long a command takes to arrive", minimum=0.0, maximum=10.0)
    propulsion: Propulsion = parameter(Propulsion.LIMITED, "without limits or lag, or with both; the delay stays")


@dataclass(kw_only=True)
class Inputs:
    """Commands of two controllers, in the robot's frame; they are added, and one that is off commands zero."""

    f_pose: Vector3[Newton] = port(np.zeros(3), "force commanded by the pose controller")
    tau_pose: Vector3[NewtonMetre] = port(np.zeros(3), "torque commanded by the pose controller")
    f_impedance: Vector3[Newton] = port(np.zeros(3), "force commanded by the impedance controller")
    tau_impedance: Vector3[NewtonMetre] = port(np.zeros(3), "torque commanded by the impedance controller")


@dataclass(kw_only=True)
class Outputs:
    """What pushes the robot, in its own frame."""

    f_B: Vector3[Newton] = output("force at the centre of mass, mean over the step")
    tau_B: Vector3[NewtonMetre] = output("torque, mean over the step")
    saturated: bool = output("an axis was commanded more than it has")


class Thrusters:
    """Clips commands to the limits, delays them and lets thrust follow with a lag: T y' = clip(f)(t - delay) - y.

    The command is constant in a step, so thrust and its integral are exact: over d seconds of command c,
    y <- c + (y - c) e^(-d/T) and its integral is c d + (y - c) T (1 - e^(-d/T)). The outputs are the mean over the
    step that ends, so that the robot gets the whole impulse; in a system the thrusters come before the robot, which
    then uses the mean in the same step. Where a delay is no multiple of the step, two commands share it.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(("f_B", "tau_B", "saturated"), _COMMANDS)
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        self._limits: list[float] = [*np.asarray(params.f_max).tolist(), *np.asarray(params.tau_max).tolist()]
        self._ideal = params.propulsion is Propulsion.IDEAL
        self._lag = 0.0 if self._ideal else params.lag
        self._delayed = params.delay > 0.0
        self._delay_line: deque[tuple[float, _Command]] = deque()  # seconds and command, oldest first
        if self._delayed:
            self._delay_line.append((params.delay, [0.0] * 6))
        self._thrust: _Command = [0.0] * 6

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the thrust at this instant; no time passes."""
        command = _sum(u)
        clipped = command if self._ideal else self._clip(command)
        thrust = clipped if self._lag == 0.0 and not self._delayed else self._thrust
        return _outputs(thrust, clipped != command)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Advance from t by dt with u held."""
        command = _sum(u)
        clipped = command if self._ideal else self._clip(command)
        if self._delayed:
            total = [0.0] * 6
            for d, arrived in self._delay(dt, clipped):
                part = self._follow(d, arrived)
                total = [a + b for a, b in zip(total, part, strict=True)]
        else:
            total = self._follow(dt, clipped)
        return _outputs([a / dt for a in total], clipped != command)

    def get_state(self) -> bytes:
        """Return the complete state."""
        return pack_state((self._thrust, list(self._delay_line)))

    def set_state(self, state: bytes) -> None:
        """Restore a state of these thrusters or of ones with equal parameters."""
        self._thrust, delay_line = unpack_state(state)
        self._delay_line = deque(delay_line)

    def _clip(self, command: _Command) -> _Command:
        return [c if -m <= c <= m else math.copysign(m, c) for c, m in zip(command, self._limits, strict=True)]

    def _delay(self, dt: float, command: _Command) -> list[tuple[float, _Command]]:
        """Enter dt seconds of a command into the delay line; return what leaves it in that time, in order."""
        self._delay_line.append((dt, command))
        arrived: list[tuple[float, _Command]] = []
        left = dt
        while left > 1e-12:
            d, c = self._delay_line.popleft()
            if d > left:
                self._delay_line.appendleft((d - left, c))
                d = left
            arrived.append((d, c))
            left -= d
        return arrived

    def _follow(self, d: float, command: _Command) -> _Command:
        """Advance the thrust by d seconds of a command; return its integral."""
        T = self._lag
        if T == 0.0:
            self._thrust = command
            return [c * d for c in command]
        decay = math.exp(-d / T)
        area = T * (1.0 - decay)
        before = self._thrust
        self._thrust = [c + (y - c) * decay for c, y in zip(command, before, strict=True)]
        return [c * d + (y - c) * area for c, y in zip(command, before, strict=True)]


def _sum(u: Inputs) -> _Command:
    (a, b, c), (d, e, f) = u.f_pose.tolist(), u.f_impedance.tolist()
    (g, h, i), (j, k, l) = u.tau_pose.tolist(), u.tau_impedance.tolist()
    return [a + d, b + e, c + f, g + j, h + k, i + l]


def _outputs(thrust: _Command, saturated: bool) -> Outputs:
    y = np.array(thrust)
    return Outputs(f_B=y[:3], tau_B=y[3:], saturated=saturated)
