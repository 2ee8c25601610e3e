"""Start values as numbers; those lost as a unit enters initialization mode are set there again, or reported.

Both standards let parameters and start values be set before initialization mode and in it (FMI 2.0.4, sec. 4.2.4; FMI
3.0, sec. 2.3.2 and 2.3.3). Some units set all of them back as the experiment is set up.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.declarations import short_repr
from handover.cosim.blocks.start_values import numbers_of
from handover.cosim.blocks.variable import Kind, indices_of, subscript
from handover.cosim.fmu.buffers import SignalBuffer, Views, content_of
from handover.cosim.fmu.file.description import FmuDescription, FmuPort

_BOOLEANS = {"true": 1, "1": 1, "false": 0, "0": 0}

_ROUNDING = {4: 1e-6, 8: 1e-12}
"""Relative difference of reals by their width in bytes that is rounding, as by a unit that keeps degrees in radians."""


class LostValue(NamedTuple):
    """A value that did not hold: of which variable or element of one, what was set, and what the unit has instead."""

    name: str
    given: str
    found: str

    def __str__(self) -> str:
        return f"{self.name} was set to {self.given} and is {self.found}"


class Initializing(Protocol):
    """A unit in initialization mode, as `Instance` is."""

    @property
    def name(self) -> str:
        """Name of the instance."""
        ...

    @property
    def description(self) -> FmuDescription:
        """What its FMU declares."""
        ...

    def set_start(self, values: Mapping[str, Any]) -> None:
        """Set parameters or start values of other variables."""
        ...

    def read(self, ports: Sequence[FmuPort]) -> Sequence[SignalBuffer]:
        """Return buffers with the values of variables, without those that the unit does not give."""
        ...


def keep_start(unit: Initializing, values: Mapping[str, Any], fed: Collection[str]) -> list[LostValue]:
    """Set values that did not hold once more, in initialization mode, and return those that do not hold there either.

    Reals are equal up to rounding in their own width. What cannot be read is not judged, nor is an input that is `fed`
    by another unit, or a variable that is a guess or can be reached only while a clock ticks.

    Raises:
        UnitFailure: the unit answered Fatal.
    """
    ports = unit.description.settable
    judged = [p for p in (ports[name] for name in values if name not in fed) if not (p.clocks or p.guess)]
    lost = _lost(unit, judged, values)
    if not lost:
        return []
    unit.set_start({name: values[name] for name in lost})
    still = _lost(unit, [ports[name] for name in lost], values)
    return [value for lost_values in still.values() for value in lost_values]


def _lost(unit: Initializing, ports: Sequence[FmuPort], values: Mapping[str, Any]) -> dict[str, list[LostValue]]:
    buffers = unit.read(ports)  # which hold the memory of texts
    found = {name: views for buffer in buffers for name, views in buffer.views.items()}
    lost = {p.name: _differences(unit.name, p, values[p.name], found[p.name]) for p in ports if p.name in found}
    return {name: differences for name, differences in lost.items() if differences}


def _differences(unit: str, port: FmuPort, value: Any, views: Views) -> list[LostValue]:
    name = f"{unit}.{port.name}"
    if port.kind in (Kind.STRING, Kind.BINARY):
        is_text = port.kind is Kind.STRING
        given = str(value).encode() if is_text else bytes(value)
        found = content_of(port, views)[0 if is_text else 8 :]  # behind a binary's size
        texts = [data.decode(errors="replace") if is_text else data for data in (given, found)]
        return [] if given == found else [LostValue(name, *map(short_repr, texts))]
    numbers: NDArray[Any] = views[0]
    if port.kind is Kind.BOOLEAN:
        numbers = numbers != 0
    wanted = numbers_of(port, value).astype(numbers.dtype)
    if port.kind is Kind.REAL:
        differs = ~np.isclose(numbers, wanted, rtol=_ROUNDING[numbers.dtype.itemsize], atol=0.0)
    else:
        differs = numbers != wanted
    indices = indices_of(port.shape)
    elements = [(i, subscript(indices[i])) for i in np.flatnonzero(differs)]
    return [LostValue(name + index, f"{wanted[i].item()!r}", f"{numbers[i].item()!r}") for i, index in elements]


def entries_of(port: FmuPort, start: Mapping[str, Any]) -> list[Any]:
    """Return the entries of a port's start value, the given one or its FMU's; 0 where there is none."""
    if port.name in start:
        return numbers_of(port, start[port.name]).tolist()
    texts = (port.start or "0").split() or ["0"]
    entries = [parsed_number(port, text) for text in texts]
    return entries * port.size if len(entries) == 1 else entries


def parsed_number(port: FmuPort, text: str) -> int | float:
    """Return a number, boolean or item of a port that a text says.

    Raises:
        ValueError: it says none, with what would be right.
    """
    if port.kind is Kind.BOOLEAN:
        if text.lower() not in _BOOLEANS:
            raise ValueError("expected true, false, 1 or 0")
        return _BOOLEANS[text.lower()]
    if port.kind is Kind.ENUMERATION:
        items = {name.upper(): value for name, value in port.items} | {str(value): value for _, value in port.items}
        if text.upper() not in items:
            raise ValueError(f"expected one of {', '.join(name.lower() for name, _ in port.items)}")
        return items[text.upper()]
    try:
        return int(text) if port.kind is Kind.INTEGER else float(text)
    except ValueError:
        between = ", with commas between the entries of an array" if port.shape and len(text.split()) > 1 else ""
        raise ValueError(f"expected a {'whole ' if port.kind is Kind.INTEGER else ''}number{between}") from None
