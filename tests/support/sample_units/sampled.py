"""A sampled block that shows by what it was stepped."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from handover.cosim.blocks.ports import output, parameter, port
from handover.cosim.blocks.units import Number, Second


@dataclass(frozen=True, kw_only=True)
class Params:
    gain: Number = parameter(0.1, "what of the input is added at a tick")


@dataclass(kw_only=True)
class Inputs:
    u: Number = port(1.0, "input")


@dataclass(kw_only=True)
class Outputs:
    y: Number = output("sum of the inputs at the ticks, times the gain")
    ticks: Number = output("number of ticks")
    t_seen: Second = output("time at the last tick, -1 before")
    dt_seen: Second = output("step at the last tick, -1 before")


class Sampled:
    """y <- y + gain u at each tick."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = Fraction(1, 30)

    def __init__(self, params: Params) -> None:
        self.params = params
        self.seen = (0.0, 0.0, -1.0, -1.0)

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        y, ticks, t_seen, dt_seen = self.seen
        return Outputs(y=y, ticks=ticks, t_seen=t_seen, dt_seen=dt_seen)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        self.seen = (self.seen[0] + self.params.gain * u.u, self.seen[1] + 1.0, t, dt)
        return self.outputs(t, u)

    def get_state(self) -> bytes:
        return struct.pack("=4d", *self.seen)

    def set_state(self, state: bytes) -> None:
        self.seen = struct.unpack("=4d", state)
