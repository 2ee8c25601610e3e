"""The rows of a record that are not in its stream yet, in a memory-mapped file that outlives the process."""

import contextlib
import json
import mmap
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray
from typing_extensions import NotRequired, TypedDict

from handover.cosim.files import FileLocked, check_regular, lock_file, unlock_file
from handover.cosim.typed_data import Count, decoded

MAGIC = b"HANDOVER"
HEADER = np.dtype([("magic", "S8"), ("layout", "<i8"), ("filled", "<i8"), ("first", "<i8")])
_ALIGNMENT = 64
_BYTES = 2**22
_MIN_ROWS, _MAX_ROWS = 16, 4096


class Part(NamedTuple):
    """Where rows come from and where they go.

    `values` is an array of n outputs of one unit, contiguous; `rows` is [capacity, n], row-major, of the same type.
    """

    values: NDArray[Any]
    rows: NDArray[Any]


class Layout(TypedDict):
    """How a block's file is laid out, and what whoever completes the record must know.

    `parts` have their dtype and number of values a row; `places` are the part and the index in it of each column, and
    `formats` those of the record besides Parquet.
    """

    capacity: Annotated[int, Meta(ge=1, le=2**31)]
    parts: list[tuple[Annotated[str, Meta(pattern=r"^[<>|=][a-z][0-9]{1,2}$")], Count]]
    places: NotRequired[list[tuple[Count, Count]]]
    formats: NotRequired[list[Literal["parquet", "csv", "mat"]]]


class DamagedTail(ValueError):
    """A file that should hold the last rows of a record does not."""


