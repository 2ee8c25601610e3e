"""Reads the signals of a run from its record: `record["arm.p_WG"]` is an array of shape (rows, 3).

`RecordedSignals` replays a record row by row, as an observer of the run saw its signals.
"""

import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.variable import SUBSCRIPT, indices_of
from handover.cosim.exceptions import CosimError, nearest, one_line
from handover.cosim.files import check_regular
from handover.cosim.system.signals import Signals
from handover.cosim.system.time_series import TimeSeries

_FREE, _RATIO = 1 << 30, 1000
"""Bytes that any file may take in memory, and how many times its own size one may take beyond that."""
_ROWS = 64
"""Of texts, that are read at once."""


class InvalidRecord(CosimError, ValueError):
    """A file is not the record of a run, or is a decompression bomb; nothing of it is used."""

    def __init__(self, path: Path, fault: str) -> None:
        super().__init__(f"{path}: {fault}")
        self.path, self.fault = path, fault


def read_parquet(path: Path) -> Any:
    """Return the table of a Parquet file, which may be somebody else's: numbers, booleans, texts, lists of numbers.

    A decompression bomb is refused before it is read: one whose values, of 8 bytes, take more than 1 GiB and more than
    1000 times the file's size. No run's record is one: its times alone take some bytes a row. How long texts are, a
    file's metadata do not say; they are counted while they are read.

    Raises:
        OSError: it cannot be read. InvalidRecord: it is damaged, has columns of other types, or is a bomb.
    """
    import pyarrow as pa  # slow to import, and scenarios import this module before there is any record
    import pyarrow.parquet as pq

    check_regular(path)
    most = max(_FREE, _RATIO * path.stat().st_size)
    try:
        with pq.ParquetFile(path, page_checksum_verification=True) as file:
            schema: Any = file.schema_arrow
            if len(set(schema.names)) < len(schema.names):
                raise InvalidRecord(path, "two of its columns have one name")
            for column in schema:
                if not (_is_number(column.type) or _holds_more(column.type)):
                    raise InvalidRecord(path, f"its column {column.name!r} is of the type {column.type}")
            _check_size(path, 8 * _values_in(file), most)
            if not any(_holds_more(kind) for kind in schema.types):
                return file.read()
            batches: list[Any] = []
            size = 0
            for batch in file.iter_batches(_ROWS):
                batches.append(batch)
                size += batch.nbytes
                _check_size(path, size, most)
            return pa.Table.from_batches(batches, schema)
    except (pa.ArrowException, UnicodeError, OverflowError) as e:
        raise InvalidRecord(path, one_line(e)) from e
    except OSError as e:
        if e.errno is not None:
            raise
        raise InvalidRecord(path, one_line(e)) from e  # Arrow's, of a checksum or of what is compressed


def _is_number(kind: Any) -> bool:
    from pyarrow import types

    return types.is_floating(kind) or types.is_integer(kind) or types.is_boolean(kind)


def _holds_more(kind: Any) -> bool:
    """Return whether values of a column's type may be longer than 8 bytes."""
    from pyarrow import types

    return types.is_string(kind) or types.is_null(kind) or (types.is_list(kind) and _is_number(kind.value_type))


def _values_in(file: Any) -> int:
    """Return how many values a Parquet file says it has, those in lists counted one by one."""
    about = file.metadata
    groups = [about.row_group(k) for k in range(about.num_row_groups)]
    lists = [k for k in range(about.num_columns) if "." in about.schema.column(k).path]
    rows = max(about.num_rows, sum(group.num_rows for group in groups))
    return rows * about.num_columns + sum(group.column(k).num_values for group in groups for k in lists)


def _check_size(path: Path, size: int, most: int) -> None:
    if size > most:
        fault = f"it would take {size / _FREE:.3g} GiB of memory, over {_RATIO} times its size: it is not a run's"
        raise InvalidRecord(path, fault)


