"""A system whose free inputs are set from outside; and one in which a unit is left out, whose place a program takes.

No unit is replaced by another kind of object: the inputs that no output feeds, those that the left out unit fed among
them, follow a `HeldValue`, which the master passes to the real units at their communication points.
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.start_values import fault_of, numbers_of
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import nearest
from handover.cosim.fmu.buffers import Views
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.fmu.start_values import entries_of
from handover.cosim.system.conversion import LinearTransformation
from handover.cosim.system.system import Connection, PlacedUnit, PortName, System
from handover.cosim.system.time_series import HeldValue
from handover.scenarios.api.arguments import InvalidInput

HELD_KINDS = (Kind.REAL, Kind.INTEGER, Kind.BOOLEAN, Kind.ENUMERATION)
"""Kinds of values that can be set from outside."""

_TYPES: Mapping[Kind, Any] = {Kind.REAL: np.float64, Kind.BOOLEAN: np.bool_}


@dataclass(frozen=True)
class VacantPlace:
    """The place of a unit that is left out: what it was fed, what it fed, and its outputs as they are set.

    Attributes:
        unit: as it was placed.
        sources: by its inputs that are wired, the outputs that fed them, and how values are converted.
        targets: by its outputs that are wired, the inputs that they fed, likewise.
        outputs: memory of its outputs, other than texts and binaries, as observers see it.
    """

    unit: PlacedUnit
    sources: Mapping[str, tuple[PortName, LinearTransformation | None]]
    targets: Mapping[str, Sequence[tuple[PortName, LinearTransformation | None]]]
    outputs: Mapping[str, Views] = field(default_factory=dict[str, Views])

    @property
    def ports(self) -> dict[str, FmuPort]:
        """The outputs that can be set, by name."""
        return {name: self.unit.description.outputs[name] for name in self.outputs}


class OpenSystem:
    """A system with free inputs to be set, made of a checked system, which is not changed.

    Attributes:
        system: what a master runs.
        place: the place of the unit that is left out; None where there is none.
        free: the free inputs by name, `unit.port`, with their values.

    Raises:
        InvalidInput: there is no unit of that name, it is the only one, or it feeds texts or binaries to others.
    """

    def __init__(self, system: System, left_out: str | None = None) -> None:
        if left_out is not None:
            _check_place(system, left_out)
        self.system, self.free = copy.copy(system), dict[str, HeldValue]()
        if left_out is not None:
            self.system.remove(left_out)
        for name, unit in self.system.units.items():
            fed = {*self.system.fed_inputs(name)}
            for port in unit.description.inputs.values():
                if port.name not in fed and port.kind in HELD_KINDS and not port.clocks:
                    self._hold(PortName(name, port.name), port, unit.start)
        self.place = None if left_out is None else self._place(system, left_out)

    def set(self, name: str, value: Any) -> None:
        """Set a free input, in its own unit.

        Raises:
            InvalidInput: it is not a value of the input.
        """
        unit, port = self.split(name)
        self.free[name].set(checked_numbers(name, self.system.units[unit].description.inputs[port], value))

    def set_output(self, port: str, value: Any) -> None:
        """Set an output of the unit that is left out, and the inputs that it fed.

        Raises:
            InvalidInput: it is not a value of the output.
        """
        assert self.place is not None, "a unit is left out"
        place = self.place
        numbers = checked_numbers(f"{place.unit.name}.{port}", place.ports[port], value)
        place.outputs[port][0][:] = numbers
        for target, change in place.targets.get(port, ()):
            converted = numbers if change is None else numbers * change.factor + change.offset
            self.free[str(target)].set(converted)

    def split(self, name: str) -> tuple[str, str]:
        """Return unit and port of a port's qualified name, both of which may have dots in them.

        Raises:
            KeyError: there is no such unit.
        """
        units = [*self.system.units, *(() if self.place is None else (self.place.unit.name,))]
        owner = max((u for u in units if str(name).startswith(f"{u}.")), key=len, default=None)
        if owner is None and name in units:
            raise KeyError(f"{name!r} is a unit; expected one of its ports, such as '{name}.port'")
        if owner is None:
            raise KeyError(f"no unit in {name!r}, such as 'unit.port'; {nearest(str(name).partition('.')[0], units)}")
        return owner, name[len(owner) + 1 :]

    def _hold(self, target: PortName, port: FmuPort, start: Mapping[str, Any]) -> None:
        held = HeldValue(np.array(entries_of(port, start), dtype=_TYPES.get(port.kind, np.int64)))
        self.free[str(target)] = held
        self.system.follow(target, held)

    def _place(self, system: System, name: str) -> VacantPlace:
        unit, sources = system.units[name], dict[str, tuple[PortName, LinearTransformation | None]]()
        targets: dict[str, list[tuple[PortName, LinearTransformation | None]]] = {}
        for c in system.connections:
            if c.source.unit == name and not _is_clock(system, c):
                targets.setdefault(c.source.port, []).append((c.target, system.transformation_of(c)))
            if c.target.unit == name and not _is_clock(system, c):
                sources[c.target.port] = c.source, system.transformation_of(c)
        outputs = {p.name: self._memory(p, targets) for p in unit.description.outputs.values() if p.kind in HELD_KINDS}
        return VacantPlace(unit, sources, targets, outputs)

    def _memory(
        self, port: FmuPort, targets: Mapping[str, Sequence[tuple[PortName, LinearTransformation | None]]]
    ) -> Views:
        """Return memory of an output that nobody has set: as the input that it feeds starts, or as it is declared."""
        values: NDArray[Any] = np.array(entries_of(port, {}), dtype=_TYPES.get(port.kind, np.int64))
        for target, change in targets.get(port.name, ()):
            if change is None:
                values[:] = self.free[str(target)].entries
        if port.items and int(values[0]) not in [value for _, value in port.items]:
            values[:] = port.items[0][1]
        if port.kind is Kind.REAL:
            np.clip(values, port.minimum, port.maximum, out=values)
        return (values,)


def checked_numbers(name: str, port: FmuPort, value: Any) -> NDArray[Any]:
    """Return a value of a port as numbers in row-major order.

    Raises:
        InvalidInput: it is none, with what would be right.
    """
    given: Any = value.item() if hasattr(value, "item") and not getattr(value, "shape", ()) else value
    if fault := fault_of(port, given):
        raise InvalidInput(f"{name}: {fault}")
    return np.asarray(numbers_of(port, given)).astype(_TYPES.get(port.kind, np.int64))


def _is_clock(system: System, c: Connection) -> bool:
    return c.target.port in system.units[c.target.unit].description.clocks


def _check_place(system: System, name: str) -> None:
    if name not in system.units:
        raise InvalidInput(f"no unit {name!r} whose place could be taken; {nearest(name, system.units)}")
    if len(system.units) == 1:
        raise InvalidInput(f"{name} is the only unit: without it there is nothing to run")
    outputs = system.units[name].description.outputs
    unheld = [
        f"{c.source} is a {outputs[c.source.port].kind.value}"
        for c in system.connections
        if c.source.unit == name and c.source.port in outputs and outputs[c.source.port].kind not in HELD_KINDS
    ]
    if unheld:
        raise InvalidInput(f"the place of {name} cannot be taken: {'; '.join(unheld)}, which cannot be set from Python")
