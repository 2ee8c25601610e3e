"""Linear changes of values on their way from an output to an input, such as from degrees to radians."""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from cosim.units import Unit

Real = TypeVar("Real", float, NDArray[np.float64])


@dataclass(frozen=True)
class Linear:
    """target = factor * source + offset, the source in its own unit and the target in its own."""

    factor: float = 1.0
    offset: float = 0.0

    def __call__(self, value: Real) -> Real:
        """Return the target's value for a source's."""
        return self.factor * value + self.offset

    def then(self, following: "Linear") -> "Linear":
        """Return the change that does this one first and the following one on its result."""
        return Linear(following.factor * self.factor, following.factor * self.offset + following.offset)


def conversion(source: Unit, target: Unit) -> Linear:
    """Return the change of numbers in one unit to numbers in another one of the same dimension.

    Raises:
        ValueError: a unit is not defined, or they differ in dimension.
    """
    if not (source.defined and target.defined):
        raise ValueError(f"the unit {(target if source.defined else source).symbol!r} is not defined")
    if source.base != target.base:
        raise ValueError(f"{source.symbol!r} cannot be converted to {target.symbol!r}: they differ in dimension")
    return Linear(source.factor / target.factor, (source.offset - target.offset) / target.factor)
