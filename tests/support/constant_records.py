"""Records in which every output has one value all the time, with the columns that a scenario's run has."""

from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.variable import Kind
from handover.cosim.fmu.buffers import Views
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System

_STEP = 0.02  # s


def constant_record(system: System, value: float, rows: int, file: Path) -> Record:
    """Write a record of so many rows in which reals are `value`, and all else is that or, where it cannot be, 0."""
    ports = {name: unit.description.outputs for name, unit in system.units.items()}
    outputs = {name: {n: _views(p, value) for n, p in of_unit.items()} for name, of_unit in ports.items()}
    signals = Signals(outputs, ports, None)
    with Recorder(file) as recorder:
        for k in range(rows):
            recorder(k * _STEP, signals)
    return Record(file)


def _views(port: FmuPort, value: float) -> Views:
    if port.kind in (Kind.BINARY, Kind.STRING):
        empty: Any = np.zeros(1, np.uint64)
        return (empty, empty.copy())
    if port.kind is Kind.REAL:
        return (np.full(port.size, value),)
    dtype = np.bool_ if port.kind is Kind.BOOLEAN else np.int32
    return (np.full(port.size, value if np.isfinite(value) else 0, dtype),)
