from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.scenarios.helix_1_rows import spread, table_of

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_1 import Helix1

TIMES = {0.1: spread(100.0, 50.0), 0.2: spread(40.0, 10.0), 0.4: [20.0, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0, None]}


def test_table_1_has_the_papers_rows_with_ours_beside():
    table = Helix1().tables(table_of(TIMES))[0]
    rows = {row[0]: row[1:] for row in table.rows}
    assert table.header[5:] == ["0.4 published", "0.4 ours"]
    assert rows["Minimum"][4:] == ["14.6", "20.0"]
    assert rows["Median"][4:] == ["22.3", "23.0 (21.0 to 25.0)"]
    assert rows["Maximum"][4:] == ["29.5", "26.0"]
    assert rows["Mean"][:2] == ["104.8 ± 52.0", "100.0 ± 50.0"]
    assert rows["Timestep"][4:] == ["1.45 ± 0.05", "1.45"]
    assert rows["Gripper began to close"][4:] == ["8 of 8", "7 of 8"]


def test_steps_are_beside_the_published_times_over_their_time_steps():
    table = Helix1().tables(table_of(TIMES))[1]
    assert [row[:3] for row in table.rows] == [["0.1", "71", "31–156"], ["0.2", "26", "19–38"], ["0.4", "15", "10–20"]]
    assert table.rows[2][4] == "15–19"


def test_a_place_shows_its_runs_and_which_lost_the_ball():
    rows = {row[0]: row[1:] for row in Helix1().tables(table_of(TIMES))[2].rows}
    assert rows["front"][2] == "20.0, 21.0"
    assert rows["back-left"][2] == "26.0, never ✗"


def test_lengths_of_figure_9_are_beside_the_published_ones():
    table = Helix1().tables(table_of(TIMES, model_mismatch=0.1, arm_travel=0.2, model_travel=0.25))[3]
    assert table.rows[0] == ["model to arm", "0.14", "0.100", "0.100", "0.100"]


def test_settings_without_runs_have_no_tables():
    assert len(Helix1().tables(table_of(TIMES))) == 4
    both = pa.concat_tables([table_of(TIMES).table, table_of(TIMES, "own").table])
    assert len(Helix1().tables(CampaignTable(both))) == 8


@pytest.mark.slow
def test_times_are_drawn_and_errors_of_runs_that_left_a_record(tmp_path: Path):
    figures, run = tmp_path / "figures", tmp_path / "runs" / "thesis_0.4_0"
    figures.mkdir()
    assert [f.name for f in Helix1().draw(table_of(TIMES), tmp_path / "runs", figures)] == ["times"]
    run.mkdir(parents=True)
    t = np.arange(0.0, 25.0, 0.02)
    record = {"time": t, "servo.phase": np.where(t < 1.45, 0, 1), "servo.error": 0.3 * np.exp(-t / 10.0)}
    pq.write_table(pa.Table.from_pydict(record), run / "signals.parquet")
    names = ["times", "errors", "single_errors"]
    assert [f.name for f in Helix1().draw(table_of(TIMES), tmp_path / "runs", figures)] == names
    assert {f.name for f in figures.iterdir()} == {f"{n}.{s}" for n in names for s in ("png", "svg")}


def test_nothing_is_drawn_where_no_gripper_closed(tmp_path: Path):
    assert not Helix1().draw(table_of({alpha: [None] * 8 for alpha in TIMES}), tmp_path, tmp_path)
