"""Records the scalar signals of a run, one column per signal; no row is lost in whatever way the process ends."""

import contextlib
from collections.abc import Generator, Sequence
from pathlib import Path
from types import TracebackType

from handover.cosim.exceptions import RecordNotWritten
from handover.cosim.record.columns import RecordColumns, record_columns
from handover.cosim.record.stream import RecordStream, finish_record, rewind_stream, stream_batches, stream_of, tail_of
from handover.cosim.record.tail import RecordBlock
from handover.cosim.system.signals import Signals


class Recorder:
    """An observer of `Master.run` that records every communication point. Use as a context manager.

    The record is `path`, a Parquet file, with other formats beside it as `formats` asks: see `RECORD_FORMATS`. Such
    files cannot be written as rows come. Rows go to a block in a memory-mapped file (`signals.tail`), and whole blocks
    to an Arrow stream (`signals.arrows`), both beside the record; leaving turns the two into the record, also when the
    run was cut short. If the process crashes, both files stay with every row, and `complete_record` makes the
    record of them.

    Code that steps units in another way than `Master.run` calls `open`, then adds rows to `block` as `RecordBlock`
    describes, and calls `flush` when it is full.

    Args:
        path: the record, with the suffix `.parquet`.
        formats: names of `RECORD_FORMATS`; Parquet is always written.
        after: continue the record of an earlier process after so many rows; later ones are discarded.
    """

    def __init__(self, path: Path, formats: Sequence[str] = (), after: int = 0) -> None:
        self.path = path
        self.stream, self.tail = stream_of(path), tail_of(path)
        self._formats = tuple(formats)
        self._after = after
        self._block: RecordBlock | None = None
        self._columns: RecordColumns | None = None
        self._file: RecordStream | None = None

    def __enter__(self) -> "Recorder":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._block is None or self._file is None:
            return
        try:
            self.flush()
        finally:
            self._file.close()
            self._block.close()
        with self._disk_errors():
            finish_record(self.path, self._formats, lambda: stream_batches(self.stream))
            self.tail.unlink(missing_ok=True)

    def __call__(self, t: float, signals: Signals) -> None:
        """Record one row."""
        if self._block is None:
            self.open(signals)
        if self.block.add(t):
            self.flush()

    def open(self, signals: Signals) -> None:
        """Begin the files, as the first row does otherwise.

        Raises:
            RecordNotWritten: they cannot be made, or another process records into them.
        """
        columns, sources = record_columns(signals.columns())
        about = {"places": columns.places, "formats": self._formats}
        with self._disk_errors(), contextlib.ExitStack() as undo:
            block = RecordBlock.create(self.tail, sources, about)
            undo.callback(block.close)
            size = rewind_stream(self.path, columns.schema, self._after) if self._after else 0
            self._file = RecordStream(self.stream, columns.schema, size)
            block.clear(self._after)
            undo.pop_all()
            self._block, self._columns = block, columns

    @property
    def is_open(self) -> bool:
        """Whether the files are begun, by `open` or by the first row."""
        return self._block is not None

    @property
    def block(self) -> RecordBlock:
        """The rows that are not in the stream yet, and where further rows go; the same block while recording."""
        if self._block is None:
            raise RuntimeError("nothing is recorded before `open`")
        return self._block

    @property
    def rows(self) -> int:
        """Rows recorded, those before `after` included."""
        return self._after if self._block is None else self._block.rows

    def flush(self) -> None:
        """Write the block's rows to the stream and empty it.

        Raises:
            RecordNotWritten: they cannot be written; they stay in the block.
        """
        if self._block is None or self._columns is None or self._file is None or not self._block.filled:
            return
        rows = self._block.rows
        with self._disk_errors():
            self._file.write(self._columns.batch(self._block))
        self._block.clear(rows)

    def sync(self) -> int:
        """Flush, wait until all rows are on the disk, and return their number.

        Raises:
            RecordNotWritten: as by `flush`.
        """
        self.flush()
        if self._file is not None:
            with contextlib.suppress(OSError):  # file systems without it
                self._file.sync()
        return self.rows

    @contextlib.contextmanager
    def _disk_errors(self) -> Generator[None, None, None]:
        try:
            yield
        except OSError as e:
            raise RecordNotWritten(self.path, e.strerror or str(e)) from e
