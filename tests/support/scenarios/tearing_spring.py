"""A spring that can tear, to test how a run ends when a unit fails."""

from dataclasses import dataclass

from handover.cosim.blocks.ports import output, parameter
from handover.cosim.blocks.units import Metre, Second
from support.cosim.master_blocks import Plain


@dataclass(frozen=True, kw_only=True)
class Params:
    tears: Second = parameter(100.0, "when it tears")


@dataclass(kw_only=True)
class Inputs:
    pass


@dataclass(kw_only=True)
class Outputs:
    x: Metre = output("stretch")


class TearingSpring(Plain):
    """Stretches by x = t^2 until it tears."""

    def __init__(self, params: Params) -> None:
        self.tears = params.tears

    def outputs(self, t: float, u: Inputs) -> Outputs:  # noqa: ARG002
        return Outputs(x=t * t)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        if t > self.tears:
            raise RuntimeError("the spring tore")
        return self.outputs(t + dt, u)
