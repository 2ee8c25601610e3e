"""Checks values for parameters and inputs against their declarations, and flattens them to arrays of numbers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.declarations import declared_variables, short_repr
from handover.cosim.blocks.variable import Causality, Declared, Kind


def fault_of(port: Declared, value: Any) -> str | None:
    """Return what is wrong with a value for a port, with the valid values, or None."""
    if port.kind in (Kind.STRING, Kind.BINARY):
        wanted = str if port.kind is Kind.STRING else (bytes, bytearray, memoryview)
        return None if isinstance(value, wanted) else f"{short_repr(value)} is not a {port.kind.value}"
    if port.kind is Kind.BOOLEAN and not isinstance(value, (bool, np.bool_)):
        return f"{short_repr(value)} is neither true nor false"
    if port.kind is Kind.ENUMERATION and isinstance(value, str):
        if value.upper() not in [name.upper() for name, _ in port.items]:
            return f"{short_repr(value)} is none of {', '.join(name.lower() for name, _ in port.items)}"
        return None
    try:
        numbers = numbers_of(port, value)
    except (TypeError, ValueError):
        return f"{short_repr(value)} is not {_wanted(port)}"
    if not np.all(np.isfinite(numbers)):
        return f"{short_repr(value)} is not finite"
    if port.kind is not Kind.REAL and not np.all(numbers == np.round(numbers)):
        return f"{short_repr(value)} is not {_wanted(port)}"
    if port.kind is Kind.ENUMERATION and int(numbers[0]) not in [v for _, v in port.items]:
        return f"{short_repr(value)} is none of {', '.join(f'{v} ({n.lower()})' for n, v in port.items)}"
    return _range_fault(port, value, numbers) or _width_fault(port, value, numbers)


def parameter_faults(params: Any) -> list[str]:
    """Return everything that is wrong with a block's parameters, an instance of its `Params` dataclass."""
    owner: Any = params.__class__
    variables = declared_variables(owner, Causality.PARAMETER)
    faults = [(v.name, fault_of(v, getattr(params, v.name))) for v in variables]
    return [f"{name}: {fault}" for name, fault in faults if fault]


def numbers_of(port: Declared, value: Any) -> NDArray[Any]:
    """Return a value as numbers in row-major order; enumerations may be given by name.

    Raises:
        ValueError: the shape is not the port's, or the entries are not numbers.
    """
    if port.kind is Kind.ENUMERATION and isinstance(value, str):
        value = {name.upper(): v for name, v in port.items}[value.upper()]
    array = np.asarray(value)
    if array.dtype.kind == "b" and port.kind is not Kind.BOOLEAN:
        raise ValueError("true and false are no numbers")
    is_integer = port.kind in (Kind.INTEGER, Kind.ENUMERATION) and array.dtype.kind in "iu"
    if not is_integer:  # large integers would lose digits as floats
        array = np.asarray(array, dtype=np.float64)
    if array.shape != port.shape:
        raise ValueError(f"shape {array.shape} where {port.shape} is wanted")
    return array.reshape(-1)


def range_of(port: Declared) -> str:
    """Return a port's range in words, with the unit; empty where it has none."""
    low, high = port.minimum, port.maximum
    unit = f" {port.unit.shown}" if port.unit.shown else ""
    if low is not None and high is not None:
        return f"from {low:g} to {high:g}{unit}"
    if low is not None:
        return f"at least {low:g}{unit}"
    return "" if high is None else f"at most {high:g}{unit}"


def _wanted(port: Declared) -> str:
    what = "a whole number" if port.kind in (Kind.INTEGER, Kind.ENUMERATION) else "a number"
    unit = f" in {port.unit.shown}" if port.unit.shown else ""
    if port.shape:
        return f"an array of shape [{','.join(map(str, port.shape))}] of numbers{unit}"
    return what + unit


def _range_fault(port: Declared, value: Any, numbers: NDArray[Any]) -> str | None:
    low, high = port.minimum, port.maximum
    if (low is None or np.all(numbers >= low)) and (high is None or np.all(numbers <= high)):
        return None
    return f"{short_repr(value)} is out of range: {range_of(port)}"


def _width_fault(port: Declared, value: Any, numbers: NDArray[Any]) -> str | None:
    if port.width is None or all(port.width.holds(number) for number in numbers.tolist()):
        return None
    return f"{short_repr(value)} does not fit {port.width.range_text}"
