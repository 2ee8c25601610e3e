"""A block that declares what is seldom declared: units with factor and offset, enumerations with gaps, odd texts."""

import enum
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, ClassVar

import numpy as np

from handover.cosim.blocks.ports import Vector2, output, parameter, port
from handover.cosim.blocks.units import BaseExponents, Metre, Number, Unit
from support.sample_units.memoryless import Memoryless

Kilometre = Annotated[float, Unit("km", BaseExponents(m=1), factor=1000.0)]
Degree = Annotated[float, Unit("deg", BaseExponents(rad=1), factor=np.pi / 180)]
Fahrenheit = Annotated[float, Unit("°F", BaseExponents(K=1), factor=5 / 9, offset=273.15 - 32 * 5 / 9)]


class Gear(enum.IntEnum):
    REVERSE = -4
    IDLE = 1
    FIRST = 5
    SECOND = 11


@dataclass(frozen=True, kw_only=True)
class Params:
    gear: Gear = parameter(Gear.FIRST, 'a "gear" <of> 5 & more, größer – 100 %\nsecond line', minimum=-2, maximum=5)
    label: str = parameter(" a<b & \"c\"\n\t'd' größer ", "text")
    wide: Vector2[Kilometre] = parameter(np.array([0.1, 1e-300]), "bounds on every entry", minimum=0.0, maximum=0.5)
    free: Number = parameter(1 / 3, "bounds that bind nothing", minimum=-np.inf, maximum=np.inf)
    empty: str = parameter("", "text")


@dataclass(kw_only=True)
class Inputs:
    heading: Degree = port(-90.0, "angle", minimum=-180.0, maximum=180.0)
    heat: Fahrenheit = port(72.5, "temperature")
    count: int = port(-3, "count", minimum=-5)
    data: bytes = port(b"", "any bytes")


@dataclass(kw_only=True)
class Outputs:
    way: Vector2[Kilometre] = output("way", minimum=-1.0)
    x: Metre = output("place")
    gear_out: Gear = output("gear", maximum=5)
    data_out: bytes = output("the bytes")
    reported: str = output("the label")
    on: bool = output("switch")


class Declarations(Memoryless):
    """Gives back what it was given."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"data_out": ("data",), "way": ("heading", "heat")}

    def __init__(self, params: Params) -> None:
        self.params = params

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:
        p = self.params
        way = np.array([u.heading, u.heat])
        return Outputs(way=way, x=t + dt, gear_out=p.gear, data_out=u.data, reported=p.label, on=u.count > 0)


@dataclass(kw_only=True)
class InputsWithoutData:
    heading: Degree = port(-90.0, "angle", minimum=-180.0, maximum=180.0)
    heat: Fahrenheit = port(72.5, "temperature")
    count: int = port(-3, "count", minimum=-5)


@dataclass(kw_only=True)
class OutputsWithoutData:
    way: Vector2[Kilometre] = output("way", minimum=-1.0)
    gear_out: Gear = output("gear", maximum=5)
    reported: str = output("the label")


class WithoutData(Memoryless):
    """The same without bytes, which FMI 2 does not know; sampled."""

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = {"way": ("heading", "heat")}
    period: ClassVar[Fraction | None] = Fraction(1, 8)

    def __init__(self, params: Params) -> None:
        self.params = params

    def step(self, t: float, dt: float, u: InputsWithoutData) -> OutputsWithoutData:  # noqa: ARG002
        p = self.params
        return OutputsWithoutData(way=np.array([u.heading, u.heat]), gear_out=p.gear, reported=p.label)
