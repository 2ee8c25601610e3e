"""How values get from the outputs of loaded units to the inputs that they feed."""

import logging
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from handover.cosim.finite_check import FiniteCheck
from handover.cosim.fmu.buffers import Copy, joined
from handover.cosim.fmu.description import FmuPort
from handover.cosim.fmu.instance import Instance
from handover.cosim.narrowing import Narrowing, narrows
from handover.cosim.scaled_copy import ScaledCopy
from handover.cosim.system.conversion import Linear
from handover.cosim.system.system import PortName, System

_log = logging.getLogger(__name__)


class Feeding(NamedTuple):
    """What happens before a unit's inputs are set: checks, then copies, then scaled copies."""

    narrowings: Sequence[Narrowing]
    copies: Sequence[Copy]
    scaled: Sequence[ScaledCopy]

    def carry_out(self, t: float) -> None:
        """Fill a unit's buffers at t.

        Raises:
            UnitFailure: a number does not fit its input.
        """
        for narrowing in self.narrowings:
            narrowing.check(t)
        for target, source in self.copies:
            target[...] = source
        for scaled in self.scaled:
            scaled()


def feedings(system: System, instances: Mapping[str, Instance]) -> dict[str, Feeding]:
    """Return how each unit is fed; conversions of units of measure are told in the log."""
    changes = {c.target: change for c in system.connections if (change := system.change_by(c))}
    return {name: _feeding(system, instances, name, changes) for name in instances}


def finite_checks(system: System, instances: Mapping[str, Instance]) -> dict[str, FiniteCheck]:
    """Return for each unit the check of its connected outputs."""
    read: dict[str, dict[str, tuple[FmuPort, list[str]]]] = {name: {} for name in instances}
    for name in instances:
        for port, source in system.sources_of(name).items():
            output = instances[source.unit].description.outputs[source.port]
            read[source.unit].setdefault(source.port, (output, []))[1].append(f"{name}.{port}")
    return {name: FiniteCheck(name, i.description.fmi, i.y, read[name]) for name, i in instances.items()}


def _feeding(
    system: System, instances: Mapping[str, Instance], name: str, changes: Mapping[PortName, Linear]
) -> Feeding:
    instance = instances[name]
    copies: list[Copy] = []
    scaled: list[ScaledCopy] = []
    narrowings: list[Narrowing] = []
    for port, source in system.sources_of(name).items():
        other, target = instances[source.unit], instance.description.inputs[port]
        output, change = other.description.outputs[source.port], changes.get(PortName(name, port))
        if change is not None:
            scaled.append(ScaledCopy(instance.u[port][0], other.y[source.port][0], change))
            _log.info("%s (%s) -> %s.%s (%s): %s", source, output.unit, name, port, target.unit, change)
        else:
            copies += zip(instance.u[port], other.y[source.port], strict=True)
        if target.width and narrows(output, target):
            narrowings.append(Narrowing(str(source), name, port, target.width, other.y[source.port][0]))
    return Feeding(narrowings, joined(copies), scaled)
