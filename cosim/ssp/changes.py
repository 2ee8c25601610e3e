"""Linear changes of values one after another, and those that units need."""

from handover.cosim.blocks.units import Unit
from handover.cosim.system.conversion import Linear, conversion, pass_as_they_are


def applied(change: Linear, number: float) -> float:
    """Return a number after a change."""
    return change.factor * number + change.offset


def chained(first: Linear, following: Linear) -> Linear:
    """Return the change that makes two, one after the other."""
    return Linear(following.factor * first.factor, following.factor * first.offset + following.offset)


def converted(source: Unit, target: Unit) -> Linear | None:
    """Return what makes numbers in one unit numbers in another, None where they are alike or one is not told.

    Raises:
        ValueError: they differ in dimension, or one of two that differ in name is not defined.
    """
    if pass_as_they_are(source, target):
        return None
    if not (source.defined and target.defined):
        undefined = (target if source.defined else source).symbol
        told = f"{source.symbol!r} cannot be converted to {target.symbol!r}"
        raise ValueError(f"{told}: the unit {undefined!r} is not defined")
    if source.base != target.base:
        raise ValueError(f"{source.symbol!r} cannot be converted to {target.symbol!r}: they differ in dimension")
    try:
        change = conversion(source, target)
    except OverflowError:
        raise ValueError(f"{source.symbol!r} is too large or too small to be converted to {target.symbol!r}") from None
    return None if change.is_identity else change
