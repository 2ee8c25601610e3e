"""A block that doubles a difference of its input in each step, as chaotic systems do; and one that is random."""

import random
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

from handover.cosim.blocks.ports import output, port
from handover.cosim.blocks.units import Metre


@dataclass(frozen=True, kw_only=True)
class Params:
    pass


@dataclass(kw_only=True)
class Inputs:
    x: Metre = port(0.3, "place at the start", minimum=0.0, maximum=1.0)


@dataclass(kw_only=True)
class Outputs:
    y: Metre = output("place")


class Chaotic:
    """y(0) = x, y <- 2 y mod 1."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"y": ("x",)}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        self.params = params
        self._y: float | None = None

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(y=u.x if self._y is None else self._y)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        self._y = 2.0 * (u.x if self._y is None else self._y) % 1.0
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        return struct.pack("=d?", self._y or 0.0, self._y is None)

    def set_state(self, state: bytes) -> None:
        y, is_new = struct.unpack("=d?", state)
        self._y = None if is_new else y


class Random(Chaotic):
    """y is any number, whatever the input."""

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(y=random.random())
