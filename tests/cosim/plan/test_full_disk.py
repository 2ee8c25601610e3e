"""A plan does not write behind the end of a record's block that could not be written."""

from fractions import Fraction
from pathlib import Path

import pytest
from native_units import native_fmu

from handover.cosim.exceptions import RecordNotWritten
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder
from handover.cosim.record.stream import RecordStream
from handover.cosim.system.system import System


def test_a_run_goes_on_where_the_disk_was_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    s = System()
    s.add("ramp", native_fmu("ramp"), period=Fraction(1, 1000))
    file = tmp_path / "r.parquet"
    with Master(s) as master, Recorder(file) as recorder:
        with monkeypatch.context() as patch:
            patch.setattr(RecordStream, "write", full)
            for _ in range(3):
                with pytest.raises(RecordNotWritten, match="No space left"):
                    master.run(Fraction(10), [recorder])
                assert recorder.rows == recorder.block.capacity
        master.run(Fraction(10), [recorder])
    assert Record(file).time[-1] == 10.0
