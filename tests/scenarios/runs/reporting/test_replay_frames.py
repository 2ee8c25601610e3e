"""A replay shows moments that lie evenly in time, and names the phases between them."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from handover.cosim.record.reader import Record
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.ir_grasp.parameters import Parameters
from handover.scenarios.runs.reporting.replay_section import MAX_FRAMES, frame_rows, phase_changes


def test_moments_lie_evenly_in_time_where_rows_do_not():
    time = np.concatenate([np.linspace(0.0, 1.0, 5000), np.linspace(1.001, 100.0, 5000)])
    rows = frame_rows(time)
    assert len(rows) <= MAX_FRAMES
    assert (rows[0], rows[-1]) == (0, len(time) - 1)
    assert np.diff(time[rows]).max() == pytest.approx(100.0 / (MAX_FRAMES - 1), rel=0.1)


def test_a_short_record_is_shown_whole():
    for n in (1, 2, 3, 100):
        np.testing.assert_array_equal(frame_rows(np.linspace(0.0, 0.5, n)), np.arange(n))


def test_phases_are_reported_when_they_begin(tmp_path: Path):
    phase = pa.field("servo.phase", pa.int64(), metadata={"items": "0 WAIT, 1 GIVEN_UP"})
    columns = [pa.array([0.0, 1.0, 2.0, 3.0]), pa.array([0, 0, 1, 1])]
    schema = pa.schema([pa.field("time", pa.float64()), phase])
    pq.write_table(pa.Table.from_arrays(columns, schema=schema), tmp_path / "s")
    record = Record(tmp_path / "s")
    assert phase_changes(record, "servo.phase") == [(0.0, "wait"), (2.0, "given up")]
    assert phase_changes(record, "") == []


def test_a_replay_takes_the_phases_of_the_plots(grasp: Path):
    record = Record(grasp / "signals.parquet")
    replay = IrGrasp().replay(Parameters(), record)
    names = {name for _, name in phase_changes(record, replay.phases)}
    plotted = {p.name for plot in IrGrasp().plots(Parameters(), record) for p in plot.phases}
    assert names == plotted
    assert {"check", "probe", "close", "done"} <= names
