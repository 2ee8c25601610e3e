"""Whole systems in our own master: what the same systems in foreign hosts must reproduce."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PortName, System
from support.exchange.reference import Record


@dataclass(frozen=True)
class Placed:
    """A unit in a system: its FMU and the values of its parameters and inputs at the start."""

    fmu: Path
    start: Mapping[str, Any] = field(default_factory=dict[str, Any])


Connections = Sequence[tuple[str, str]]
"""Pairs of output and input, written `unit.port`."""


def run_in_our_own(
    units: Mapping[str, Placed], connections: Connections, step: Fraction, steps: int
) -> dict[str, Record]:
    """Return each unit's outputs at every communication point, all units stepped in parallel."""
    system = System()
    for name, placed in units.items():
        system.add(name, placed.fmu, period=step, **placed.start)
    for source, target in connections:
        system.connect(PortName(*source.split(".")), PortName(*target.split(".")))
    rows: dict[str, list[Mapping[str, float]]] = {name: [] for name in units}

    def observe(t: float, signals: Signals) -> None:  # noqa: ARG001
        columns = [(*c.name.split(".", 1), float(c.values[c.index])) for c in signals.columns()]
        for unit, seen in rows.items():
            seen.append({port: value for name, port, value in columns if name == unit})

    with Master(system, MasterOptions(algorithm=Algorithm.JACOBI)) as master:
        master.run(steps * step, [observe])
    return {name: Record(seen, []) for name, seen in rows.items()}
