"""What is wrong with units as they are placed in a system, and with connections of ports: faults in words."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from handover.cosim.blocks.start_values import fault_of
from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import nearest
from handover.cosim.fmu.file.clocks import FmuClock
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.system.conversion import LinearTransformation, needs_no_conversion


def value_faults(unit: str, description: FmuDescription, start: Mapping[str, Any]) -> list[str]:
    """Return which start values of a unit it does not have, or cannot take."""
    ports = description.settable
    faults: list[str] = []
    for name, value in start.items():
        if name not in ports:
            faults.append(f"{unit} has no parameter or input {name!r}; {nearest(name, ports)}")
            continue
        fault = fault_of(ports[name], value)
        if fault:
            faults.append(f"{unit}.{name}: {fault}")
    return faults


def clock_mismatch(a: FmuClock | None, b: FmuClock | None) -> str | None:
    """Return why two clocks cannot be connected, or None if they can; an end that is no clock is None."""
    if a is None or b is None:
        return "a clock can be connected with a clock only"
    if a.is_input or not b.is_input:
        return "an output clock triggers an input clock, not the other way round"
    if not b.is_triggered:
        return "it is time-based; only a triggered input clock can be connected"
    return None


def event_faults(name: str, description: FmuDescription, sampled: bool) -> list[str]:
    """Return why a unit's clocked ports cannot be accessed as it is placed: that takes event mode."""
    d = description
    clocked = sorted(p.name for p in (*d.inputs.values(), *d.outputs.values()) if p.clocks)
    if not clocked:
        return []
    fault = f"{name}: {', '.join(clocked)} can be reached only while a clock ticks, in event mode"
    if not d.capabilities.event_mode:
        return [f"{fault}, which its FMU does not have (hasEventMode)"]
    return [f"{fault}; it cannot be placed as a sampled unit, which runs without"] if sampled else []


def once_faults(units: Iterable[tuple[str, FmuDescription]]) -> list[str]:
    """Return which FMUs are placed more than once though a process may hold only one instance of them."""
    placed: Mapping[Path, list[str]] = defaultdict(list)
    for name, d in units:
        if d.capabilities.once_per_process:
            placed[d.path.resolve()].append(name)
    return [
        f"{' and '.join(names)} are one FMU, {path.name}, of which a process may hold one instance only "
        "(canBeInstantiatedOnlyOncePerProcess)"
        for path, names in placed.items()
        if len(names) > 1
    ]


def mismatch(a: FmuPort, b: FmuPort, transformation: LinearTransformation | None = None) -> str | None:
    """Return why an output cannot feed an input, or None."""
    if a.kind is not b.kind:
        return f"{a.kind.value} cannot feed {b.kind.value}"
    if a.shape != b.shape:
        return "their shapes differ"
    if transformation is not None:
        return transformation.fault if a.kind is Kind.REAL else f"{a.kind.value} takes no linear transformation"
    if a.kind is Kind.REAL and (fault := _unit_mismatch(a.unit, b.unit)):
        return fault
    if a.kind is Kind.ENUMERATION and a.items != b.items:
        return "their enumerations have other items"
    if a.kind is Kind.BINARY and a.mime != b.mime:
        return "their MIME types differ"
    return None


def _unit_mismatch(a: Unit, b: Unit) -> str | None:
    """Compare units by their definitions, not by their names; a variable without a unit fits any."""
    if needs_no_conversion(a, b):
        return None
    if not (a.defined and b.defined):
        undefined = b.symbol if a.defined else a.symbol
        return f"the unit {undefined!r} is not defined in its FMU, so it cannot be compared"
    if a.base != b.base:
        return "their units differ in dimension"
    unusable = next((u for u in (a, b) if not u.is_usable), None)
    if unusable is not None and a != b:
        return f"the unit {unusable.symbol!r} has the factor {unusable.factor!r} and the offset {unusable.offset!r}"
    return None
