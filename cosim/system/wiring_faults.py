"""What is wrong with units as they are placed in a system, and with connections of ports: faults in words."""

from collections.abc import Mapping
from typing import Any

from handover.cosim.blocks.start_values import fault_of
from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import ELEMENT, Kind
from handover.cosim.exceptions import hints, nearest
from handover.cosim.fmu.file.clocks import FmuClock
from handover.cosim.fmu.file.default_experiment import proposed_step
from handover.cosim.fmu.file.description import FmuDescription, FmuPort
from handover.cosim.system.conversion import LinearTransformation, needs_no_conversion
from handover.cosim.system.port_names import BY_ENTRIES, Connection, PlacedUnit, PortName
from handover.cosim.system.time_series import ExternalSource, TimeSeries, external_fault


def value_faults(unit: str, description: FmuDescription, start: Mapping[str, Any]) -> list[str]:
    """Return which start values of a unit it does not have, or cannot take."""
    ports = description.settable
    unknown = hints((name for name in start if name not in ports), ports)
    faults = [f"{unit} has no parameter or input {name!r}; {near}" for name, near in unknown]
    for name, value in start.items():
        if name in ports and (fault := fault_of(ports[name], value)):
            faults.append(f"{unit}.{name}: {fault}")
    return faults


def clock_mismatch(a: FmuClock | None, b: FmuClock | None) -> str | None:
    """Return why two clocks cannot be connected, or None if they can; an end that is not a clock is None."""
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


def period_doubt(unit: PlacedUnit) -> str:
    """Return in a line that a sampled unit's ticks are not at the begins of its steps; empty where they are.

    Several ticks may lie in one step, if all steps have as many.
    """
    own = proposed_step(unit.description.step) if unit.sampled and unit.description.sampled else None
    if own is None or 1 in ((own / unit.period).denominator, (unit.period / own).denominator):
        return ""
    step = f"its communication step of {float(unit.period):g} s"
    return f"{unit.name}: it samples every {float(own):g} s, of which {step} is no part: its ticks act at steps' begins"


_WHOLE = (Kind.INTEGER, Kind.ENUMERATION)


def mismatch(a: FmuPort, b: FmuPort) -> str | None:
    """Return why an output does not fit an input as it should, or None."""
    return obstacle(a, b) or doubt(a, b)


def doubt(a: FmuPort, b: FmuPort, transformation: LinearTransformation | None = None) -> str | None:
    """Return what is not as it should be between an output and an input that it can feed, or None."""
    if (a.kind, b.kind) == _WHOLE:
        return "an integer is not an enumeration, and must be one of its numbers"
    if a.shape != b.shape:
        return "their shapes differ, though each has one value"
    defined, unknown = (a.unit.defined, b.unit.defined), needs_no_conversion(a.unit, b.unit)
    if a.kind is Kind.REAL and transformation is None and not all(defined) and not unknown:
        undefined = b.unit.symbol if a.unit.defined else a.unit.symbol
        return f"the unit {undefined!r} is not defined in its FMU, so it cannot be compared"
    return None


def obstacle(a: FmuPort, b: FmuPort, transformation: LinearTransformation | None = None) -> str | None:
    """Return why an output cannot feed an input, or None."""
    if a.kind is not b.kind and (a.kind, b.kind) != _WHOLE:
        return f"{a.kind.value} cannot feed {b.kind.value}"
    if a.shape != b.shape and not a.size == b.size == 1:
        return "their shapes differ"
    if transformation is not None:
        return transformation.fault if a.kind is Kind.REAL else f"{a.kind.value} takes no linear transformation"
    if a.kind is Kind.REAL and a.unit.defined and b.unit.defined and (fault := _unit_mismatch(a.unit, b.unit)):
        return fault
    if a.kind is b.kind is Kind.ENUMERATION and a.items != b.items:
        return "their enumerations have other items"
    if a.kind is Kind.BINARY and a.mime != b.mime:
        return "their MIME types differ"
    return None


def _unit_mismatch(a: Unit, b: Unit) -> str | None:
    """Compare units by their definitions, not by their names."""
    if a.base != b.base:
        return "their units differ in dimension"
    unusable = next((u for u in (a, b) if not u.is_usable), None)
    if unusable is not None and a != b:
        return f"the unit {unusable.symbol!r} has the factor {unusable.factor!r} and the offset {unusable.offset!r}"
    return None