class RecordBlock:
    """Rows that wait to be written, in memory that the operating system keeps in whatever way the process ends.

    To add a row: set `time[i]` and, of every part, `rows[i, :] = values` with i = `counters[0]`, and only then add one
    to `counters[0]`: only counted rows are valid. When it reaches `capacity`, the recorder's `flush`
    has to be called. Python and C do the same; C must keep its compiler from storing the counter before the rows
    (by a volatile or atomic store).

    The file holds a header of 32 bytes (magic, bytes of layout, the two counters), the layout in JSON, and, each at a
    multiple of 64 bytes, `time` and the rows of the parts. While the block is open, the file is locked.

    Attributes:
        capacity: rows that the block can hold.
        time: seconds, [capacity].
        parts: where rows come from and go.
        counters: int64, [2]: rows in the block, and the number of rows of the record that came before them.
    """

    def __init__(self, file: mmap.mmap, handle: Any, sources: Sequence[NDArray[Any]] | None = None) -> None:
        header = np.frombuffer(file, dtype=HEADER, count=1)
        if header["magic"][0] != MAGIC:
            raise DamagedTail("it does not begin as the last rows of a record do")
        size = int(header["layout"][0])
        self.layout = read_layout(file, size)
        self._file, self._handle = file, handle
        self.capacity = int(self.layout["capacity"])
        self.counters, self.time, rows = block_arrays(file, self.layout, HEADER.itemsize + size)
        self.parts: list[Part] = []
        for i, (dtype, n) in enumerate(self.layout["parts"]):
            self.parts.append(Part(sources[i] if sources is not None else np.zeros(n, dtype), rows[i]))
        if not (0 <= self.counters[0] <= self.capacity and self.counters[1] >= 0):
            raise DamagedTail(f"it counts {self.counters[0]} rows of {self.capacity} after {self.counters[1]}")

    @classmethod
    def create(cls, path: Path, sources: Sequence[NDArray[Any]], about: dict[str, Any]) -> "RecordBlock":
        """Make the file for rows of these arrays; `about` is kept in its layout.

        Its space on the disk is allocated here: a full disk while writing to mapped memory would kill the process.

        Raises:
            FileLocked: a running process records into that file. OSError: it cannot be made.
        """
        parts: list[tuple[str, int]] = [(a.dtype.str, len(a)) for a in sources]
        row = 8 + sum(a.itemsize * len(a) for a in sources)
        capacity = min(max(_BYTES // row, _MIN_ROWS), _MAX_ROWS)
        layout = json.dumps({**about, "capacity": capacity, "parts": parts}).encode()
        size = _aligned(_aligned(HEADER.itemsize + len(layout)) + 8 * capacity)
        for a in sources:
            size = _aligned(size + a.itemsize * len(a) * capacity)
        if path.is_symlink():  # in a folder of somebody else it would have another file written
            path.unlink()
        handle = open(path, "a+b")  # noqa: SIM115 (kept open: it carries the lock)
        try:
            lock_file(handle)
            handle.truncate(0)
            header = np.array([(MAGIC, len(layout), 0, 0)], dtype=HEADER)
            handle.write((header.tobytes() + layout).ljust(size, b"\0"))
            handle.flush()
            return cls(mmap.mmap(handle.fileno(), size), handle, sources)
        except BaseException:
            handle.close()
            raise

    @classmethod
    def open(cls, path: Path) -> "RecordBlock":
        """Open the file of an earlier process.

        Raises:
            FileLocked: that process still runs. DamagedTail: the file is not whole. OSError: it cannot be read.
        """
        check_regular(path)
        handle = open(path, "r+b")  # noqa: SIM115 (kept open: it carries the lock)
        try:
            lock_file(handle)
            return cls(mmap.mmap(handle.fileno(), 0), handle)
        except FileLocked:
            handle.close()
            raise
        except (ValueError, KeyError, TypeError) as e:  # too short, or not in the format that `create` writes
            handle.close()
            raise DamagedTail(f"{path}: {e}") from e

    @property
    def filled(self) -> int:
        """Rows in the block."""
        return int(self.counters[0])

    @property
    def rows(self) -> int:
        """Rows of the record until now, those before the block included."""
        return int(self.counters[0] + self.counters[1])

    def add(self, t: float) -> bool:
        """Add a row of what the sources hold at time t; return whether the block is full."""
        i = int(self.counters[0])
        self.time[i] = t
        for values, rows in self.parts:
            rows[i] = values
        self.counters[0] = i + 1
        return i + 1 == self.capacity

    def clear(self, first: int) -> None:
        """Discard the rows, as `first` rows are in the stream now.

        In this order: after a crash between the two, the block is empty, and no row is counted twice.
        """
        self.counters[0] = 0
        self.counters[1] = first

    def close(self) -> None:
        """Close the file. Memory of arrays that are still held elsewhere stays."""
        unlock_file(self._handle)
        with contextlib.suppress(OSError):  # a unit has closed its descriptor; what is mapped stays
            self._handle.close()
        # The mapping can be closed only when no array refers to it any more.
        self.counters, self.time, self.parts = np.zeros(2, dtype=np.int64), np.zeros(0), []
        with contextlib.suppress(BufferError):  # an array of it is held elsewhere
            self._file.close()


def read_layout(file: mmap.mmap, size: int) -> "Layout":
    """Return the layout of a block's file, which has so many bytes.

    Raises:
        ValueError: it is damaged.
    """
    return decoded(file[HEADER.itemsize : HEADER.itemsize + max(size, 0)], Layout)


def block_arrays(
    file: mmap.mmap, layout: "Layout", end: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], list[NDArray[Any]]]:
    """Return counters, times and the rows of each part of a block's file, whose layout ends at a byte."""
    counters: NDArray[np.int64] = np.frombuffer(file, dtype=np.int64, count=2, offset=16)
    capacity, offset = int(layout["capacity"]), _aligned(end)
    time: NDArray[np.float64] = np.frombuffer(file, dtype=np.float64, count=capacity, offset=offset)
    offset = _aligned(offset + time.nbytes)
    parts: list[NDArray[Any]] = []
    for dtype, n in layout["parts"]:
        flat: NDArray[Any] = np.frombuffer(file, dtype=dtype, count=capacity * n, offset=offset)
        parts.append(flat.reshape(-1, n))
        offset = _aligned(offset + flat.nbytes)
    return counters, time, parts


def _aligned(n: int) -> int:
    return -(-n // _ALIGNMENT) * _ALIGNMENT
