"""The Arrow stream that a record's rows go to block by block, and how it becomes the record, also after a crash.

While a run is under way, whole blocks are in the stream (`signals.arrows`) and the rows after them in the tail
(`signals.tail`). `finish_record` makes the record of a complete stream, `complete_record` of what a crashed process
left of both.
"""

import os
import struct
from collections.abc import Callable, Generator, Iterable, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from handover.cosim.files import check_regular
from handover.cosim.fmu.host_process import opened_file
from handover.cosim.record.columns import RecordColumns
from handover.cosim.record.formats import RECORD_FORMATS
from handover.cosim.record.tail import DamagedTail, RecordBlock


class RecordStream:
    """Appends record batches to a file in Arrow's streaming format, which other tools can read as it grows.

    A batch that cannot be written whole leaves nothing behind. If a unit has closed the file's descriptor, or opened
    another file under its number, the file is opened again.
    """

    def __init__(self, path: Path, schema: pa.Schema, size: int = 0) -> None:
        """Begin a file, or continue one after its first `size` bytes.

        Raises:
            OSError: the file cannot be written.
        """
        self.path = path
        self._file = open(path, "r+b" if size else "wb", buffering=0)  # noqa: SIM115 (kept open)
        self._lost: list[Any] = []  # files whose descriptors belong to somebody else: not to be closed
        self._opened = opened_file(self._file.fileno())
        self.size = size
        """Bytes written."""
        if size:
            self._file.truncate(size)
            self._file.seek(size)
        else:
            self._append(schema.serialize())

    def write(self, batch: "pa.RecordBatch") -> None:
        """Append a batch.

        Raises:
            OSError: it cannot be written, as on a full disk.
        """
        self._append(batch.serialize())

    def sync(self) -> None:
        """Wait until all is on the disk, so that it survives a crash of the machine."""
        self._reopen_if_lost()
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._reopen_if_lost()
        self._file.close()

    def _reopen_if_lost(self) -> None:
        if opened_file(self._file.fileno()) != self._opened:
            self._lost.append(self._file)
            self._file = open(self.path, "r+b", buffering=0)  # noqa: SIM115 (kept open)
            self._file.seek(self.size)

    def _append(self, data: Any) -> None:
        self._reopen_if_lost()
        left = memoryview(data)
        try:
            while left.nbytes:
                left = left[self._file.write(left) :]
        except OSError:
            self._file.truncate(self.size)
            self._file.seek(self.size)
            raise
        self.size = self._file.tell()


def stream_schema(path: Path) -> "pa.Schema":
    """Return the schema of a stream.

    Raises:
        OSError: there is no such file, or its schema is not complete.
    """
    check_regular(path)
    try:
        with pa.OSFile(str(path), "rb") as source, pa.ipc.open_stream(source) as stream:
            return stream.schema
    except pa.ArrowInvalid as e:
        raise OSError(f"{path} is not the stream of a record: {e}") from e


def stream_batches(path: Path) -> Generator["pa.RecordBatch", None, None]:
    """Read the whole batches of a stream that may be cut off anywhere.

    Raises:
        OSError: a batch is compressed, as a run writes none: it could take any amount of memory.
    """
    schema = stream_schema(path)
    with pa.OSFile(str(path), "rb") as source:
        messages = pa.ipc.MessageReader.open_stream(source)
        messages.read_next_message()  # the schema
        while True:
            try:
                message = messages.read_next_message()
                is_plain = _is_plain(message)
                batch = pa.ipc.read_record_batch(message, schema) if is_plain else None
            except StopIteration:
                return
            except (pa.ArrowInvalid, OSError):  # cut off within a batch
                return
            if batch is None:
                raise OSError(f"{path} is not the stream of a record: a batch in it is compressed")
            yield batch


def _is_plain(message: Any) -> bool:
    """Return whether a message is a record batch without the field `compression`, the fourth of its table.

    pyarrow does not say so; the table is as of the format's Message.fbs, in which a table's offset to its vtable, and
    the vtable's length and offsets of fields come first.
    """
    if message.type != "record batch":
        return False
    data = message.metadata.to_pybytes()

    def field(table: int, number: int) -> int:
        vtable = table - struct.unpack_from("<i", data, table)[0]
        at = 4 + 2 * number
        held = at < struct.unpack_from("<H", data, vtable)[0]
        return struct.unpack_from("<H", data, vtable + at)[0] if held else 0

    root = struct.unpack_from("<I", data)[0]
    header = root + field(root, 2)
    return not field(header + struct.unpack_from("<I", data, header)[0], 3)


