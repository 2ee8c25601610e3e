"""What cannot be meant by a declaration's bounds or its start value, whatever block it is of."""

import numbers
from typing import Any

import numpy as np

from handover.cosim.variable import Kind, Variable

_TYPES: dict[Kind, tuple[tuple[type[Any], ...], str]] = {
    Kind.REAL: ((numbers.Real,), "a number, such as 0.0"),
    Kind.INTEGER: ((numbers.Integral,), "a whole number, such as 0"),
    Kind.BOOLEAN: ((bool, np.bool_), "True or False"),
    Kind.STRING: ((str,), 'a text, such as ""'),
    Kind.BINARY: ((bytes,), 'bytes, such as b""'),
}


def bounds_fault(v: Variable) -> str:
    """Return what is wrong with a variable's bounds; empty if nothing is."""
    for what, bound in (("minimum", v.minimum), ("maximum", v.maximum)):
        if bound is not None and (not isinstance(bound, numbers.Real) or bound != bound):
            return f"{what} {bound!r} is not a number"
    if v.minimum is not None and v.maximum is not None and v.minimum > v.maximum:
        return f"its minimum {v.minimum!r} is above its maximum {v.maximum!r}; are they swapped?"
    return ""


def start_fault(v: Variable) -> str:
    """Return what is wrong with the type or the shape of a variable's start value; empty if nothing is."""
    start = v.start
    if v.raster is not None:
        return _array_fault(start, (v.raster.height, v.raster.width, 3))
    if v.shape:
        return _array_fault(start, v.shape)
    if v.enumeration is not None:
        first = next(iter(v.enumeration))
        wanted = f"an item of {v.enumeration.__name__}, such as {v.enumeration.__name__}.{first.name}"
        return "" if isinstance(start, v.enumeration) else f"start {_told(start)} is not {wanted}"
    types, wanted = _TYPES[v.kind]
    fits = isinstance(start, types) and (v.kind is Kind.BOOLEAN or not isinstance(start, bool))
    return "" if fits else f"start {_told(start)} is not {wanted}"


def _array_fault(start: Any, shape: tuple[int, ...]) -> str:
    try:
        given = None if start is None else _shape(start)
    except (TypeError, ValueError):
        given = None
    if given is None:
        return f"start {_told(start)} is not an array of numbers, such as np.zeros({shape})"
    return f"start has the shape {given} where {shape} is declared" if given != shape else ""


def _shape(start: Any) -> tuple[int, ...]:
    """Return the shape of what can be made an array of numbers; a picture, which is large, is left as it is."""
    return np.shape(start) if getattr(start, "dtype", None) == np.uint8 else np.asarray(start, dtype=np.float64).shape


def _told(value: Any) -> str:
    told = repr(value)
    return told if len(told) < 80 else told[:77] + "..."
