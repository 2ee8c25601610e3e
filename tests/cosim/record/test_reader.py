import math
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.cosim.signals_of import signals_of
from support.wording import Wording

from handover.cosim.record import reader
from handover.cosim.record.columns import column_values
from handover.cosim.record.formats import write_parquet
from handover.cosim.record.growing_record import GrowingRecord, NoRows
from handover.cosim.record.reader import InvalidRecord, Record, read_parquet
from handover.cosim.record.recorder import Recorder


def test_entries_that_are_no_whole_array_are_signals_by_themselves(tmp_path: Path):
    names = ["time", "a.p[1]", "a.p[2]", "a.q[0]", "a.q[1]", "a.r[2]", "a.s[1,1]", "a.s[1,2]", "a.t[9999999999]"]
    names += [f"a.u[{'9' * 5000}]", f"a.v[{','.join('1' * 100)}]"]
    pq.write_table(pa.table({name: [float(k)] for k, name in enumerate(names)}), tmp_path / "r.parquet")
    record = Record(tmp_path / "r.parquet")
    assert record.signals == ("a.p", "a.q[0]", "a.q[1]", "a.r[2]", "a.s", *names[8:])
    assert record["a.p"].tolist() == [[1.0, 2.0]]
    assert record["a.s"].tolist() == [[[6.0, 7.0]]]
    assert [record[name].tolist() for name in ("a.q[0]", "a.r[2]")] == [[3.0], [5.0]]


def test_a_decompression_bomb_is_refused_and_what_takes_as_much_memory_as_its_file_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(reader, "_FREE", 1 << 20)
    monkeypatch.setattr(reader, "_RATIO", 100)
    bombs: tuple[dict[str, Any], ...] = (
        {"time": [0.0] * 300_000},
        {"reason": ["long" * 1000] * 1000},
        {"x": [[0.0] * 300_000]},
        {"x": pa.nulls(300_000)},
    )
    for bomb in bombs:
        pq.write_table(pa.table(bomb), tmp_path / "r.parquet")
        with pytest.raises(InvalidRecord, match="times its size"):
            read_parquet(tmp_path / "r.parquet")
    times = np.random.default_rng(1).normal(size=200_000)
    pq.write_table(pa.table({"time": pa.array(times)}), tmp_path / "r.parquet")
    assert read_parquet(tmp_path / "r.parquet").num_rows == len(times)


def test_what_is_no_record_is_refused_where_it_is_opened(tmp_path: Path, wording: Wording):
    tables: tuple[dict[str, Any], ...] = (
        {"time": ["0", "1"]},
        {"time": pa.nulls(2, pa.float64())},
        {"time": [0.0, math.inf]},
        {"time": [0.0, math.nan]},
        {"time": [[0.0], [1.0]]},
        {"time": [0, 1]},
        {"time": [0.0, 0.2, 0.2, 0.1]},
        {"a.y": [0.0, 1.0]},
        {"time": [0.0, 1.0], "a.y": ["\x1b[31m", "x"]},
        {"time": [0.0, 1.0], "a.y": [None, True]},
        {"time": [0.0, 1.0], "a.y": [{"x": 1}, {"x": 2}]},
    )
    for columns in tables:
        pq.write_table(pa.table(columns), tmp_path / "r.parquet")
        with pytest.raises(InvalidRecord) as caught:
            Record(tmp_path / "r.parquet")
        wording.check(caught.value)


def test_a_record_of_which_some_bytes_are_others_is_refused(tmp_path: Path):
    file = tmp_path / "r.parquet"
    values = np.random.default_rng(0).random(500)  # nothing of them can be compressed
    batch: Any = pa.record_batch(cast(Any, {"time": np.arange(500.0), "a.x": values}))
    write_parquet(file, batch.schema, [batch])
    before: Any = pq.read_table(file)
    file.write_bytes(file.read_bytes().replace(values[100].tobytes(), np.float64(1e300).tobytes()))
    assert not pq.read_table(file).equals(before)
    with pytest.raises(InvalidRecord):
        Record(file)


@pytest.mark.parametrize("metadata", [{"unit": b"\xff"}, {"items": b"x WAIT"}])
def test_damaged_metadata_of_a_column_are_refused(tmp_path: Path, metadata: dict[str, bytes]):
    schema = pa.schema([pa.field("time", pa.float64()), pa.field("a.phase", pa.int64(), metadata=cast(Any, metadata))])
    pq.write_table(pa.table({"time": [0.0], "a.phase": [1]}, schema=schema), tmp_path / "r.parquet")
    with pytest.raises(InvalidRecord, match=r"a\.phase"):
        Record(tmp_path / "r.parquet")


