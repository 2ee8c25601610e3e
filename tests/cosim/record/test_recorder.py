import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
import pyarrow as pa
import pytest
from numpy.typing import NDArray
from support.cosim.signals_of import signals_of
from support.processes import with_path

from handover.cosim.exceptions import RecordNotWritten
from handover.cosim.files import FileLocked
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.record.stream import complete_record, stream_batches

FmuOf = Callable[..., Path]


def test_every_row_of_a_killed_process_is_recovered(fmu: FmuOf, tmp_path: Path):
    file, rows = tmp_path / "signals.parquet", 5000
    program = f"""
import os, signal
from fractions import Fraction
from pathlib import Path
from handover.cosim.master.master import Master
from handover.cosim.record.recorder import Recorder
from handover.cosim.system.system import System
s = System()
s.add("counter", Path({str(fmu("Counter"))!r}))
with Master(s) as master, Recorder(Path({str(file)!r}), ["csv"]) as recorder:
    kill = lambda: recorder.rows == {rows} and os.kill(os.getpid(), signal.SIGKILL)
    master.run(Fraction(10**6), [recorder], until=kill)
"""
    done = subprocess.run([sys.executable, "-c", program], check=False)
    assert done.returncode == -signal.SIGKILL
    assert not file.exists()
    assert complete_record(file) == rows
    assert Record(file)["counter.n"].tolist() == list(range(rows))
    assert sorted(os.listdir(tmp_path)) == ["signals.csv", "signals.parquet"]
    assert complete_record(file) == rows


def test_a_process_that_crashed_between_stream_and_counter_left_no_row_twice(tmp_path: Path):
    file = tmp_path / "signals.parquet"
    x = np.zeros(1)
    recorder = Recorder(file)
    _record(recorder, x, 10)
    counters = np.array(recorder.block.counters)
    recorder.flush()
    recorder.block.counters[:] = counters  # what the system would still hold then
    _abandon(recorder)
    assert complete_record(file) == 10
    assert Record(file)["unit.x"].tolist() == list(range(10))


def test_a_stream_that_is_cut_off_within_a_block_costs_no_row(tmp_path: Path):
    file = tmp_path / "signals.parquet"
    x = np.zeros(1)
    recorder = Recorder(file)
    _record(recorder, x, 10)
    recorder.flush()
    _record(recorder, x, 7, first=10)
    counters = np.array(recorder.block.counters)
    recorder.flush()
    recorder.block.counters[:] = counters
    _abandon(recorder)
    os.truncate(recorder.stream, recorder.stream.stat().st_size - 5)
    assert complete_record(file) == 17
    assert Record(file)["unit.x"].tolist() == [*range(10), *range(7)]


@pytest.mark.parametrize("compression", ["lz4", "zstd"])
def test_a_compressed_stream_is_refused_before_it_is_unpacked(tmp_path: Path, compression: Literal["lz4", "zstd"]):
    file = tmp_path / "signals.parquet"
    recorder = Recorder(file)
    _record(recorder, np.zeros(1), 10)
    recorder.flush()
    _abandon(recorder)
    (batch,) = stream_batches(recorder.stream)
    options = pa.ipc.IpcWriteOptions(compression=compression)
    with pa.ipc.new_stream(str(recorder.stream), batch.schema, options=options) as stream:
        stream.write_batch(batch)
    with pytest.raises(OSError, match="compressed"):
        complete_record(file)
    assert not file.exists()


def test_a_record_under_way_is_not_completed_by_another(tmp_path: Path):
    file = tmp_path / "signals.parquet"
    with Recorder(file) as recorder:
        _record(recorder, np.zeros(1), 3)
        with pytest.raises(FileLocked, match="still going on"):
            complete_record(file)
    assert complete_record(file) == 3


def test_the_bytes_do_not_depend_on_when_rows_are_flushed(tmp_path: Path):
    x = np.zeros(3)
    for name, flushed in (("a", ()), ("b", (1, 2, 700, 9000))):
        with Recorder(tmp_path / f"{name}.parquet") as recorder:
            _record(recorder, x, 20_000, flushed)
    assert (tmp_path / "a.parquet").read_bytes() == (tmp_path / "b.parquet").read_bytes()