Batches = Callable[[], Iterable["pa.RecordBatch"]]
"""Returns all rows of a record, at each call from the first one on."""


def stream_of(path: Path) -> Path:
    """Return the path of the whole blocks of a record under way."""
    return path.with_suffix(".arrows")


def tail_of(path: Path) -> Path:
    """Return the path of the rows after the last whole block."""
    return path.with_suffix(".tail")


def complete_record(path: Path) -> int:
    """Complete the record of a crashed process, in the formats that it was to write; return the number of rows.

    Nothing is changed where the record is complete already.

    Args:
        path: the record (`signals.parquet`), which need not exist yet.

    Raises:
        FileLocked: the process still runs. OSError: there are no rows at all, or the record cannot be written.
    """
    stream = stream_of(path)
    if not stream.exists():
        return _rows_in(path)
    block = _unfinished_block(tail_of(path))
    if block is None:
        return finish_record(path, (), lambda: stream_batches(stream))
    try:
        written = sum(batch.num_rows for batch in stream_batches(stream))
        columns = RecordColumns(stream_schema(stream), block.layout.get("places", []))
        try:
            last = columns.batch(block, min(written - int(block.counters[1]), block.filled))
        except LookupError as e:
            raise DamagedTail(f"{tail_of(path)} has other columns than {stream}") from e
        return finish_record(path, block.layout.get("formats", []), lambda: _chained(stream, last))
    finally:
        block.close()
        if not stream.exists():
            tail_of(path).unlink(missing_ok=True)


def finish_record(path: Path, formats: Sequence[str], batches: Batches) -> int:
    """Write a record in Parquet and other formats, then remove its stream; return the number of rows.

    Raises:
        OSError: a file cannot be written; the stream stays.
    """
    schema = stream_schema(stream_of(path))
    for name in dict.fromkeys(("parquet", *formats)):
        made = path if name == "parquet" else path.with_suffix(f".{name}")
        unfinished = made.with_name(made.name + ".part")
        unfinished.unlink(missing_ok=True)  # a link in a folder of somebody else would have another file written
        try:
            RECORD_FORMATS[name](unfinished, schema, batches())
            os.replace(unfinished, made)
        except OSError:
            unfinished.unlink(missing_ok=True)
            raise
    stream_of(path).unlink()
    return _rows_in(path)


def rewind_stream(path: Path, schema: "pa.Schema", rows: int) -> int:
    """Cut a record's stream after `rows` rows, or make it again from the completed record; return its size in bytes.

    Raises:
        OSError: neither is there, or they have fewer rows or other columns.
    """
    stream = stream_of(path)
    source = stream if stream.exists() else path
    present = stream_schema(stream) if source == stream else pq.read_schema(path)
    if not present.equals(schema, check_metadata=True):
        raise OSError(f"{source} has other columns than this run records")
    batches = stream_batches(stream) if source == stream else _completed_batches(path)
    unfinished = stream.with_name(stream.name + ".part")
    unfinished.unlink(missing_ok=True)  # it may be a link to another file
    rewound = RecordStream(unfinished, schema)
    left = rows
    try:
        for batch in batches:
            if not left:
                break
            rewound.write(batch.slice(0, left))
            left -= min(left, batch.num_rows)
    finally:
        rewound.close()
    if left:
        raise OSError(f"{source} has {rows - left} rows where the checkpoint counts {rows}")
    os.replace(rewound.path, stream)
    return rewound.size


def _unfinished_block(path: Path) -> RecordBlock | None:
    try:
        return RecordBlock.open(path)
    except (FileNotFoundError, DamagedTail):  # the process crashed before there was a row in it
        return None


def _chained(stream: Path, last: "pa.RecordBatch") -> Iterable["pa.RecordBatch"]:
    yield from stream_batches(stream)
    yield last


def _completed_batches(path: Path) -> Iterable["pa.RecordBatch"]:
    return pq.ParquetFile(path, page_checksum_verification=True).iter_batches()


def _rows_in(path: Path) -> int:
    check_regular(path)
    rows: int = pq.read_metadata(path).num_rows
    return rows
