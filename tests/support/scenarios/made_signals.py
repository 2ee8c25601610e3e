"""Signals as a system's units would show them, for evaluators."""

from collections.abc import Mapping
from enum import IntEnum
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Causality, Kind
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.system.signals import Signals


def made_signals(values: Mapping[str, Mapping[str, Any]]) -> Signals:
    """Return signals with values by unit and output; their kinds are those of the values."""
    ports = {unit: {name: _port(name, value) for name, value in ys.items()} for unit, ys in values.items()}
    views = {unit: {name: (np.array(value).reshape(-1),) for name, value in ys.items()} for unit, ys in values.items()}
    return Signals(views, ports, None)


def _port(name: str, value: Any) -> FmuPort:
    kind = Kind.REAL
    more: dict[str, Any] = {"shape": np.shape(value)}
    if isinstance(value, IntEnum):
        kind, more["items"] = Kind.ENUMERATION, tuple((i.name, int(i)) for i in type(value))
    elif isinstance(value, bool):
        kind = Kind.BOOLEAN
    elif isinstance(value, int):
        kind = Kind.INTEGER
    return FmuPort(name=name, kind=kind, causality=Causality.OUTPUT, fmi_type="", references=(), **more)
