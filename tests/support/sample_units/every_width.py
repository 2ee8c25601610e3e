"""A block with a port of every width of numbers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import (
    Int8,
    Int16,
    Int32,
    Single,
    UInt8,
    UInt16,
    UInt32,
    UInt64,
    Vector3,
    output,
    parameter,
    port,
)
from handover.cosim.blocks.units import Metre, Second
from support.sample_units.memoryless import Memoryless


@dataclass(frozen=True, kw_only=True)
class Params:
    shift: Int16 = parameter(0, "added to the Int8 output", minimum=-300, maximum=300)
    stretch: Single[Second] = parameter(0.1, "factor of the Float32 output", minimum=0.1, maximum=1e38)


@dataclass(kw_only=True)
class Inputs:
    x: Single[Metre] = port(0.1, "Float32")
    v: Single[Vector3[Metre]] = port(np.array([0.1, 0.2, 0.3]), "Float32 array")
    i8: Int8 = port(-128, "Int8", minimum=-128, maximum=127)
    u8: UInt8 = port(255, "UInt8")
    i16: Int16 = port(-(2**15), "Int16")
    u16: UInt16 = port(2**16 - 1, "UInt16")
    i32: Int32 = port(-(2**31), "Int32")
    u32: UInt32 = port(7, "UInt32")
    i64: int = port(9, "Int64")
    u64: UInt64 = port(11, "UInt64", maximum=2**64 - 1)


@dataclass(kw_only=True)
class Outputs:
    x_out: Single[Metre] = output("Float32")
    v_out: Single[Vector3[Metre]] = output("Float32 array")
    i8_out: Int8 = output("Int8")
    u8_out: UInt8 = output("UInt8")
    i16_out: Int16 = output("Int16")
    u16_out: UInt16 = output("UInt16")
    i32_out: Int32 = output("Int32")
    u32_out: UInt32 = output("UInt32")
    i64_out: int = output("Int64")
    u64_out: UInt64 = output("UInt64")
    reported: str = output("all inputs, as the block sees them")


class EveryWidth(Memoryless):
    """Gives its inputs back; the Int8 shifted, the Float32 stretched."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {f"{n}_out": (n,) for n in Inputs.__annotations__}

    def __init__(self, params: Params) -> None:
        self.params = params

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        p = self.params
        return Outputs(
            x_out=u.x * p.stretch,
            v_out=2.0 * u.v,
            i8_out=u.i8 + p.shift,
            u8_out=u.u8,
            i16_out=u.i16,
            u16_out=u.u16,
            i32_out=u.i32,
            u32_out=u.u32,
            i64_out=u.i64,
            u64_out=u.u64,
            reported=repr((u.x, u.v.tolist(), u.i8, u.u8, u.i16, u.u16, u.i32, u.u32, u.i64, u.u64)),
        )


@dataclass(frozen=True, kw_only=True)
class LongParams:
    most: UInt64 = parameter(2**64 - 1, "greatest of all", maximum=2**64 - 1)


@dataclass(kw_only=True)
class NoInputs:
    pass


@dataclass(kw_only=True)
class LongOutputs:
    most_out: UInt64 = output("the parameter")


class Long(Memoryless):
    """Gives its parameter back, which has more bits than FMI 2 knows."""

    def __init__(self, params: LongParams) -> None:
        self.params = params

    def step(self, t: float, dt: float, u: NoInputs) -> LongOutputs:  # noqa: ARG002
        return LongOutputs(most_out=self.params.most)
