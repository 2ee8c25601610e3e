"""What a page keeps and plots of the rows of a run under way."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from handover.cosim.record.growing_record import GrowingRecord
from handover.cosim.record.recorder import Recorder
from handover.scenarios.live.live_scene import LiveScene, Row, ThinnedRows
from tests.support.cosim.signals_of import signals_of


@pytest.mark.parametrize("most", [99, 100])
@pytest.mark.parametrize("at_once", [1, 7, 500])
def test_rows_are_thinned_evenly_however_many_come_and_the_newest_is_kept(most: int, at_once: int):
    thinned, rows = ThinnedRows(most), [Row((float(k), [])) for k in range(5000)]
    for first in range(0, len(rows), at_once):
        come = rows[first : first + at_once]
        thinned.add(come)
        times = [t for t, _ in thinned.rows]
        steps = {b - a for a, b in pairwise(times[:-1])}
        assert times[0] == 0.0
        assert times[-1] == come[-1][0]
        assert len(steps) <= 1, "rows lie at equal distances, but for the newest"
        assert len(times) <= most + 1
        assert len(times) >= min(first + len(come), most // 2)


def test_the_signals_of_a_run_under_way_are_plotted_and_one_that_it_has_not_is_left_out(tmp_path: Path):
    file, x = tmp_path / "signals.parquet", np.array([1.0, 2.0])
    signals = signals_of({"x": x})
    with Recorder(file) as recorder:
        recorder.open(signals)
        recorder(0.0, signals)
        scene = LiveScene(None, None, GrowingRecord(file))
        assert scene.plots(["unit.x"]) == [], "one row makes no curve"
        for t in (0.5, 1.0):
            x += 1.0
            recorder(t, signals)
        assert scene.refresh()
        first, second, *_ = scene.plots(["unit.x", "unit.none", "unit.x[2]"])
        assert [c.values.tolist() for c in first.curves] == [[1.0, 2.0, 3.0], [2.0, 3.0, 4.0]]
        assert (second.title, second.curves[0].values.tolist()) == ("unit.x[2]", [2.0, 3.0, 4.0])
