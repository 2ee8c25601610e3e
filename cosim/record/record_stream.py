"""The file that rows of a record go to block by block: an Arrow stream, to which one can return after a crash."""

import os
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pyarrow as pa


class RecordStream:
    """Appends record batches to a file in Arrow's streaming format, which other tools can read as it is.

    A batch that cannot be written whole leaves nothing behind.
    """

    def __init__(self, path: Path, schema: pa.Schema, size: int = 0) -> None:
        """Begin a file, or go on with one after its first `size` bytes.

        Raises:
            OSError: the file cannot be written.
        """
        self.path = path
        self._file = open(path, "r+b" if size else "wb", buffering=0)  # noqa: SIM115 (kept open)
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
        """Wait until all is on the disk, so that it outlives the machine's end."""
        os.fsync(self._file.fileno())

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _append(self, data: Any) -> None:
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
        OSError: there is no such file, or not even its beginning is whole.
    """
    try:
        with pa.OSFile(str(path), "rb") as source, pa.ipc.open_stream(source) as stream:
            return stream.schema
    except pa.ArrowInvalid as e:
        raise OSError(f"{path} is not the stream of a record: {e}") from e


def stream_batches(path: Path) -> Generator["pa.RecordBatch", None, None]:
    """Read the whole batches of a stream that may be cut off anywhere."""
    with pa.OSFile(str(path), "rb") as source, pa.ipc.open_stream(source) as stream:
        while True:
            try:
                yield stream.read_next_batch()
            except StopIteration:
                return
            except (pa.ArrowInvalid, OSError):  # cut off within a batch
                return