ARRAYS: dict[str, Any] = {
    "reals": pa.array([0.5, float("nan"), -0.0, 3.0]),
    "integers": pa.array([1, -(2**63), 2**63 - 1, 4]),
    "unsigned": pa.array([0, 2**64 - 1, 2, 3], pa.uint64()),
    "truths": pa.array([True, False, False, True] * 5),
    "of another width": pa.array([1.0, 2.0, 3.0, 4.0], pa.float32()),
    "with a gap": pa.array([1.0, None, 3.0, 4.0]),
    "texts": pa.array(["a", "b", "c", "d"]),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_they_are_those_of_to_numpy_whole_sliced_chunked_and_empty(name: str):
    array = ARRAYS[name]
    for given in (array, array[1:3], array[3:], array[:0]):
        for column in (given, pa.chunked_array([given]), pa.chunked_array([given, array[2:2], array[1:]])):
            wanted = column.to_numpy(zero_copy_only=False)
            found = column_values(column)
            assert (found.dtype, found.shape) == (wanted.dtype, wanted.shape)
            np.testing.assert_array_equal(found, wanted)
            assert found.dtype.kind == "O" or found.tobytes() == wanted.tobytes()


def test_pandas_is_not_loaded_for_them():
    program = """
import sys, numpy as np, pyarrow as pa
from handover.cosim.record.columns import _array, column_values
column_values(pa.chunked_array([_array(pa.float64(), np.zeros(3)), _array(pa.float64(), np.ones(2))]))
column_values(_array(pa.bool_(), np.ones(9, dtype=bool)))
print("pandas" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_the_newest_row_is_what_was_recorded_last(tmp_path: Path):
    file = tmp_path / "signals.parquet"
    x, n = np.zeros(3), np.zeros(1, dtype=np.int32)
    signals = signals_of({"x": x, "n": n})
    with pytest.raises(NoRows):
        GrowingRecord(file)
    with Recorder(file) as recorder:
        recorder.open(signals)
        with pytest.raises(NoRows):
            GrowingRecord(file)
        x[:], n[:] = (1.0, 2.0, 3.0), 7
        recorder(0.5, signals)
        growing = GrowingRecord(file)
        assert growing.time.tolist() == [0.5]
        assert growing["unit.x"].tolist() == [[1.0, 2.0, 3.0]]
        assert growing["unit.n"].tolist() == [7]
        assert "unit.x" in growing
        assert "unit.x[3]" in growing
        assert "unit.x[4]" not in growing
        assert not growing.refresh()
        x[:] = 4.0
        recorder(1.0, signals)
        assert growing["unit.x"].tolist() == [[1.0, 2.0, 3.0]], "only refresh reads"
        assert growing.refresh()
        assert growing["unit.x"].tolist() == [[4.0, 4.0, 4.0]]
        assert growing.count == 2
        for k in range(3):
            x[:] = 5.0 + k
            recorder(1.5 + 0.5 * k, signals)
        assert growing.refresh()
        assert [t for t, _ in growing.unseen] == [1.5, 2.0, 2.5]
        part, index = next(place for name, place in growing.places.items() if name.startswith("unit.x"))
        assert [row[part][index] for _, row in growing.unseen] == [5.0, 6.0, 7.0]
    complete = Record(file)
    assert growing.signals == complete.signals
    assert {s: growing.unit(s) for s in growing.signals} == {s: complete.unit(s) for s in complete.signals}
    assert growing["unit.x"].tolist() == [[7.0, 7.0, 7.0]], "what was read stays"
    with pytest.raises(NoRows):
        GrowingRecord(file)


@pytest.mark.slow
def test_no_row_is_torn_while_blocks_are_flushed(tmp_path: Path):
    """Each row holds one number many times; the writer flushes some hundred blocks while another thread reads."""
    file = tmp_path / "signals.parquet"
    x = np.zeros(2000)
    signals = signals_of({"x": x})
    seen: list[float] = []
    done = threading.Event()

    def write() -> None:
        for i in range(2, 4000):
            x[:] = i
            recorder(float(i), signals)
        done.set()

    with Recorder(file) as recorder:
        x[:] = 1.0
        recorder(1.0, signals)
        growing = GrowingRecord(file)
        writer = threading.Thread(target=write)
        writer.start()
        while not done.is_set():
            if growing.refresh():
                row = growing["unit.x"][0]
                assert row.min() == row.max() == growing.time[0]
                assert all(values.min() == values.max() == t for t, (values, *_) in growing.unseen)
                seen += [t for t, _ in growing.unseen]
        writer.join()
    assert len(seen) > 100
    assert seen == sorted(set(seen))
