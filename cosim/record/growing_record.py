"""The newest row of a record that a running process writes, read by another one without a word to it.

The rows of a run under way lie in a memory-mapped file (`signals.tail`, see `RecordBlock`), whose counters are raised
only after a row is whole. Who maps that file, too, sees each row as it comes; the run knows nothing of it.
"""

import mmap
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.record.columns import column_metadata
from handover.cosim.record.reader import Record, columns_of_signals
from handover.cosim.record.stream import stream_of, stream_schema, tail_of
from handover.cosim.record.tail import HEADER, MAGIC, block_arrays, read_layout

_TRIES = 20
"""How often a row is read anew that the run overwrites meanwhile."""


class NoRows(Exception):
    """The run has not written its first row yet, or has completed its record already."""


class GrowingRecord(Record):
    """A record of one row, the newest at the last `refresh`; signals, units and items are as in any record.

    Args:
        path: where the record will be (`signals.parquet`).

    Raises:
        NoRows: it is not under way: not begun, or complete.
    """

    def __init__(self, path: Path) -> None:
        try:
            self._schema = stream_schema(stream_of(path))
            with open(tail_of(path), "rb") as file:
                self._map = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            header = np.frombuffer(self._map, dtype=HEADER, count=1)
            if header["magic"][0] != MAGIC:
                raise NoRows
            size = int(header["layout"][0])
            layout = read_layout(self._map, size)
            self._counters, self._times, self._rows = block_arrays(self._map, layout, HEADER.itemsize + size)
        except (OSError, ValueError) as e:
            raise NoRows from e
        self.places: dict[str, tuple[int, int]] = dict(
            zip(self._schema.names[1:], layout.get("places", []), strict=True)
        )
        """By column, the part of a row and the index in it."""
        self._columns = columns_of_signals(self._schema.names)
        self._about = dict(column_metadata(self._schema))
        self.newest: list[NDArray[Any]] = []
        """The values of the newest row, in the block's parts."""
        self.unseen: list[tuple[float, list[NDArray[Any]]]] = []
        """Times, s, and values of the rows that came between the last two calls of `refresh`, the newest one last."""
        self.count = 0
        """Rows of the record until the one that is shown."""
        self.time = np.zeros(0)
        if not self.refresh():
            raise NoRows

    def refresh(self) -> bool:
        """Read the newest row; return whether there is one that was not seen before.

        Of the rows before it that came meanwhile, those are in `unseen` which the run still has in memory.
        """
        for tried in range(_TRIES):
            first, filled = int(self._counters[1]), int(self._counters[0])  # in this order, lest a flush comes between
            if not filled or filled + first == self.count:
                return False
            begin = max(self.count - first, 0) if 2 * tried < _TRIES else filled - 1  # in haste: the newest alone
            parts = [np.array(rows[begin:filled]) for rows in self._rows]
            times = np.array(self._times[begin:filled], dtype=np.float64)
            if int(self._counters[1]) == first and int(self._counters[0]) >= filled:
                self.unseen = [(t, [part[k].copy() for part in parts]) for k, t in enumerate(times.tolist())]
                self.newest, self.time, self.count = self.unseen[-1][1], times[-1:], filled + first
                return True
        return False

    def close(self) -> None:
        """Release the file; the row that was read stays."""
        self._rows, self._times, self._counters = [], np.zeros(0), np.zeros(2, dtype=np.int64)
        self._map.close()

    def metadata(self, signal: str) -> dict[bytes, bytes]:
        """Return unit, description and items of a signal, as in the record's schema."""
        about = self._about[self._columns_of(signal)[0]]
        return {key.encode(): value.encode() for key, value in about.items()}

    def _metadata(self, signal: str) -> dict[bytes, bytes]:
        return self.metadata(signal)

    def _values(self, name: str) -> NDArray[Any]:
        if name == "time":
            return self.time
        part, index = self.places[name]
        return self.newest[part][index : index + 1]
