"""A block whose output is not of the declared shape."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Vector3, output
from handover.cosim.blocks.units import Metre


@dataclass(frozen=True, kw_only=True)
class Params:
    pass


@dataclass(kw_only=True)
class Inputs:
    pass


@dataclass(kw_only=True)
class Outputs:
    p: Vector3[Metre] = output("place")


class Careless:
    """Gives one coordinate where three are declared, which would fit by numpy's broadcasting."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    period: ClassVar[Fraction | None] = None

    def __init__(self, params: Params) -> None:
        pass

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(p=np.ones(1))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return self.outputs(t + dt, u)

    def get_state(self) -> bytes:
        return b""

    def set_state(self, state: bytes) -> None:
        pass
