"""What a system's connections change on the way, as a run's folder keeps it and its user is told."""

from collections.abc import Mapping
from typing import Any

from handover.cosim.system.conversion import Linear
from handover.cosim.system.system import System


def conversions_of(system: System) -> list[dict[str, Any]]:
    """Return, as JSON can hold it, the connections that change values: both ends with their units, and how."""
    told: list[dict[str, Any]] = []
    for c in system.connections:
        change = system.change_by(c)
        if change is not None:
            source = system.units[c.source.unit].description.outputs[c.source.port]
            target = system.units[c.target.unit].description.inputs[c.target.port]
            ends = {"source": str(c.source), "unit": str(source.unit)}
            ends |= {"target": str(c.target), "target_unit": str(target.unit)}
            told.append({**ends, "factor": change.factor, "offset": change.offset})
    return told


def told_conversion(conversion: Mapping[str, Any]) -> tuple[str, str]:
    """Return a conversion as one reads it: from where to where, and how."""
    source = _with_unit(conversion["source"], conversion["unit"])
    target = _with_unit(conversion["target"], conversion["target_unit"])
    return f"{source} -> {target}", str(Linear(conversion["factor"], conversion["offset"]))


def _with_unit(port: str, unit: str) -> str:
    return f"{port} ({unit})" if unit else port
