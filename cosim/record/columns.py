"""Columns of a record: their types and metadata, and where in a row each signal is."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Width
from handover.cosim.blocks.variable import Kind
from handover.cosim.record.tail import RecordBlock
from handover.cosim.system.signals import Column

_WIDE: dict[Any, Any] = {pa.float64(): np.float64, pa.int64(): np.int64, pa.uint64(): np.uint64, pa.bool_(): np.bool_}
_TYPES = {Kind.REAL: pa.float64(), Kind.INTEGER: pa.int64(), Kind.ENUMERATION: pa.int64(), Kind.BOOLEAN: pa.bool_()}


@dataclass(frozen=True)
class RecordColumns:
    """The columns of a record: their types with metadata, and of each its part of a block and its index in that.

    The first column is `time` in seconds. A column's metadata hold its unit and description, an enumeration's also its
    items.
    """

    schema: "pa.Schema"
    places: Sequence[tuple[int, int]]

    def batch(self, block: RecordBlock, begin: int = 0) -> "pa.RecordBatch":
        """Return the rows of a block from its row `begin` on as columns."""
        end = block.filled
        turned: list[NDArray[Any]] = [part.rows[begin:end].T.copy(order="C") for part in block.parts]
        columns: list[NDArray[Any]] = [block.time[begin:end].copy()]
        for kind, (part, place) in zip(self.schema.types[1:], self.places, strict=True):
            columns.append(turned[part][place].astype(_WIDE[kind], copy=False))
        arrays = [_array(kind, column) for kind, column in zip(self.schema.types, columns, strict=True)]
        return pa.RecordBatch.from_arrays(arrays, schema=self.schema)


def _array(kind: "pa.DataType", values: NDArray[Any]) -> "pa.Array[Any]":
    """Return values of a column, shape (n,), contiguous and of its dtype; `pa.array` would import pandas for them."""
    packed: Any = np.packbits(values, bitorder="little") if pa.types.is_boolean(kind) else values
    buffer = pa.py_buffer(packed)
    return pa.Array.from_buffers(kind, len(values), [None, buffer])


def column_values(column: Any) -> NDArray[Any]:
    """Return the values of an array or a table's column as `to_numpy` does, which would import pandas for them."""
    kind = _WIDE.get(column.type)
    if kind is None or column.null_count:
        return column.to_numpy(zero_copy_only=False)
    chunks: list[Any] = column.chunks if isinstance(column, pa.ChunkedArray) else [column]
    parts = [_chunk_values(kind, chunk) for chunk in chunks if len(chunk)]
    return parts[0] if len(parts) == 1 else np.concatenate([np.empty(0, kind), *parts])


def _chunk_values(kind: Any, chunk: Any) -> NDArray[Any]:
    begin, end, buffer = chunk.offset, chunk.offset + len(chunk), chunk.buffers()[1]
    if kind is np.bool_:
        bits = np.frombuffer(buffer, np.uint8)
        return np.unpackbits(bits, count=end, bitorder="little")[begin:].astype(bool)
    return np.frombuffer(buffer, kind, end)[begin:]


def record_columns(columns: Sequence[Column]) -> tuple[RecordColumns, list[NDArray[Any]]]:
    """Return where these signals are in rows, and the whole arrays that the parts of a row are copied from.

    A unit's outputs of one type are views of one array: copying it as a whole costs a tenth of copying each entry.
    """
    wholes: list[NDArray[Any]] = []
    part_of: dict[int, int] = {}
    places: list[tuple[int, int]] = []
    for c in columns:
        whole = c.values if c.values.base is None else c.values.base
        if id(whole) not in part_of:
            part_of[id(whole)] = len(wholes)
            wholes.append(whole)
        first = (c.values.ctypes.data - whole.ctypes.data) // whole.itemsize
        places.append((part_of[id(whole)], first + c.index))
    time = pa.field("time", pa.float64(), metadata={"unit": "s", "description": "simulated time"})
    return RecordColumns(pa.schema([time, *(_field(c) for c in columns)]), places), wholes


def column_metadata(schema: "pa.Schema") -> list[tuple[str, dict[str, str]]]:
    """Return the name of each column and its metadata: `unit`, `description`, and `items` of an enumeration."""
    columns: list[tuple[str, dict[str, str]]] = []
    for name in schema.names:
        metadata: dict[bytes, bytes] = schema.field(name).metadata or {}
        defaults = {"unit": "1", "description": "", "items": ""}
        columns.append((name, defaults | {k.decode(): v.decode() for k, v in metadata.items()}))
    return columns


def _type_of(c: Column) -> "pa.DataType":
    return pa.uint64() if c.port.width is Width.UINT64 else _TYPES[c.port.kind]


def _field(c: Column) -> "pa.Field[Any]":
    metadata = {"unit": c.port.unit.symbol, "description": c.port.description}
    if c.port.items:
        metadata["items"] = ", ".join(f"{v} {n}" for n, v in c.port.items)
    return pa.field(c.name, _type_of(c), metadata=metadata)