def connection_faults(units: Mapping[str, PlacedUnit], c: Connection) -> list[str]:
    """Return why a connection cannot be made: a unit or port that is not there, ports or clocks that do not match."""
    clocks = clock_of(units, c.source), clock_of(units, c.target)
    if any(clocks) and all(end.unit in units for end in (c.source, c.target)):
        reason = clock_mismatch(*clocks)
        return [f"{c.source} -> {c.target}: {reason}"] if reason else []
    a, fault_a = _find(units, c.source, "output")
    b, fault_b = _find(units, c.target, "input")
    if a is None or b is None:
        return [f"{c.source} -> {c.target}: {f}" for f in (fault_a, fault_b) if f]
    reason = obstacle(a, b, c.transformation)
    return [f"{c.source} ({a.signature}) -> {c.target} ({b.signature}): {reason}"] if reason else []


def connection_doubt(units: Mapping[str, PlacedUnit], c: Connection) -> str:
    """Return in a line what is not as it should be with a connection that can be made; empty where nothing is."""
    if clock_of(units, c.source) or clock_of(units, c.target):
        return ""
    a, b = (
        units[c.source.unit].description.outputs[c.source.port],
        units[c.target.unit].description.inputs[c.target.port],
    )
    reason = doubt(a, b, c.transformation)
    return (
        f"{c.source} ({a.signature}) -> {c.target} ({b.signature}): {reason}; it is passed as it is" if reason else ""
    )


def series_fault(
    units: Mapping[str, PlacedUnit], target: PortName, sources: Mapping[str, PortName], series: TimeSeries
) -> list[str]:
    """Return why an input cannot follow values over time; `sources` are the outputs that feed inputs of its unit."""
    port, fault = _find(units, target, "input")
    if port is not None and target.port in sources:
        fault = f"fed by {sources[target.port]}, so it cannot follow values over time"
    fault = fault or (series.fault(port) if port is not None else None)
    return [f"{target}: {fault}"] if fault else []


def outside_fault(
    units: Mapping[str, PlacedUnit],
    target: PortName,
    sources: Mapping[str, PortName],
    followed: Mapping[PortName, TimeSeries],
    given: ExternalSource,
) -> list[str]:
    """Return why an input cannot come from outside; `followed` are the values over time of inputs."""
    port, fault = _find(units, target, "input")
    if port is not None and target.port in sources:
        fault = f"fed by {sources[target.port]}, so it cannot come from outside"
    elif port is not None and target in followed:
        fault = "follows values over time, so it cannot come from outside"
    if fault is None and port is not None:
        fault = external_fault(port) or (given.fault(port) if isinstance(given, TimeSeries) else None)
    return [f"{target}: {fault}"] if fault else []


def clock_of(units: Mapping[str, PlacedUnit], end: PortName) -> FmuClock | None:
    """Return the clock of a name; None where there is none."""
    unit = units.get(end.unit)
    return unit.description.clocks.get(end.port) if unit else None


def no_unit(units: Mapping[str, PlacedUnit], end: PortName) -> str:
    """Return that there is no unit of an end's name, with the nearest names."""
    return f"there is no unit {end.unit!r}; {nearest(end.unit, units)}"


def port_fault(units: Mapping[str, PlacedUnit], end: PortName) -> str | None:
    """Return that an end is no output, input, parameter or clock of a unit, or None."""
    if (unit := units.get(end.unit)) is None:
        return no_unit(units, end)
    d = unit.description
    ports = [*d.outputs, *d.settable, *d.clocks]
    return None if end.port in ports else f"{end.unit} has no port {end.port!r}; {nearest(end.port, ports)}"


def _find(units: Mapping[str, PlacedUnit], end: PortName, role: str) -> tuple[FmuPort | None, str | None]:
    """Return an input or output, or why there is none."""
    unit = units.get(end.unit)
    if unit is None:
        return None, no_unit(units, end)
    d = unit.description
    ports, others = (d.outputs, d.inputs) if role == "output" else (d.inputs, d.outputs)
    if end.port in ports:
        return ports[end.port], None
    if end.port in d.parameters:
        return None, f"{end} is a parameter"
    if end.port in d.terminals.by_name:
        return None, f"{end} is a terminal: connect it with one, or its ports one by one"
    if end.port in others:
        return None, f"{end} is an {'input' if role == 'output' else 'output'}, not an {role}"
    if (entry := ELEMENT.match(end.port)) and entry["base"] in ports:
        return None, f"{end} is an entry of {ports[entry['base']].signature}: {BY_ENTRIES}"
    return None, f"{end.unit} has no {role} {end.port!r}; {nearest(end.port, ports)}"
