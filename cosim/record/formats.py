"""File formats of a record: Parquet, CSV, and MATLAB level 4 as OpenModelica and Dymola write their results.

Each is written from batches of rows as they come, so that memory stays flat.
"""

import struct
from collections.abc import Callable, Generator, Iterable, Mapping, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
from numpy.typing import NDArray

from handover.cosim.record.columns import column_metadata, column_values

WriteRecord = Callable[[Path, "pa.Schema", Iterable["pa.RecordBatch"]], None]
"""Writes a file with these columns, of which the first is `time`, and rows."""

_VALUES = 2**20
"""Values in a row group of Parquet, between limits of its rows."""
_MIN_ROWS, _MAX_ROWS = 256, 2**16

_DOUBLE, _INT32, _TEXT = 0, 20, 51  # type and kind of a matrix, little-endian
_HEADER = struct.Struct("<5i")  # type, rows, columns, imaginary, bytes of the name


def write_parquet(path: Path, schema: "pa.Schema", batches: Iterable["pa.RecordBatch"]) -> None:
    """Write Parquet; units, descriptions and enumerations' items are in the columns' metadata."""
    # Reals hardly repeat: a dictionary of them takes three times as long and makes the file larger.
    types: list[tuple[str, Any]] = list(zip(schema.names, schema.types, strict=True))
    repeating: Any = [name for name, kind in types if not pa.types.is_floating(kind)] or False
    with pq.ParquetWriter(path, schema, use_dictionary=repeating, write_page_checksum=True) as file:
        for group in _row_groups(schema, batches):
            file.write_table(group, row_group_size=group.num_rows)


def write_csv(path: Path, schema: "pa.Schema", batches: Iterable["pa.RecordBatch"]) -> None:
    """Write CSV with a line of names, each with its unit in brackets unless that is 1.

    Numbers have as many digits as it takes to read the same numbers back; booleans are `true` and `false`.
    """
    titles = [_title(name, metadata["unit"]) for name, metadata in column_metadata(schema)]
    titled = schema.empty_table().rename_columns(titles).schema
    with pyarrow.csv.CSVWriter(path, titled) as file:
        for batch in batches:
            file.write_batch(pa.RecordBatch.from_arrays(batch.columns, schema=titled))


def write_mat(path: Path, schema: "pa.Schema", batches: Iterable["pa.RecordBatch"]) -> None:
    """Write MATLAB level 4: `Aclass`, `name`, `description`, `dataInfo`, `data_1`, `data_2`, transposed ("binTrans").

    `name` and `description` have a column of UTF-8 for each signal; a unit is in brackets at the description's end.
    `data_2` has a row for each signal, `time` first, and a column for each time; it can only hold doubles, so the
    last digits of integers beyond 2^53 are rounded. `data_1`, which holds what is constant, has only the first and
    the last time. `dataInfo` says of each signal that it is in `data_2`, in which row, that it is interpolated
    linearly (0), as readers expect of all, and that it is not defined before and after (-1).

    Source: OpenModelica User's Guide, "Simulation result files"; MATLAB's "MAT-File Format", level 4.
    """
    columns = column_metadata(schema)
    info = np.array([[2, i + 1, 0, -1] for i in range(len(columns))], dtype="<i4")
    info[0, 0] = 0  # time is in all matrices
    with open(path, "wb") as file:
        rows = [row.ljust(11) for row in ("Atrajectory", "1.1", "", "binTrans")]
        _write_texts(file, "Aclass", ["".join(column) for column in zip(*rows, strict=True)])
        _write_texts(file, "name", [name for name, _ in columns])
        _write_texts(file, "description", [_description(metadata) for _, metadata in columns])
        _write_header(file, "dataInfo", _INT32, (4, len(columns)))
        file.write(info.tobytes())
        _write_header(file, "data_1", _DOUBLE, (1, 2))
        limits_at = file.tell()
        file.write(np.zeros(2).tobytes())
        header_at = file.tell()
        _write_header(file, "data_2", _DOUBLE, (len(columns), 0))
        count, first, last = 0, 0.0, 0.0
        for batch in batches:
            if not batch.num_rows:
                continue
            values = _doubles(batch)
            file.write(values.tobytes())
            first, last = (first if count else values[0, 0]), values[-1, 0]
            count += len(values)
        file.seek(limits_at)
        file.write(np.array([first, last], dtype="<f8").tobytes())
        file.seek(header_at)
        _write_header(file, "data_2", _DOUBLE, (len(columns), count))


RECORD_FORMATS: Mapping[str, WriteRecord] = {"parquet": write_parquet, "csv": write_csv, "mat": write_mat}
"""Formats by name, which is also the file's suffix."""


def _row_groups(schema: "pa.Schema", batches: Iterable["pa.RecordBatch"]) -> Generator["pa.Table", None, None]:
    """Cut rows into groups whose size depends on the number of columns only, not on when rows were flushed."""
    rows = min(max(_VALUES // len(schema), _MIN_ROWS), _MAX_ROWS)
    waiting: list[pa.RecordBatch] = []
    n_waiting = 0
    for batch in batches:
        waiting.append(batch)
        n_waiting += batch.num_rows
        while n_waiting >= rows:
            whole = pa.Table.from_batches(waiting, schema)
            yield whole.slice(0, rows).combine_chunks()
            n_waiting -= rows
            waiting = whole.slice(rows).to_batches()
    if n_waiting:
        yield pa.Table.from_batches(waiting, schema).combine_chunks()


def _title(name: str, unit: str) -> str:
    return name if unit in ("", "1") else f"{name} [{unit}]"


def _doubles(batch: "pa.RecordBatch") -> NDArray[np.float64]:
    """Return a batch as [rows, columns]."""
    values = np.empty((batch.num_rows, batch.num_columns), dtype="<f8")
    for i in range(batch.num_columns):
        values[:, i] = column_values(batch.column(i))
    return values


def _description(metadata: Mapping[str, str]) -> str:
    unit = "" if metadata["unit"] in ("", "1") else f"[{metadata['unit']}]"
    items = f"({metadata['items']})" if metadata["items"] else ""
    return " ".join(text for text in (metadata["description"], items, unit) if text)


def _write_texts(file: IO[bytes], name: str, texts: Sequence[str]) -> None:
    """Write texts as the columns of a matrix, padded with blanks as Dymola does: not all readers accept zero bytes."""
    encoded = [t.encode() for t in texts]
    longest = max(map(len, encoded)) or 1
    _write_header(file, name, _TEXT, (longest, len(encoded)))
    file.write(b"".join(t.ljust(longest) for t in encoded))


def _write_header(file: IO[bytes], name: str, kind: int, shape: tuple[int, int]) -> None:
    file.write(_HEADER.pack(kind, *shape, 0, len(name) + 1) + name.encode() + b"\0")
