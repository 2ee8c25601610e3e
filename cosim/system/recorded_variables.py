"""Variables inside of units that observers see and records hold besides the outputs, as if they were outputs."""

import fnmatch
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from handover.cosim.blocks.variable import Kind
from handover.cosim.exceptions import WiringError, did_you_mean, nearest
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.fmu.file.internal_variables import LOCAL, internal_ports
from handover.cosim.system.port_names import PlacedUnit
from handover.cosim.system.system import System

_TEXTS = (Kind.STRING, Kind.BINARY)
"""Kinds of which a record has no columns."""

Inside = Mapping[str, tuple[str, FmuPort]]
"""By name of a unit's variable, its causality and the port by which it is read."""


def record_variables(system: System, patterns: Sequence[str]) -> None:
    """Let local variables and parameters of a wired system be seen, by patterns `UNIT.NAME`.

    In these, `*` and `?` stand for any characters. Where no patterns are given and no unit has an output, the local
    variables of all are seen, which a note says.

    Raises:
        WiringError: a pattern names nothing that can be recorded.
    """
    inside = _Inside()
    if patterns:
        _record_named(system, patterns, inside)
    elif not any(unit.description.outputs for unit in system.units.values()):
        for name, unit in system.units.items():
            local = {n: port for n, (causality, port) in inside.of(unit).items() if causality in LOCAL}
            system.units[name] = _seen(unit, local)
            if local:
                system.notes.append(f"{name} has no outputs, so its local variables are recorded")


class _Inside:
    """Reads what is inside of FMUs, each once, without texts and binaries."""

    def __init__(self) -> None:
        self._known: dict[Path, Inside] = {}

    def of(self, unit: PlacedUnit) -> Inside:
        """Return what is inside of a unit."""
        d = unit.description
        if d.path not in self._known:
            found = internal_ports(d.path, d.fmi)
            self._known[d.path] = {n: (c, port) for n, (c, port) in found.items() if port.kind not in _TEXTS}
        return self._known[d.path]


def _record_named(system: System, patterns: Sequence[str], inside: _Inside) -> None:
    faults: list[str] = []
    matched: dict[str, dict[str, FmuPort]] = {name: {} for name in system.units}
    for pattern in patterns:
        near = {name: unit for name, unit in system.units.items() if _may_be_of(pattern, name)}
        is_meant, found = _matcher(pattern), False
        for name, unit in near.items():
            for variable, (_, port) in inside.of(unit).items():
                if is_meant(f"{name}.{variable}"):
                    matched[name][variable] = port
                    found = True
            found = found or any(is_meant(f"{name}.{output}") for output in unit.description.outputs)
        if not found:
            known = [f"{name}.{variable}" for name, unit in near.items() for variable in inside.of(unit)]
            whole = [f"{name}.{pattern}" for name, unit in system.units.items() if pattern in inside.of(unit)]
            what = did_you_mean(whole) or nearest(pattern, known or [f"{name}.*" for name in system.units])
            faults.append(f"{pattern}: no local variable or parameter of a unit; {what}")
    if faults:
        raise WiringError(faults)
    for name, ports in matched.items():
        system.units[name] = _seen(system.units[name], ports)


def _matcher(pattern: str) -> Callable[[str], object]:
    """Return what tells whether a name is meant; brackets in a pattern are those of names such as `p[1]`."""
    return re.compile(fnmatch.translate(pattern.replace("[", "[[]"))).match


def _may_be_of(pattern: str, unit: str) -> bool:
    """Return whether a pattern, by what comes before its first wildcard, may name variables of a unit."""
    literal, own = re.split(r"[*?]", pattern, maxsplit=1)[0], f"{unit}."
    return literal.startswith(own) or own.startswith(literal)


def _seen(unit: PlacedUnit, ports: Mapping[str, FmuPort]) -> PlacedUnit:
    shown = unit.description.outputs
    outputs = {**shown, **{name: port for name, port in ports.items() if name not in shown}}
    return replace(unit, description=replace(unit.description, outputs=outputs))
