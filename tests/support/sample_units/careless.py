"""A block whose output is not of the declared shape."""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Vector3, output
from handover.cosim.blocks.units import Metre
from support.sample_units.memoryless import Memoryless


@dataclass(frozen=True, kw_only=True)
class Params:
    pass


@dataclass(kw_only=True)
class Inputs:
    pass


@dataclass(kw_only=True)
class Outputs:
    p: Vector3[Metre] = output("place")


class Careless(Memoryless):
    """Gives one coordinate where three are declared, which would fit by numpy's broadcasting."""

    def __init__(self, params: Params) -> None:
        pass

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(p=np.ones(1))
