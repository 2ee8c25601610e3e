"""What a run's folder keeps of its system: the units, and which output feeds which input."""

from typing import Any

from handover.cosim.system.system import Connection, System


def told_system(system: System, *, adaptive: bool) -> dict[str, Any]:
    """Return units and connections of a system without faults, as JSON can hold it.

    `adaptive` says that the master chooses its steps: then only sampled units have a period of their own.
    """
    units = [
        {
            "name": name,
            "model": unit.description.name,
            "fmi": str(unit.description.fmi),
            "period": None if adaptive and not unit.sampled else float(unit.period),
            "sampled": unit.sampled,
        }
        for name, unit in system.units.items()
    ]
    return {"units": units, "connections": [_told(system, c) for c in system.connections]}


def _told(system: System, c: Connection) -> dict[str, Any]:
    port = system.units[c.source.unit].description.outputs.get(c.source.port)
    if port is None:
        kind, unit, size = "clock", "", 1
    else:
        kind, unit, size = port.kind.value, port.unit.symbol, port.size
    return {"source": str(c.source), "target": str(c.target), "unit": unit, "size": size, "kind": kind}
