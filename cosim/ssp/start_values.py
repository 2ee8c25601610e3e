"""Converts values as an SSP writes them, in units and through transformations, to start values of a unit's ports."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.cosim.blocks.units import UNKNOWN, Unit
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import counted
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.ssp.connected_ports import Entry
from handover.cosim.ssp.parameter_set import SspValue
from handover.cosim.system.conversion import LinearTransformation, conversion, needs_no_conversion

_BOOLEANS = {"true": True, "1": True, "false": False, "0": False}


def applied(change: LinearTransformation, number: float) -> float:
    """Return a number transformed."""
    return change.factor * number + change.offset


def chained(first: LinearTransformation, following: LinearTransformation) -> LinearTransformation:
    """Return the composition of two transformations."""
    return LinearTransformation(following.factor * first.factor, following.factor * first.offset + following.offset)


def converted(source: Unit, target: Unit) -> LinearTransformation | None:
    """Return the conversion from one unit to another, None where numbers pass as they are.

    They do so where a unit is unknown or not defined; of the latter `unit_doubt` says so.

    Raises:
        ValueError: they differ in dimension.
    """
    if needs_no_conversion(source, target) or not (source.defined and target.defined):
        return None
    if source.base != target.base:
        raise ValueError(f"{source.symbol!r} cannot be converted to {target.symbol!r}: they differ in dimension")
    try:
        change = conversion(source, target)
    except OverflowError:
        raise ValueError(f"{source.symbol!r} is too large or too small to be converted to {target.symbol!r}") from None
    return None if change.is_identity else change


def unit_doubt(source: Unit, target: Unit) -> str:
    """Return that numbers pass as they are between two units of which one is not defined; empty where both are."""
    if needs_no_conversion(source, target) or (source.defined and target.defined):
        return ""
    undefined = (target if source.defined else source).symbol
    text = f"{source.symbol!r} cannot be converted to {target.symbol!r}"
    return f"{text}: the unit {undefined!r} is not defined, so numbers are taken as they are"


@dataclass(frozen=True)
class Given:
    """A value for a variable, or for a connector of a system that feeds it.

    `unit` is that of the connector, and `then` the transformation from there to the variable; both are left out of
    values for the variable itself.
    """

    value: SspValue
    unit: Unit = UNKNOWN
    then: LinearTransformation | None = None


def start_value_doubts(given: Mapping[str, tuple[Entry, Given]]) -> list[str]:
    """Return the values whose unit is not defined, a line each."""
    doubts = {
        f"{g.value.where}{name}: ": unit_doubt(g.value.unit, port.unit if g.unit == UNKNOWN else g.unit)
        for name, ((port, _), g) in given.items()
        if port.kind is Kind.REAL and not g.value.keeps_units
    }
    return [where + doubt for where, doubt in doubts.items() if doubt]


def start_values(given: Mapping[str, tuple[Entry, Given]]) -> tuple[dict[str, Any], set[str], list[str]]:
    """Return a unit's start values by port, the arrays of which only some entries are given, and all faults.

    Given entries of those arrays have values of their own, by names such as `p[1]`.
    """
    values: dict[str, Any] = {}
    entries: dict[str, dict[int, Any]] = {}
    ports: dict[str, FmuPort] = {}
    faults: list[str] = []
    for name, ((port, index), source) in given.items():
        try:
            value = _value(port, index, source)
        except ValueError as e:
            faults.append(f"{source.value.where}{name}: {e}")
            continue
        if index is None:
            values[port.name] = value
        else:
            entries.setdefault(port.name, {})[index] = value
            ports[port.name] = port
    partly = {n for n, by_index in entries.items() if len(by_index) < ports[n].size}
    for name, by_index in entries.items():
        if name in partly:
            names = ports[name].entry_names
            values |= {names[k]: value for k, value in by_index.items()}
        else:
            values[name] = np.array([by_index[k] for k in range(len(by_index))]).reshape(ports[name].shape)
    return values, partly, faults


def _value(port: FmuPort, index: int | None, given: Given) -> Any:
    value, shape = given.value, port.shape if index is None else ()
    size = port.size if index is None else 1
    if len(value.texts) != size:
        raise ValueError(f"{len(value.texts)} values where {counted(size, 'is', 'are')} right")
    if port.kind is not Kind.REAL:
        if (given.then or value.linear) is not None:
            raise ValueError(f"a linear transformation of {port.kind.value} values; only reals can be transformed")
        return _shaped([_parsed(port, value.type_name, text) for text in value.texts], shape)
    if value.type_name in ("Boolean", "String", "Enumeration", "Binary"):
        raise ValueError(f"it is real, and the value given is of type {value.type_name}")
    numbers = [_float(text) for text in value.texts]
    target = port.unit if given.unit == UNKNOWN else given.unit
    unit_change = None if value.keeps_units else converted(value.unit, target)
    for change in (unit_change, value.linear, given.then):
        numbers = numbers if change is None else [applied(change, x) for x in numbers]
    return _shaped(numbers, shape)


def _parsed(port: FmuPort, type_name: str, text: str) -> Any:
    whole = type_name == "Integer" or "Int" in type_name
    if port.kind is Kind.INTEGER and whole:
        return _int(text)
    if port.kind is Kind.ENUMERATION and (type_name == "Enumeration" or whole):
        return _int(text) if whole else text
    if port.kind is Kind.BOOLEAN and type_name == "Boolean":
        if text not in _BOOLEANS:
            raise ValueError(f"{text[:80]!r} is neither true nor false")
        return _BOOLEANS[text]
    if port.kind is Kind.STRING and type_name == "String":
        return text
    if port.kind is Kind.BINARY and type_name == "Binary":
        return bytes.fromhex(text)
    raise ValueError(f"it is {port.type_name}, and the value given is of type {type_name}")


def _shaped(values: Sequence[Any], shape: tuple[int, ...]) -> Any:
    return np.array(values).reshape(shape) if shape else values[0]


def _float(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text[:80]!r} is not a number") from None


def _int(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"{text[:80]!r} is not a whole number") from None