class Record:
    """The signals of a run. `time` is in seconds, shape (rows,).

    Args:
        path: a Parquet file with the column `time`, finite numbers that do not descend, and others; all are numbers or
            booleans.

    Raises:
        OSError: it cannot be read. InvalidRecord: it is damaged or no record.
    """

    def __init__(self, path: Path) -> None:
        self._table = read_parquet(path)
        for column in self._table.schema:
            if not _is_number(column.type) or self._table.column(column.name).null_count:
                raise InvalidRecord(path, f"its column {column.name!r} has other values than numbers")
        self._columns = columns_of_signals(self._table.column_names)
        if "time" not in self._table.column_names:
            raise InvalidRecord(path, "it has no column 'time'")
        self.time = self._values("time")
        if self.time.dtype != np.float64 or not np.isfinite(self.time).all():
            raise InvalidRecord(path, "its column 'time' has other values than finite numbers")
        if (later := np.flatnonzero(np.diff(self.time) < 0.0)).size:
            a, b = self.time[later[0] : later[0] + 2]
            raise InvalidRecord(
                path, f"in row {later[0] + 2} the time {b:g} s comes after {a:g} s: times must not descend"
            )
        for signal in self.signals:
            self._check_metadata(path, signal)

    def _check_metadata(self, path: Path, signal: str) -> None:
        try:
            for read in (self.unit, self.description, self.items):
                read(signal)
        except ValueError as e:
            raise InvalidRecord(path, f"the metadata of its column {signal!r} are damaged: {one_line(e)}") from e

    def __contains__(self, signal: object) -> bool:
        """Return whether a signal of this name, or an entry of an array, was recorded."""
        return signal in self._columns or any(signal in names for names in self._columns.values())

    def __getitem__(self, signal: str) -> NDArray[Any]:
        """Return a signal over time; an array port has its shape after the first axis, its entry `arm.p_WG[1]` none.

        Raises:
            KeyError: no such signal was recorded.
        """
        names = self._columns_of(signal)
        if names == [signal]:
            return self._values(signal)
        return np.column_stack([self._values(n) for n in names]).reshape(-1, *_indices(names[-1]))

    def series(self, signal: str) -> TimeSeries:
        """Return a signal's values as they were held, for an input that is to take them once more.

        The inputs of a run from outside, given to those of another by `System.external`, let that one do the same.

        Raises:
            KeyError: no such signal was recorded.
        """
        values = self[signal].reshape(len(self.time), -1)
        return TimeSeries(self.time, values, linear=False, unit=self.unit(signal))

    def row(self, k: int) -> "Record":
        """Return the record of one row alone, counted from 0, or from the last by -1."""
        one = Record.__new__(Record)
        one._table = self._table.slice(range(len(self.time))[k], 1)
        one._columns, one.time = self._columns, self.time[[k]]
        return one

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of the signals, in the order of the system's units."""
        return tuple(name for name in self._columns if name != "time")

    def unit(self, signal: str) -> str:
        """Return a signal's unit."""
        return self._metadata(signal).get(b"unit", b"1").decode()

    def description(self, signal: str) -> str:
        """Return the description of a signal; "" where it has none."""
        return self._metadata(signal).get(b"description", b"").decode()

    def items(self, signal: str) -> dict[int, str]:
        """Return the names of an enumeration's values; none for another signal."""
        items = self._metadata(signal).get(b"items", b"").decode()
        pairs = (item.partition(" ") for item in items.split(", ") if item)
        return {int(value): name for value, _, name in pairs}

    def _metadata(self, signal: str) -> dict[bytes, bytes]:
        return self._table.schema.field(self._columns_of(signal)[0]).metadata or {}

    def _columns_of(self, signal: str) -> list[str]:
        if signal in self._columns:
            return self._columns[signal]
        if signal not in self:
            raise KeyError(f"no signal {signal!r}; {nearest(signal, self._columns)}")
        return [signal]

    def _values(self, name: str) -> NDArray[Any]:
        from handover.cosim.record.columns import column_values  # slow to import, as what imports pyarrow

        return column_values(self._table.column(name))


def _indices(name: str) -> tuple[int, ...]:
    """Return the indices at the end of a column's name; none of a scalar."""
    found = SUBSCRIPT.search(name)
    return () if found is None else tuple(int(i) for i in found[1].split(","))


def columns_of_signals(names: Iterable[str]) -> dict[str, list[str]]:
    """Return a record's columns by the signals that they belong to: all entries of an array, or one column.

    Entries that are not those of a whole array, as where a unit counts them from 0, are signals by themselves.
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(SUBSCRIPT.sub("", name), []).append(name)
    columns: dict[str, list[str]] = {}
    for signal, parts in groups.items():
        columns |= {signal: parts} if _is_whole(signal, parts) else {name: [name] for name in parts}
    return columns


def _is_whole(signal: str, names: Sequence[str]) -> bool:
    """Return whether columns are a scalar, or all entries of an array in their order, counted from 1."""
    shape = _indices(names[-1])
    is_of_size = math.prod(shape) == len(names)
    return names == [signal] or (is_of_size and [_indices(name) for name in names] == indices_of(shape))


class RecordedSignals(Signals):
    """The signals of a run at one row of its record, which holds no pictures and texts.

    Attributes:
        row: of the record.
    """

    def __init__(self, record: Record) -> None:
        super().__init__({}, {}, owner=record)
        self._record = record
        self._arrays: dict[str, NDArray[Any]] = {}
        self.row = 0

    def __contains__(self, name: object) -> bool:
        """Return whether a signal of this name was recorded."""
        return name in self._record

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a copy of a signal's value in its shape.

        Raises:
            KeyError: it was not recorded.
        """
        if name not in self._arrays:
            self._arrays[name] = self._record[name]
        return np.array(self._arrays[name][self.row])

    def text(self, name: str) -> str:
        """Return the item's name of an enumeration."""
        value = int(self[name])
        return self._record.items(name).get(value, str(value))
