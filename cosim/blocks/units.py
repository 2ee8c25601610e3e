"""Physical units as part of a port's type: `Metre` is a float that is known to be in metres."""

import re
from dataclasses import dataclass, fields
from typing import Annotated

_SMALLEST, _LARGEST = 1e-100, 1e100  # beyond these, conversions would overflow or lose all digits


@dataclass(frozen=True, kw_only=True)
class BaseExponents:
    """Exponents of the SI base units (and the radian, as FMI counts it)."""

    kg: int = 0
    m: int = 0
    s: int = 0
    A: int = 0
    K: int = 0
    mol: int = 0
    cd: int = 0
    rad: int = 0

    def nonzero(self) -> dict[str, int]:
        """Return the exponents that are not zero, by base unit's name."""
        return {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name)}


@dataclass(frozen=True)
class Unit:
    """A unit: value in SI = factor * value + offset, of the dimension `base`.

    A foreign FMU may name a unit without defining it, or name none: then `defined` is False.
    """

    symbol: str
    base: BaseExponents = BaseExponents()
    factor: float = 1.0
    offset: float = 0.0
    defined: bool = True

    @property
    def is_usable(self) -> bool:
        """Whether values can be converted from and to it: factor and offset are of reasonable magnitude."""
        return _SMALLEST < abs(self.factor) < _LARGEST and abs(self.offset) < _LARGEST

    @property
    def shown(self) -> str:
        """The symbol beside a value, empty for numbers without a unit."""
        return "" if self.symbol == "1" else self.symbol

    def __str__(self) -> str:
        return self.symbol


ONE = Unit("1")
UNKNOWN = Unit("", defined=False)
"""The unit of a variable that declares none."""

Number = Annotated[float, ONE]
Metre = Annotated[float, Unit("m", BaseExponents(m=1))]
SquareMetre = Annotated[float, Unit("m2", BaseExponents(m=2))]
MetrePerSecond = Annotated[float, Unit("m/s", BaseExponents(m=1, s=-1))]
MetrePerSecond2 = Annotated[float, Unit("m/s2", BaseExponents(m=1, s=-2))]
Radian = Annotated[float, Unit("rad", BaseExponents(rad=1))]
RadianPerSecond = Annotated[float, Unit("rad/s", BaseExponents(rad=1, s=-1))]
Second = Annotated[float, Unit("s", BaseExponents(s=1))]
Hertz = Annotated[float, Unit("Hz", BaseExponents(s=-1))]
PerSecond = Annotated[float, Unit("1/s", BaseExponents(s=-1))]
Kilogram = Annotated[float, Unit("kg", BaseExponents(kg=1))]
KilogramMetre2 = Annotated[float, Unit("kg.m2", BaseExponents(kg=1, m=2))]
Newton = Annotated[float, Unit("N", BaseExponents(kg=1, m=1, s=-2))]
NewtonMetre = Annotated[float, Unit("N.m", BaseExponents(kg=1, m=2, s=-2))]
NewtonMetre2 = Annotated[float, Unit("N.m2", BaseExponents(kg=1, m=3, s=-2))]
NewtonPerMetre = Annotated[float, Unit("N/m", BaseExponents(kg=1, s=-2))]
NewtonSecondPerMetre = Annotated[float, Unit("N.s/m", BaseExponents(kg=1, s=-1))]
RadianPerSecond2 = Annotated[float, Unit("rad/s2", BaseExponents(rad=1, s=-2))]
SecondPerMetre = Annotated[float, Unit("s/m", BaseExponents(m=-1, s=1))]
PerMetre = Annotated[float, Unit("1/m", BaseExponents(m=-1))]
PerSecond2 = Annotated[float, Unit("1/s2", BaseExponents(s=-2))]
PerSecond3 = Annotated[float, Unit("1/s3", BaseExponents(s=-3))]
NewtonSecond = Annotated[float, Unit("N.s", BaseExponents(kg=1, m=1, s=-1))]
NewtonMetrePerRadian = Annotated[float, Unit("N.m/rad", BaseExponents(kg=1, m=2, s=-2, rad=-1))]
NewtonMetreSecondPerRadian = Annotated[float, Unit("N.m.s/rad", BaseExponents(kg=1, m=2, s=-1, rad=-1))]
Pascal = Annotated[float, Unit("Pa", BaseExponents(kg=1, m=-1, s=-2))]
NewtonMetre2PerPascal = Annotated[float, Unit("N.m2/Pa", BaseExponents(m=4))]
Ampere = Annotated[float, Unit("A", BaseExponents(A=1))]
NewtonMetrePerAmpere = Annotated[float, Unit("N.m/A", BaseExponents(kg=1, m=2, s=-2, A=-1))]
Tick = Annotated[float, Unit("tick")]
"""Steps of an analogue-to-digital converter."""
PerTick = Annotated[float, Unit("1/tick")]
Pixel = Annotated[float, Unit("px")]
_SYMBOLS = (
    *("m", "g", "s", "A", "K", "mol", "cd", "rad", "sr", "Hz", "N", "Pa", "J", "W", "C", "V", "F", "Ohm", "ohm", "S"),
    *("Wb", "T", "H", "degC", "lm", "lx", "Bq", "Gy", "Sv", "kat", "deg", "min", "h", "d", "l", "L", "t", "eV", "bar"),
    *("B", "bit", "px", "tick", "levels", "rev", "rpm", "dB"),
)
_SYMBOL = rf"(?:da|[afpnuµmcdhkMGTPE])?(?:{'|'.join(_SYMBOLS)})-?\d*"
_WRITTEN_UNIT = re.compile(
    rf"(?:1|%|°C?|{_SYMBOL}(?:[.*·]{_SYMBOL})*)(?:/{_SYMBOL}|/\({_SYMBOL}(?:[.*·]{_SYMBOL})*\))*"
)


def is_written_unit(symbol: str) -> bool:
    """Return whether a text is a unit as FMI writes it, of SI's or another known symbol: `m/s2`, `N.m`, `1`."""
    return _WRITTEN_UNIT.fullmatch(symbol) is not None


Levels = Annotated[float, Unit("levels")]
"""Brightness steps of an 8-bit picture."""
