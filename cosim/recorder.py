"""Writes the scalar signals of a run to a Parquet file, one column a signal, safely as they come."""

from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from cosim.signals import Column, Signals
from cosim.variable import Kind
from cosim.width import Width

_ROWS = 256
_TYPES = {Kind.REAL: pa.float64(), Kind.INTEGER: pa.int64(), Kind.ENUMERATION: pa.int64(), Kind.BOOLEAN: pa.bool_()}


class Recorder:
    """An observer of `Master.run` that records every communication point. Use as a context manager.

    The first column is `time` in seconds. A column's metadata hold its unit and description, an enumeration's also its
    items. A Parquet file cannot be read before it is complete, so rows go to an Arrow stream beside it
    (`signals.arrows`), a block at a time; leaving turns that into the Parquet file, also when the run was cut short.
    If the process dies, the stream stays and holds all blocks that were written.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.stream = path.with_suffix(".arrows")
        self.rows = 0
        self._writer: pa.ipc.RecordBatchStreamWriter | None = None
        self._file: pa.NativeFile | None = None
        self._columns: list[Column] = []
        self._schema = pa.schema([])
        self._time = np.zeros(_ROWS)
        self._sources: list[tuple[NDArray[Any], NDArray[Any]]] = []  # a unit's values of one type, and their rows here
        self._block: list[NDArray[Any]] = []
        self._filled = 0

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is None:
            return
        try:
            self._flush()
        finally:
            self._writer.close()
            if self._file is not None:
                self._file.close()
        self._complete()

    def __call__(self, t: float, signals: Signals) -> None:
        """Record one row."""
        if self._writer is None:
            self._open(signals)
        self._time[self._filled] = t
        for values, rows in self._sources:
            rows[self._filled] = values
        self._filled += 1
        self.rows += 1
        if self._filled == _ROWS:
            self._flush()

    def _open(self, signals: Signals) -> None:
        self._columns = signals.columns()
        self._sources, self._block = _rows_of(self._columns)
        time = pa.field("time", pa.float64(), metadata={"unit": "s", "description": "simulated time"})
        self._schema = pa.schema([time, *(_field(c) for c in self._columns)])
        self._file = pa.OSFile(str(self.stream), "wb")
        self._writer = pa.ipc.new_stream(self._file, self._schema)

    def _flush(self) -> None:
        n, self._filled = self._filled, 0
        if n == 0 or self._writer is None:
            return
        arrays: list[pa.Array[Any]] = [pa.array(self._time[:n])]
        for column, block in zip(self._columns, self._block, strict=True):
            values = block[:n].astype(bool) if column.port.kind is Kind.BOOLEAN else block[:n]
            arrays.append(pa.array(values).cast(_type_of(column)))
        self._writer.write_batch(pa.RecordBatch.from_arrays(arrays, schema=self._schema))

    def _complete(self) -> None:
        with (
            pa.OSFile(str(self.stream), "rb") as source,
            pa.ipc.open_stream(source) as batches,
            pq.ParquetWriter(self.path, self._schema) as file,
        ):
            for batch in batches:
                file.write_batch(batch)
        self.stream.unlink()


def _rows_of(columns: list[Column]) -> tuple[list[tuple[NDArray[Any], NDArray[Any]]], list[NDArray[Any]]]:
    """Return each whole array that columns lie in with rows for it, and each column's part of the rows.

    A unit's outputs of one type are views of one array: copying that at once costs a tenth of going entry by entry.
    """
    rows: dict[int, tuple[NDArray[Any], NDArray[Any]]] = {}
    block: list[NDArray[Any]] = []
    for c in columns:
        whole = c.values if c.values.base is None else c.values.base
        if id(whole) not in rows:
            rows[id(whole)] = (whole, np.zeros((_ROWS, len(whole)), dtype=whole.dtype))
        first = (c.values.ctypes.data - whole.ctypes.data) // whole.itemsize
        block.append(rows[id(whole)][1][:, first + c.index])
    return list(rows.values()), block


def _type_of(c: Column) -> "pa.DataType":
    return pa.uint64() if c.port.width is Width.UINT64 else _TYPES[c.port.kind]


def _field(c: Column) -> "pa.Field[Any]":
    metadata = {"unit": c.port.unit.symbol, "description": c.port.description}
    if c.port.items:
        metadata["items"] = ", ".join(f"{v} {n}" for n, v in c.port.items)
    return pa.field(c.name, _type_of(c), metadata=metadata)
