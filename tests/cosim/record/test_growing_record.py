"""A record that grows is read by another process row by row, with units and items, and never a torn row."""

import threading
from pathlib import Path

import numpy as np
import pytest
from signals_of import signals_of

from handover.cosim.record.growing_record import GrowingRecord, NoRows
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder


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
        for i in range(2, 40_000):
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
