"""Linear transformations of a signal between an output and an input, and those that convert between units.

A connection's transformation is either given by the user, as in an SSP file, or follows from the two ports' units.
"""

import math
from dataclasses import dataclass
from fractions import Fraction

from handover.cosim.blocks.units import UNKNOWN, Unit


@dataclass(frozen=True)
class LinearTransformation:
    """Value at the input = factor * value at the output + offset: two operations in double precision, each rounded."""

    factor: float = 1.0
    offset: float = 0.0

    @property
    def is_identity(self) -> bool:
        """Whether it leaves every value as it is."""
        return self == LinearTransformation()

    @property
    def fault(self) -> str | None:
        """What is wrong with it, and what would be valid, or None."""
        if math.isfinite(self.factor) and math.isfinite(self.offset):
            return None
        return f"factor {self.factor!r} and offset {self.offset!r} must be finite numbers"

    def __str__(self) -> str:
        if self.factor == 1.0:
            return f"plus {self.offset:.6g}"
        return f"times {self.factor:.6g}" + (f", plus {self.offset:.6g}" if self.offset else "")


_PI = Fraction("3.14159265358979323846264338327950288419716939937510582097494459")
_MAX_EXACT = 10**13  # a decimal fraction of more digits than this was cut off or rounded by the tool that wrote it
_MAX_DIVISOR = 1000
_ROUNDING = Fraction(1, 10**14)  # relative; tools write factors with 15 digits or more


def conversion(source: Unit, target: Unit) -> LinearTransformation:
    """Return the transformation that converts a value from a unit into another, each of its two numbers rounded once.

    From SI = f_s v + o_s = f_t w + o_t follows w = (f_s / f_t) v + (o_s - o_t) / f_t. Factors and offsets stand for the
    exact numbers that tools rounded, see `exact_number`: the factor from degrees to radians is the double nearest to
    pi/180, that from radians to degrees the one nearest to 180/pi.
    """
    f_s, o_s, f_t, o_t = (exact_number(x) for x in (source.factor, source.offset, target.factor, target.offset))
    return LinearTransformation(float(f_s / f_t), float((o_s - o_t) / f_t))


def needs_no_conversion(a: Unit, b: Unit) -> bool:
    """Return whether values pass unconverted: a unit is unknown, or both have one name and one is not defined."""
    return UNKNOWN in (a, b) or (a.symbol == b.symbol and not (a.defined and b.defined))


def exact_number(number: float) -> Fraction:
    """Return the exact number behind a rounded one, to 60 digits where it is a multiple of pi.

    A number of few digits is taken as that decimal fraction (0.001). One of many digits that is within rounding of p/q
    or pi p/q, with q up to 1000, is taken as that: 0.277777777777778 as 5/18, 0.0174532925199433 as pi/180.
    """
    decimal = Fraction(repr(number))
    if max(abs(decimal.numerator), decimal.denominator) < _MAX_EXACT:
        return decimal
    for scale in (Fraction(1), _PI):
        near = (decimal / scale).limit_denominator(_MAX_DIVISOR) * scale
        if abs(near - decimal) <= _ROUNDING * abs(decimal):
            return near
    return decimal
