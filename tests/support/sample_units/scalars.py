"""A block with scalars only, to weigh what a step costs beyond the block's own work."""

from dataclasses import dataclass

from handover.cosim.blocks.ports import output, parameter, port
from handover.cosim.blocks.units import Number
from support.sample_units.memoryless import Memoryless


@dataclass(frozen=True, kw_only=True)
class Params:
    gain: Number = parameter(1.0, "gain")


@dataclass(kw_only=True)
class Inputs:
    u1: Number = port(0.0, "input")
    u2: Number = port(0.0, "input")
    u3: Number = port(0.0, "input")
    u4: Number = port(0.0, "input")
    u5: Number = port(0.0, "input")
    u6: Number = port(0.0, "input")
    u7: Number = port(0.0, "input")
    u8: Number = port(0.0, "input")
    u9: Number = port(0.0, "input")
    u10: Number = port(0.0, "input")
    u11: Number = port(0.0, "input")
    u12: Number = port(0.0, "input")


@dataclass(kw_only=True)
class Outputs:
    y1: Number = output("output")
    y2: Number = output("output")
    y3: Number = output("output")
    y4: Number = output("output")
    y5: Number = output("output")
    y6: Number = output("output")
    y7: Number = output("output")
    y8: Number = output("output")
    y9: Number = output("output")
    y10: Number = output("output")
    y11: Number = output("output")
    y12: Number = output("output")
    y13: Number = output("output")


class Scalars(Memoryless):
    """Passes its inputs on."""

    def __init__(self, params: Params) -> None:
        self.params = params

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        return Outputs(
            y1=u.u1,
            y2=u.u2,
            y3=u.u3,
            y4=u.u4,
            y5=u.u5,
            y6=u.u6,
            y7=u.u7,
            y8=u.u8,
            y9=u.u9,
            y10=u.u10,
            y11=u.u11,
            y12=u.u12,
            y13=t + dt,
        )