@pytest.mark.parametrize("completed", [False, True])
def test_a_record_goes_on_after_a_row_of_a_dead_process(tmp_path: Path, completed: bool):
    x = np.zeros(2)
    with Recorder(tmp_path / "whole.parquet") as recorder:
        _record(recorder, x, 9000)
    first = Recorder(tmp_path / "joined.parquet")
    _record(first, x, 5000)
    assert first.sync() == 5000
    _record(first, x, 10)
    _abandon(first)
    if completed:
        complete_record(tmp_path / "joined.parquet")
    with Recorder(tmp_path / "joined.parquet", after=5000) as second:
        signals = signals_of({"x": x})
        for i in range(5000, 9000):
            x[:] = i
            second(float(i), signals)
        assert second.rows == 9000
    assert (tmp_path / "joined.parquet").read_bytes() == (tmp_path / "whole.parquet").read_bytes()


def test_a_record_that_is_too_short_is_not_gone_on_with(tmp_path: Path):
    file = tmp_path / "signals.parquet"
    x = np.zeros(2)
    with Recorder(file) as recorder:
        _record(recorder, x, 10)
    before = file.read_bytes()
    with (
        pytest.raises(RecordNotWritten, match="has 10 rows where the checkpoint counts 11"),
        Recorder(file, after=11) as second,
    ):
        second.open(signals_of({"x": x}))
    with pytest.raises(RecordNotWritten, match="other columns"), Recorder(file, after=5) as second:
        second.open(signals_of({"y": x}))
    assert file.read_bytes() == before


def test_rows_written_into_the_block_are_recorded_as_those_of_an_observer(tmp_path: Path):
    values = {"x": np.zeros(2), "n": np.zeros(1, dtype=np.int32), "on": np.zeros(1, dtype=bool)}
    signals = signals_of(values)

    def change(i: int) -> None:
        values["x"][:], values["n"][:], values["on"][:] = (i, -i), i, i % 3 == 0

    with Recorder(tmp_path / "observer.parquet") as recorder:
        for i in range(6000):
            change(i)
            recorder(i / 10, signals)
    with Recorder(tmp_path / "plan.parquet") as recorder:
        recorder.open(signals)
        block = recorder.block
        for i in range(6000):
            change(i)
            at = block.filled
            block.time[at] = i / 10
            for source, rows in block.parts:
                rows[at, :] = source
            block.counters[0] += 1
            if block.filled == block.capacity:
                recorder.flush()
    assert (tmp_path / "observer.parquet").read_bytes() == (tmp_path / "plan.parquet").read_bytes()


def test_a_full_disk_is_reported_and_leaves_what_was_recorded(tmp_path: Path):
    resource = pytest.importorskip("resource")
    file, x = tmp_path / "signals.parquet", np.zeros(1)
    recorder = Recorder(file)
    _record(recorder, x, 20)
    recorder.flush()
    size = recorder.stream.stat().st_size
    _record(recorder, x, 300)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 100, limits[1]))
    try:
        with pytest.raises(RecordNotWritten, match=r"signals\.parquet cannot be written: File too large"):
            recorder.flush()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert recorder.stream.stat().st_size == size
    _abandon(recorder)
    assert complete_record(file) == 320


def _record(recorder: Recorder, x: NDArray[np.float64], n: int, flushed: Sequence[int] = (), first: int = 0) -> None:
    signals = signals_of({"x": x})
    for i in range(n):
        x[:] = i
        recorder(float(first + i), signals)
        if i in flushed:
            recorder.flush()


def _abandon(recorder: Recorder) -> None:
    """Close the files as when a process crashes."""
    recorder.block.close()


PROGRAM = """
from pathlib import Path
import numpy as np
from handover.cosim.record.recorder import Recorder
from handover.scenarios.runs.results.summary import peak_memory
from support.cosim.signals_of import signals_of

def record(name, rows):
    x = np.zeros(100)
    signals = signals_of({"x": x})
    noise = np.random.default_rng(1)
    with Recorder(Path(name), ["csv", "mat"]) as recorder:
        for i in range(rows):
            x[:] = noise.random(100)
            recorder(i / 100, signals)
    return peak_memory()

print(record("short.parquet", 20_000), record("long.parquet", 60_000))
"""


@pytest.mark.slow
def test_a_record_of_six_million_values_takes_no_more_memory_than_one_of_two(tmp_path: Path):
    pytest.importorskip("resource")
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=with_path(),
        cwd=tmp_path,
        check=True,
        capture_output=True,
        text=True,
    )
    short, long = (float(n) for n in done.stdout.split())
    assert (tmp_path / "long.parquet").stat().st_size > 42e6
    assert long - short < 20e6
