from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from handover.cosim.record.reader import Record


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
    pq.write_table(pa.table({name: [float(k)] for k, name in enumerate(names)}), tmp_path / "r.parquet")
    record = Record(tmp_path / "r.parquet")
    assert record.signals == ("a.p", "a.q[0]", "a.q[1]", "a.r[2]", "a.s", "a.t[9999999999]")
    assert record["a.p"].tolist() == [[1.0, 2.0]]
    assert record["a.s"].tolist() == [[[6.0, 7.0]]]
    assert [record[name].tolist() for name in ("a.q[0]", "a.r[2]")] == [[3.0], [5.0]]
