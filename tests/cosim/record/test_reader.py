import math
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from handover.cosim.record import reader
from handover.cosim.record.reader import InvalidRecord, Record, read_parquet


def test_an_enumerations_names_are_read_back(tmp_path: Path):
    fields = [
        pa.field("time", pa.float64(), metadata={"unit": "s"}),
        pa.field("servo.phase", pa.int64(), metadata={"unit": "1", "items": "0 WAIT, 5 GIVEN_UP"}),
    ]
    table = pa.Table.from_arrays([pa.array([0.0]), pa.array([5])], schema=pa.schema(fields))
    pq.write_table(table, tmp_path / "r.parquet")
    record = Record(tmp_path / "r.parquet")
    assert record.items("servo.phase") == {0: "WAIT", 5: "GIVEN_UP"}
    assert record.items("time") == {}


def test_entries_that_are_no_whole_array_are_signals_by_themselves(tmp_path: Path):
    names = ["time", "a.p[1]", "a.p[2]", "a.q[0]", "a.q[1]", "a.r[2]", "a.s[1,1]", "a.s[1,2]", "a.t[9999999999]"]
    names += [f"a.u[{'9' * 5000}]", f"a.v[{','.join('1' * 100)}]"]
    pq.write_table(pa.table({name: [float(k)] for k, name in enumerate(names)}), tmp_path / "r.parquet")
    record = Record(tmp_path / "r.parquet")
    assert record.signals == ("a.p", "a.q[0]", "a.q[1]", "a.r[2]", "a.s", *names[8:])
    assert record["a.p"].tolist() == [[1.0, 2.0]]
    assert record["a.s"].tolist() == [[[6.0, 7.0]]]
    assert [record[name].tolist() for name in ("a.q[0]", "a.r[2]")] == [[3.0], [5.0]]


@pytest.fixture
def little_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reader, "_FREE", 1 << 20)
    monkeypatch.setattr(reader, "_RATIO", 100)


@pytest.mark.usefixtures("little_memory")
@pytest.mark.parametrize(
    "bomb",
    [
        {"time": [0.0] * 300_000},
        {"reason": ["long" * 1000] * 1000},
        {"x": [[0.0] * 300_000]},
        {"x": pa.nulls(300_000)},
    ],
)
def test_a_decompression_bomb_is_refused(tmp_path: Path, bomb: dict[str, Any]):
    pq.write_table(pa.table(bomb), tmp_path / "r.parquet")
    with pytest.raises(InvalidRecord, match="times its size"):
        read_parquet(tmp_path / "r.parquet")


@pytest.mark.usefixtures("little_memory")
def test_what_takes_as_much_memory_as_its_file_is_large_is_read(tmp_path: Path):
    times = np.random.default_rng(1).normal(size=200_000)
    pq.write_table(pa.table({"time": pa.array(times)}), tmp_path / "r.parquet")
    assert read_parquet(tmp_path / "r.parquet").num_rows == len(times)


@pytest.mark.parametrize(
    "columns",
    [
        {"time": ["0", "1"]},
        {"time": pa.nulls(2, pa.float64())},
        {"time": [0.0, math.inf]},
        {"time": [0.0, math.nan]},
        {"time": [[0.0], [1.0]]},
        {"time": [0, 1]},
        {"a.y": [0.0, 1.0]},
        {"time": [0.0, 1.0], "a.y": ["\x1b[31m", "x"]},
        {"time": [0.0, 1.0], "a.y": [None, True]},
        {"time": [0.0, 1.0], "a.y": [{"x": 1}, {"x": 2}]},
    ],
)
def test_what_is_no_record_is_refused_where_it_is_opened(tmp_path: Path, columns: dict[str, Any]):
    pq.write_table(pa.table(columns), tmp_path / "r.parquet")
    with pytest.raises(InvalidRecord):
        Record(tmp_path / "r.parquet")


@pytest.mark.parametrize("metadata", [{"unit": b"\xff"}, {"items": b"x WAIT"}])
def test_damaged_metadata_of_a_column_are_refused(tmp_path: Path, metadata: dict[str, bytes]):
    schema = pa.schema([pa.field("time", pa.float64()), pa.field("a.phase", pa.int64(), metadata=cast(Any, metadata))])
    pq.write_table(pa.table({"time": [0.0], "a.phase": [1]}, schema=schema), tmp_path / "r.parquet")
    with pytest.raises(InvalidRecord, match=r"a\.phase"):
        Record(tmp_path / "r.parquet")
