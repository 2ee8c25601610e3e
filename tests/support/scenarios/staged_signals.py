"""What an evaluator sees, of values that a test makes up."""

import enum
from collections.abc import Mapping
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.system.signals import Signals


def staged(values: Mapping[str, Mapping[str, Any]]) -> Signals:
    """Return signals of numbers, booleans, arrays and items of enumerations, by unit and output."""
    views = {unit: {name: (np.atleast_1d(value),) for name, value in ys.items()} for unit, ys in values.items()}
    ports = {unit: {name: _port(name, value) for name, value in ys.items()} for unit, ys in values.items()}
    return Signals(views, ports, views)


def _port(name: str, value: Any) -> FmuPort:
    items = tuple((item.name, int(item)) for item in type(value)) if isinstance(value, enum.IntEnum) else ()
    return FmuPort(
        name=name,
        kind=Kind.ENUMERATION if items else Kind.REAL,
        causality=Causality.OUTPUT,
        fmi_type="",
        references=(),
        shape=np.shape(value),
        items=items,
    )
