"""Reads the signals of a run from its record: `record["arm.p_WG"]` is an array of shape (rows, 3).

`RecordedSignals` replays a record row by row, as an observer of the run saw its signals.
"""

import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.variable import indices_of
from handover.cosim.exceptions import nearest
from handover.cosim.system.signals import Signals
from handover.cosim.system.time_series import TimeSeries

SUBSCRIPT = re.compile(r"\[(\d+(?:,\d+)*)\]$")
"""The end of a column's name that is an entry of an array, counted from 1."""


class Record:
    """The signals of a run. `time` is in seconds, shape (rows,)."""

    def __init__(self, path: Path) -> None:
        import pyarrow.parquet as pq  # slow to import, and scenarios import this class before there is any record

        self._table = pq.read_table(path)
        self._columns = columns_of_signals(self._table.column_names)
        self.time = self._values("time")

    def __contains__(self, signal: object) -> bool:
        """Return whether a signal of this name was recorded."""
        return signal in self._columns

    def __getitem__(self, signal: str) -> NDArray[Any]:
        """Return a signal over time; an array port has its shape after the first axis.

        Raises:
            KeyError: no such signal was recorded.
        """
        if signal not in self._columns:
            raise KeyError(f"no signal {signal!r}; {nearest(signal, self._columns)}")
        names = self._columns[signal]
        if names == [signal]:
            return self._values(signal)
        return np.column_stack([self._values(n) for n in names]).reshape(-1, *_indices(names[-1]))

    def series(self, signal: str) -> TimeSeries:
        """Return a signal's values as they were held, for an input that is to take them once more.

        The inputs of a run from outside, given to those of another by `System.external`, let that one do the same.

        Raises:
            KeyError: no such signal was recorded.
        """
        return TimeSeries(self.time, self[signal].reshape(len(self.time), -1), linear=False)

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
        return self._table.schema.field(self._columns[signal][0]).metadata or {}

    def _values(self, name: str) -> NDArray[Any]:
        return self._table.column(name).to_numpy()


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
