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
