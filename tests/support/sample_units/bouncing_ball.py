"""A ball that is held, released and bounces: a block with a time event and with events that its state makes."""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from handover.cosim.blocks.block import step_through_events
from handover.cosim.blocks.ports import output, parameter, port
from handover.cosim.blocks.units import Metre, MetrePerSecond, Number, Second

MISSED = 1e-9  # what a host's sum of steps may miss the release by, s


@dataclass(frozen=True, kw_only=True)
class Params:
    e: Number = parameter(0.7, "speed after an impact by that before it", minimum=0.0, maximum=1.0)
    height: Metre = parameter(1.0, "height at which the ball is held", minimum=0.0)
    release: Second = parameter(0.25, "when the ball is released")
    slowest: MetrePerSecond = parameter(0.05, "a slower rebound leaves the ball at rest", minimum=1e-6)


@dataclass(kw_only=True)
class Inputs:
    g: Number = port(9.81, "gravity, m/s2; positive")


@dataclass(kw_only=True)
class Outputs:
    h: Metre = output("height")
    v: MetrePerSecond = output("velocity upwards")
    impacts: int = output("number of impacts")


class BouncingBall:
    """h'' = -g while released and above ground; v <- -e v at the ground, 0 if that is slow."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        self.params = params
        self.h, self.v, self.impacts, self.moves, self.held = params.height, 0.0, 0, False, True

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(h=self.h, v=self.v, impacts=self.impacts)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        y: Outputs = step_through_events(self, t, dt, u)
        return y

    def advance(self, t: float, dt: float, u: Inputs) -> tuple[float, Outputs]:
        s = self._until_event(t, u.g)
        reached = min(dt, s)
        if self.moves:
            at_ground = s < dt
            self.h = 0.0 if at_ground else self.h + self.v * reached - 0.5 * u.g * reached * reached
            self.v -= u.g * reached
        return reached, self.outputs(t + reached, u)

    def handle_event(self, t: float, u: Inputs) -> Outputs:
        if self.held:
            if t >= self.params.release - MISSED:
                self.held, self.moves = False, True
        elif self.moves and self.h <= 0.0 and self.v <= 0.0:
            self.h, self.v = 0.0, -self.params.e * self.v
            self.impacts += 1
            if self.v < self.params.slowest:
                self.v, self.moves = 0.0, False
        return self.outputs(t, u)

    def next_event(self, t: float) -> float | None:  # noqa: ARG002
        return self.params.release if self.held else None

    def get_state(self) -> bytes:
        return struct.pack("=ddq??", self.h, self.v, self.impacts, self.moves, self.held)

    def set_state(self, state: bytes) -> None:
        self.h, self.v, self.impacts, self.moves, self.held = struct.unpack("=ddq??", state)

    def _until_event(self, t: float, g: float) -> float:
        """Return the seconds until the release, or until the root of h + v s - g s^2 / 2; infinity at rest."""
        if self.held:
            return max(0.0, self.params.release - t)
        if not self.moves:
            return math.inf
        if self.h <= 0.0 and self.v <= 0.0:
            return 0.0
        return (self.v + math.sqrt(self.v * self.v + 2.0 * g * max(0.0, self.h))) / g
