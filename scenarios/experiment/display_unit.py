"""Display units of plots and tables: mm for small lengths, degrees for angles, kPa for high pressures.

rad/s stays: it is the unit of a pole's frequency as of an angular velocity, and the former in °/s is misread.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

_SMALL = ("°", "mm", "mm²", "ms", "g")
"""Units of which less than a thousandth is rarely of interest."""

_NOTHING = 1e-40
"""Magnitudes in SI units below which a value is shown as 0: no quantity is as small."""
_MOST_DIGITS = 7
_LEAST_FIXED, _MOST_FIXED = 1e-4, 1e9
"""Digits after the point at most, and between which magnitudes numbers are written without an exponent."""


@dataclass(frozen=True)
class DisplayUnit:
    """A unit to show values in: the factor from the SI value, and the unit's symbol, "" for pure numbers."""

    factor: float
    symbol: str

    def axis(self, quantity: str) -> str:
        """Return an axis's title: the quantity with the unit."""
        return f"{quantity} ({self.symbol})" if self.symbol else quantity

    def text(self, value: float) -> str:
        """Return a value with its unit, to four digits; small ones of small units to two digits or three decimals.

        So 40.68° stands beside 0.060°, not beside 0.05991°. Below 1e-4 of the unit there is an exponent; what is
        smaller than any quantity is 0.
        """
        if not math.isfinite(value):
            return "–"
        space = "" if self.symbol.startswith("°") else " "
        shown = 0.0 if abs(value) < _NOTHING else value * self.factor
        small = self.symbol in _SMALL and _LEAST_FIXED <= abs(shown) < 1.0
        digits = f"{shown:.{max(3, 1 - math.floor(math.log10(abs(shown))))}f}" if small else f"{shown:.4g}"
        return f"{digits}{space}{self.symbol}".rstrip()


def digits_after_point(values: ArrayLike) -> int:
    """Return with how many digits after the point to show all numbers of a column: the largest has four digits.

    It has five if the smallest that is not zero has less than two else. Whole numbers have none, others at most seven.
    """
    magnitudes = np.abs(np.asarray(values, dtype=np.float64))
    shown = magnitudes[np.isfinite(magnitudes) & (magnitudes >= _NOTHING)]
    if not shown.size or bool((shown == np.rint(shown)).all()):
        return 0
    largest, smallest = (math.floor(math.log10(float(x))) for x in (shown.max(), shown.min()))
    return min(_MOST_DIGITS, max(0, 3 - largest, min(1 - smallest, 4 - largest)))


def column_text(value: float, digits: int) -> str:
    """Return a number of a column with its digits after the point, or with an exponent where those do not suit it.

    An exponent have numbers from 1e9 on, and those below 1e-4 in a column of at least six digits.
    """
    tiny = digits >= _MOST_DIGITS - 1 and _NOTHING <= abs(value) < _LEAST_FIXED
    return f"{value:.3e}" if tiny or abs(value) >= _MOST_FIXED else f"{value:.{digits}f}"


def display_unit(unit: str, values: ArrayLike) -> DisplayUnit:
    """Return the unit in which to show values of an SI unit, by the largest of them."""
    magnitudes = np.abs(np.asarray(values, dtype=np.float64))
    finite = magnitudes[np.isfinite(magnitudes)]
    largest = float(finite.max()) if finite.size else 0.0
    smaller = {"m": (1.0, 1e3, "mm"), "m2": (1e-2, 1e6, "mm²"), "s": (0.1, 1e3, "ms"), "kg": (0.5, 1e3, "g")}
    if unit in smaller and largest < smaller[unit][0] and not (unit == "s" and largest == 0.0):
        return DisplayUnit(smaller[unit][1], smaller[unit][2])
    if unit == "s" and largest >= 3.6e4:
        return DisplayUnit(1 / 3600, "h")
    if unit == "rad":
        return DisplayUnit(180.0 / math.pi, "°")
    if unit == "B":
        return DisplayUnit(1e-6, "MB")
    if unit == "Pa" and largest >= 1e3:
        return DisplayUnit(1e-3, "kPa")
    return DisplayUnit(1.0, unit_symbol(unit))


def unit_symbol(unit: str) -> str:
    """Return an SI unit as it is written, such as "m²"; "" for pure numbers."""
    return "" if unit == "1" else unit.replace(".", "·").replace("m2", "m²").replace("s2", "s²").replace("s3", "s³")
