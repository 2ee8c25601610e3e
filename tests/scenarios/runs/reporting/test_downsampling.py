"""Few rows that look like all: extremes, gaps and every change of what is held are among them."""

import base64
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from handover.cosim.record.reader import Record
from handover.scenarios.runs.reporting.time_plots import explorer_section, rows_of_curve, rows_of_steps

T = np.linspace(0.0, 10.0, 100_000)


def test_the_rows_of_a_curve_keep_its_peaks_and_gaps_and_lines_between_them_look_like_it():
    values = np.sin(T) + 0.3 * np.sin(7 * T)
    rows = rows_of_curve(values, 900)
    assert np.allclose(np.interp(T, T[rows], values[rows]), values, atol=2e-3)
    values[[11_234, 80_001]] = 7.0, -9.0
    values[20_000:50_000] = np.nan
    rows = rows_of_curve(values, 900)
    assert len(rows) <= 901  # with the beginning of the gap
    assert {0, 11_234, 80_001, len(T) - 1} <= set(rows.tolist())
    assert rows[(rows >= 20_000) & (rows < 50_000)].tolist() == [20_000]
    assert rows_of_curve(T[:5], 900).tolist() == [0, 1, 2, 3, 4]


def test_every_change_of_a_held_value_is_kept():
    values = np.floor(T * 3)
    rows = rows_of_steps(values, 900)
    held = rows[np.searchsorted(rows, np.arange(len(T)), side="right") - 1]
    assert np.array_equal(values[held], values)
    assert len(rows) <= 32
    values = np.full(1000, np.nan)
    values[200:700] = 0.06
    assert rows_of_steps(values, 100).tolist() == [0, 200, 699, 700, 999], "it is drawn until the gap after it"
    assert rows_of_steps(T[:0], 900).tolist() == []


def test_a_signal_of_any_record_is_drawn_until_it_is_no_number(tmp_path: Path):
    time, y = np.linspace(0.0, 1.0, 11), np.where(np.arange(11) < 6, 0.0, np.nan)
    rows = [{"time": t, "a.y": value} for t, value in zip(time.tolist(), y.tolist(), strict=True)]
    pq.write_table(pa.Table.from_pylist(rows), tmp_path / "signals.parquet")
    section = explorer_section(Record(tmp_path / "signals.parquet"))
    assert section is not None
    packed = section.html.partition('"t":"')[2].partition('"')[0].replace("\\u002f", "/")
    times = np.frombuffer(base64.b64decode(packed), dtype="<f4")
    assert times.tolist() == pytest.approx([0.0, 0.5, 0.6, 1.0])
