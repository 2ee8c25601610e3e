"""Finds the FMU variables that an SSP's connectors name: ports, or single entries of arrays of scalars."""

from collections.abc import Collection, Mapping
from dataclasses import replace

from handover.cosim.blocks.variable import ELEMENT, indices_of
from handover.cosim.fmu.file.description import FmuDescription, FmuPort

Entry = tuple[FmuPort, int | None]
"""A port, or with a number one of its entries, counted from 0 in row-major order."""


def ports_of(d: FmuDescription) -> dict[str, FmuPort]:
    """Return all parameters, inputs and outputs by name."""
    return {**d.parameters, **d.inputs, **d.outputs}


def find_entry(ports: Mapping[str, FmuPort], name: str) -> Entry | None:
    """Return the port of a name, or for a name such as `p[1]` of an array of scalars the port and the entry."""
    if name in ports:
        return ports[name], None
    match = ELEMENT.match(name)
    port = ports.get(match["base"]) if match else None
    if match is None or port is None or len(port.references) == 1:
        return None
    indices = tuple(map(int, match[2].split(",")))
    everywhere = indices_of(port.shape)
    return (port, everywhere.index(indices)) if indices in everywhere else None


def variable_names(d: FmuDescription) -> list[str]:
    """Return the names that connectors of an FMU can have."""
    return [name for port in ports_of(d).values() for name in port.entry_names]


def settable_names(d: FmuDescription) -> list[str]:
    """Return the names that start values of an FMU can have."""
    return [name for port in d.settable.values() for name in port.entry_names]


def unfed(d: FmuDescription) -> dict[str, FmuPort]:
    """Return what can be set and cannot be fed: parameters, and outputs and locals with start values."""
    return {**d.parameters, **d.initial}


def split_arrays(d: FmuDescription, names: Collection[str]) -> FmuDescription:
    """Return a description in which the named arrays of scalars are scalars, as they are in the FMU itself."""
    if not names:
        return d
    apart = {n: p.entry_names if n in names else [n] for n, p in ports_of(d).items()}

    def ports(given: Mapping[str, FmuPort]) -> dict[str, FmuPort]:
        return {e.name: e for p in given.values() for e in (_entries(p) if p.name in names else [p])}

    def feedthrough(given: Mapping[str, tuple[str, ...]]) -> dict[str, tuple[str, ...]]:
        return {e: tuple(i for u in us for i in apart[u]) for y, us in given.items() for e in apart[y]}

    return replace(
        d,
        parameters=ports(d.parameters),
        inputs=ports(d.inputs),
        outputs=ports(d.outputs),
        initial=ports(d.initial),
        feedthrough=feedthrough(d.feedthrough),
        presumed_feedthrough=feedthrough(d.presumed_feedthrough),
        initial_feedthrough=feedthrough(d.initial_feedthrough),
        presumed_initial_feedthrough=feedthrough(d.presumed_initial_feedthrough),
    )


def _entries(port: FmuPort) -> list[FmuPort]:
    names = port.entry_names
    starts = [None] * len(names) if port.start is None else port.start.split()
    return [
        replace(port, name=name, shape=(), references=(reference,), start=start)
        for name, reference, start in zip(names, port.references, starts, strict=True)
    ]
