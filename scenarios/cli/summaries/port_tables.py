"""What a parameter, input or output is, as a row of a table and as JSON: of a block that declares it, and of an FMU."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from handover.cosim.blocks.start_values import range_of
from handover.cosim.blocks.variable import Causality, Declared, Kind, Variable
from handover.cosim.fmu.file.description import FmuPort

_MAX_START = 40  # characters


def port_rows(ports: Iterable[Variable | FmuPort]) -> list[tuple[str, ...]]:
    """Return name, type with unit, start value, range and description of each."""
    return [(v.name, type_of(v), start_of(v), allowed(v), v.description) for v in ports]


def variable_data(v: Variable | FmuPort) -> dict[str, Any]:
    """Return the same as JSON can hold it; what is not declared is None, and a pure number has the unit "1"."""
    start: Any = None if v.causality is Causality.OUTPUT or v.kind is Kind.BINARY else v.start
    if isinstance(start, str) and v.kind in (Kind.REAL, Kind.INTEGER):  # of an FMU, as it is written there
        numbers = [float(text) if v.kind is Kind.REAL else int(text) for text in start.split()]
        start = numbers if v.shape or not numbers else numbers[0]
    return {
        "name": v.name,
        "type": v.type_name,
        "shape": list(v.shape),
        "unit": v.unit.symbol if v.kind is Kind.REAL else None,
        "start": start.tolist() if isinstance(start, np.ndarray) else getattr(start, "name", start),
        "minimum": v.minimum,
        "maximum": v.maximum,
        "items": [name for name, _ in v.items] or None,
        "description": v.description,
    }


def allowed(v: Declared) -> str:
    """Return the values that are allowed: a range, or names; "" for any."""
    return " | ".join(n.lower() for n, _ in v.items) if v.items else range_of(v)


def type_of(v: Declared) -> str:
    """Return kind, shape and unit, as in `real[3] m`."""
    shape = f"[{','.join(map(str, v.shape))}]" if v.shape else ""
    unit = v.unit.shown if v.kind is Kind.REAL else ""
    return f"{v.type_name}{shape} {unit}".rstrip()


def start_of(v: Variable | FmuPort) -> str:
    """Return the start value in short, "" for an output."""
    start = v.start
    hidden = v.causality is Causality.OUTPUT or v.kind is Kind.BINARY or start is None
    text = "" if hidden else start if isinstance(start, str) else plain(start)
    return text if len(text) <= _MAX_START else text[: _MAX_START - 3] + "..."


def plain(value: Any) -> str:
    """Return a declared value as one types it."""
    if isinstance(value, np.ndarray):
        return ",".join(f"{x:g}" for x in value.reshape(-1).tolist())
    return f"{value:g}" if isinstance(value, float) else str(getattr(value, "name", value)).lower()
