"""The forms that a record can be written in, each from rows as they come, so that memory stays flat."""

from collections.abc import Callable, Generator, Iterable, Mapping
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq

from handover.cosim.record.record_columns import told_of
from handover.cosim.record.record_mat import write_mat

WriteRecord = Callable[[Path, "pa.Schema", Iterable["pa.RecordBatch"]], None]
"""Writes a file with these columns, whose first is `time`, and rows."""

_VALUES = 2**20
_LEAST_ROWS, _MOST_ROWS = 256, 2**16


def write_parquet(path: Path, schema: "pa.Schema", batches: Iterable["pa.RecordBatch"]) -> None:
    """Write Parquet; units, descriptions and enumerations' items are in the columns' metadata."""
    # Reals hardly repeat: a dictionary of them takes thrice the time and makes the file larger.
    types: list[tuple[str, Any]] = list(zip(schema.names, schema.types, strict=True))
    repeating: Any = [name for name, kind in types if not pa.types.is_floating(kind)] or False
    with pq.ParquetWriter(path, schema, use_dictionary=repeating) as file:
        for group in _row_groups(schema, batches):
            file.write_table(group, row_group_size=group.num_rows)


def write_csv(path: Path, schema: "pa.Schema", batches: Iterable["pa.RecordBatch"]) -> None:
    """Write CSV with a line of names, each with its unit in brackets unless that is 1.

    Numbers have as many digits as it takes to read the same numbers back; truths are `true` and `false`.
    """
    titled = schema.empty_table().rename_columns([_title(name, told["unit"]) for name, told in told_of(schema)]).schema
    with pyarrow.csv.CSVWriter(path, titled) as file:
        for batch in batches:
            file.write_batch(pa.RecordBatch.from_arrays(batch.columns, schema=titled))


RECORD_FORMATS: Mapping[str, WriteRecord] = {"parquet": write_parquet, "csv": write_csv, "mat": write_mat}
"""Forms by name, which is also the file's suffix."""


def _row_groups(schema: "pa.Schema", batches: Iterable["pa.RecordBatch"]) -> Generator["pa.Table", None, None]:
    """Cut rows into groups that depend on the number of columns alone, not on when rows were flushed."""
    rows = min(max(_VALUES // len(schema), _LEAST_ROWS), _MOST_ROWS)
    waiting: list[pa.RecordBatch] = []
    have = 0
    for batch in batches:
        waiting.append(batch)
        have += batch.num_rows
        while have >= rows:
            whole = pa.Table.from_batches(waiting, schema)
            yield whole.slice(0, rows).combine_chunks()
            have -= rows
            waiting = whole.slice(rows).to_batches()
    if have:
        yield pa.Table.from_batches(waiting, schema).combine_chunks()


def _title(name: str, unit: str) -> str:
    return name if unit in ("", "1") else f"{name} [{unit}]"
