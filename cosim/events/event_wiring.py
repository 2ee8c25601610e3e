"""What can be wrong with a system's clocks, and with units of which a process holds one only."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from pathlib import Path

from handover.cosim.fmu.clocks import FmuClock
from handover.cosim.fmu.description import FmuDescription


def clock_mismatch(a: FmuClock | None, b: FmuClock | None) -> str | None:
    """Return why one end cannot let the other tick, or None; an end that is no clock is None."""
    if a is None or b is None:
        return "a clock can be connected with a clock only"
    if a.is_input or not b.is_input:
        return "an output clock lets an input clock tick, not the other way round"
    if not b.is_triggered:
        return "it ticks at times of its own; a triggered input clock can be connected"
    return None


def event_faults(name: str, description: FmuDescription, sampled: bool) -> list[str]:
    """Return why a unit's clocks cannot tick as it is placed: clocked ports are reached in event mode only."""
    d = description
    clocked = sorted(p.name for p in (*d.inputs.values(), *d.outputs.values()) if p.clocks)
    if not clocked:
        return []
    told = f"{name}: {', '.join(clocked)} can be reached only while a clock ticks, in event mode"
    if not d.capabilities.event_mode:
        return [f"{told}, which its FMU does not have (hasEventMode)"]
    return [f"{told}; it cannot be placed as a sampled unit, which runs without"] if sampled else []


def once_faults(units: Iterable[tuple[str, FmuDescription]]) -> list[str]:
    """Return which units are there more than once though a process may hold one of them only."""
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
