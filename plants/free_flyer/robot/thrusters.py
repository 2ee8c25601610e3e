"""Propulsion of a free-flyer: limits, delay and lag of commanded wrenches, after [Fernandes2020] sec. 4.1.1."""

import enum
import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.origins import NOT_GIVEN, assumed, derived, stated
from handover.cosim.blocks.ports import Floats, Vector2, Vector3, Vector12, output, parameter, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Newton, NewtonMetre, Number, Radian, RadianPerSecond, Second
from handover.plants.free_flyer.robot.nozzles import LARGEST_ANGLE, Nozzles, PropulsionModules, lost_directions

_Command = list[float]
_COMMANDS = ("f_pose", "tau_pose", "f_impedance", "tau_impedance")


class Propulsion(enum.IntEnum):
    """How commands become thrust; the delay is in all."""

    IDEAL = 0
    """At once and without limits."""
    LIMITED = 1
    """With limits of each axis, and a lag."""
    NOZZLES = 2
    """By twelve nozzles on two plenums, whose flappers and impellers take their time."""


class InvalidThrusterParameters(InvalidParameters):
    """Parameters of thrusters that cannot fly a robot; `faults` lists all of them."""

    block = "Thrusters"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Limits of NASA's Astrobee as published; lag and delay are assumed.

    Of nozzles, the impellers' highest speed is published, and the flappers' lag and rate follow from the published
    model of their servos; `thrust_factor` makes the largest force along each axis `f_max`.
    """

    f_max: Vector3[Newton] = parameter(
        np.array([0.55, 0.39, 0.45]),
        "largest force, an axis",
        minimum=0.0,
        maximum=1000.0,
        origin=stated("Astrobee, about"),
    )
    tau_max: Vector3[NewtonMetre] = parameter(
        np.array([0.064, 0.040, 0.075]),
        "largest torque, an axis",
        minimum=0.0,
        maximum=1000.0,
        origin=stated("Astrobee, about"),
    )
    lag: Second = parameter(0.02, "time constant of the first-order lag", minimum=0.0, maximum=10.0, origin=NOT_GIVEN)
    delay: Second = parameter(
        0.0, "delay between a command and its thrust", minimum=0.0, maximum=10.0, origin=NOT_GIVEN
    )
    propulsion: Propulsion = parameter(
        Propulsion.LIMITED,
        "without limits or lag, with both, or by nozzles; all delay",
        origin=assumed("Astrobee's limits hold unless a scenario says otherwise"),
    )
    impeller_speed: RadianPerSecond = parameter(
        293.2153,
        "NOZZLES: speed of the impellers, 2800 rpm",
        minimum=50.0,
        maximum=1000.0,
        origin=stated("Astrobee's flight software: the highest of its three speeds, 2800 rpm"),
    )
    impeller_speed_0: RadianPerSecond = parameter(
        293.2153,
        "NOZZLES: their speed at the start",
        minimum=0.0,
        maximum=1000.0,
        origin=assumed("not given: the impellers run before the robot moves"),
    )
    impeller_lag: Second = parameter(
        0.5,
        "NOZZLES: time constant of that speed",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("not given: it shows only where impellers do not start at their speed"),
    )
    flapper_lag: Second = parameter(
        0.0386,
        "NOZZLES: time constant of the flappers",
        minimum=0.0,
        maximum=10.0,
        origin=derived(
            "k / (K_p n) of the servos in Astrobee's flight software: k = 0.001929 N m/A, K_p = 5 V/rad, n = 1/100"
        ),
    )
    flapper_rate: RadianPerSecond = parameter(
        62.0,
        "NOZZLES: speed at which flappers turn at most",
        minimum=0.001,
        maximum=1e9,
        origin=derived("of the same servos without load at 6 V, through gears of 1/100 and 2"),
    )
    flapper_range: Vector12[Number] = parameter(
        np.ones(12),
        "NOZZLES: part of its angle to which each opens, 0: stuck closed",
        minimum=0.0,
        maximum=1.0,
        origin=assumed("all nozzles are whole"),
    )
    thrust_factor: Vector3[Number] = parameter(
        np.array([1.1283, 1.3574, 1.1521]),
        "NOZZLES: thrust along x, y, z over 2 dp C_d^2 A",
        minimum=0.1,
        maximum=10.0,
        origin=derived(
            "such that f_max is the largest force along each axis; Astrobee's simulation has 1.25 for all nozzles"
        ),
    )

    def check(self) -> None:
        """Raise InvalidThrusterParameters if limits, or stuck nozzles, leave no thrust at all in a direction."""
        given = (("f_max", "force along", self.f_max), ("tau_max", "torque about", self.tau_max))
        faults = [
            f"{name}: there is no {what} {', '.join(axes)}: expected a value above 0, or propulsion IDEAL"
            for name, what, most in given
            if self.propulsion is not Propulsion.IDEAL
            and (axes := [axis for axis, x in zip("xyz", np.asarray(most).tolist(), strict=True) if x == 0.0])
        ]
        stuck = [i for i, part in enumerate(np.asarray(self.flapper_range).tolist()) if part == 0.0]
        lost = lost_directions(stuck) if stuck and self.propulsion is Propulsion.NOZZLES else []
        if lost:
            numbers = ", ".join(str(i + 1) for i in stuck)
            faults.append(
                f"flapper_range: with nozzles {numbers} stuck closed there is no {', no '.join(lost)}; open one"
            )
        if faults:
            raise InvalidThrusterParameters(faults)

    def modules(self) -> PropulsionModules:
        """Return the nozzles with closed flappers."""
        return PropulsionModules(
            nozzles=Nozzles(np.asarray(self.thrust_factor), self.impeller_speed),
            flapper_lag=self.flapper_lag,
            flapper_rate=self.flapper_rate,
            impeller_lag=self.impeller_lag,
            largest=LARGEST_ANGLE * np.asarray(self.flapper_range),
            angles=np.zeros(12),
            speeds=np.full(2, self.impeller_speed_0),
        )


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
    saturated: bool = output("more was commanded than there is")
    flapper_angles: Vector12[Radian] = output("NOZZLES: how far each nozzle's flappers are open; else 0")
    impeller_speeds: Vector2[RadianPerSecond] = output("NOZZLES: of the two modules; else 0")


class Thrusters:
    """Clips commands to the limits, delays them and lets thrust follow with a lag: T y' = clip(f)(t - delay) - y.

    The command is constant in a step, so thrust and its integral are exact: over d seconds of command c,
    y <- c + (y - c) e^(-d/T) and its integral is c d + (y - c) T (1 - e^(-d/T)). The outputs are the mean over the
    step that ends, so that the robot gets the whole impulse. In a system the thrusters come before the robot, which
    then uses the mean in the same step. Where a delay is not a multiple of the step, two commands share it.

    With nozzles the clipped command is shared among twelve, and scaled down where they do not have it (`Nozzles`).
    Their thrusts are delayed, and flappers and impellers lag (`PropulsionModules`). Axes are clipped first as
    Astrobee's controller does, or a torque of forty times the largest would leave a fortieth of the force. That
    impellers turn the robot as they change their speed, or by its turning, is left out: the two turn opposite ways.

    Raises:
        InvalidThrusterParameters: by the constructor, if limits or stuck nozzles leave no thrust in a direction.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {
        **dict.fromkeys(("f_B", "tau_B", "saturated", "flapper_angles"), _COMMANDS),
        "impeller_speeds": (),
    }
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("thrust", TerminalKind.WRENCH, "f_B", "tau_B"),
        terminal("command_of_pose", TerminalKind.WRENCH, f_cmd="f_pose", tau_cmd="tau_pose"),
        terminal("command_of_impedance", TerminalKind.WRENCH, f_cmd="f_impedance", tau_cmd="tau_impedance"),
    )
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        params.check()
        self._limits: list[float] = [*np.asarray(params.f_max).tolist(), *np.asarray(params.tau_max).tolist()]
        self._ideal = params.propulsion is Propulsion.IDEAL
        self._modules = params.modules() if params.propulsion is Propulsion.NOZZLES else None
        self._lag = 0.0 if self._ideal else params.lag
        self._delayed = params.delay > 0.0
        self._delay_line: deque[tuple[float, _Command]] = deque()  # seconds and command, oldest first
        if self._delayed:
            self._delay_line.append((params.delay, [0.0] * (6 if self._modules is None else 12)))
        self._thrust: _Command = [0.0] * 6

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the thrust at this instant; no time passes."""
        command, saturated = self._command(u)
        if self._modules is not None:
            return self._outputs(self._modules.wrench().tolist(), saturated)
        thrust = command if self._lag == 0.0 and not self._delayed else self._thrust
        return self._outputs(thrust, saturated)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Advance from t by dt with u held."""
        command, saturated = self._command(u)
        if self._delayed:
            total = [0.0] * 6
            for d, arrived in self._delay(dt, command):
                part = self._follow(d, arrived)
                total = [a + b for a, b in zip(total, part, strict=True)]
        else:
            total = self._follow(dt, command)
        return self._outputs([a / dt for a in total], saturated)

    def get_state(self) -> bytes:
        """Return the complete state."""
        modules = None if self._modules is None else (self._modules.angles, self._modules.speeds)
        return pack_state((self._thrust, list(self._delay_line), modules))

    def set_state(self, state: bytes) -> None:
        """Restore a state of these thrusters or of ones with equal parameters."""
        self._thrust, delay_line, modules = unpack_state(state)
        self._delay_line = deque(delay_line)
        if self._modules is not None:
            self._modules.angles, self._modules.speeds = modules

    def _command(self, u: Inputs) -> tuple[_Command, bool]:
        """Return what is to be given, a wrench or the thrusts of nozzles, and whether it is less than commanded."""
        command = _sum(u)
        if self._ideal:
            return command, False
        clipped = self._clip(command)
        if self._modules is None:
            return clipped, clipped != command
        thrusts, scaled = self._modules.nozzles.allocate(np.array(clipped))
        return thrusts.tolist(), scaled or clipped != command

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
        """Advance the thrust by d seconds of a command; return its integral, a wrench."""
        if self._modules is not None:
            return self._modules.advance(d, np.array(command)).tolist()
        T = self._lag
        if T == 0.0:
            self._thrust = command
            return [c * d for c in command]
        decay = math.exp(-d / T)
        area = T * (1.0 - decay)
        before = self._thrust
        self._thrust = [c + (y - c) * decay for c, y in zip(command, before, strict=True)]
        return [c * d + (y - c) * area for c, y in zip(command, before, strict=True)]

    def _outputs(self, thrust: _Command, saturated: bool) -> Outputs:
        y, modules = np.array(thrust), self._modules
        angles: Floats = np.zeros(12) if modules is None else np.array(modules.angles)
        speeds: Floats = np.zeros(2) if modules is None else np.array(modules.speeds)
        return Outputs(f_B=y[:3], tau_B=y[3:], saturated=saturated, flapper_angles=angles, impeller_speeds=speeds)


def _sum(u: Inputs) -> _Command:
    (a, b, c), (d, e, f) = u.f_pose.tolist(), u.f_impedance.tolist()
    (g, h, i), (j, k, l) = u.tau_pose.tolist(), u.tau_impedance.tolist()
    return [a + d, b + e, c + f, g + j, h + k, i + l]
