from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.scenarios.helix_1_rows import spread, table_of
from support.scenarios.made_tables import made_table, text_of
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.scenarios.published.helix.helix_1 import Helix1

TIMES = {0.1: spread(100.0, 50.0), 0.2: spread(40.0, 10.0), 0.4: [20.0, 21.0, 22.0, 23.0, 24.0, 25.0, 26.0, None]}


def test_tables_have_the_papers_rows_with_ours_beside(wording: Wording):
    tables = Helix1().tables(table_of(TIMES, model_mismatch=0.1, arm_travel=0.2, model_travel=0.25))
    wording.check(text_of(tables))
    rows = {row[0]: row[1:] for row in tables[0].rows}
    assert rows["Mean"][:2] == ["104.8 ± 52.0", "100.0 ± 50.0"]
    assert rows["Gripper began to close"][4:] == ["8 of 8", "7 of 8"]


def test_settings_without_runs_have_no_tables():
    assert len(Helix1().tables(table_of(TIMES))) == 4
    assert len(Helix1().tables(made_table([*table_of(TIMES).rows, *table_of(TIMES, "own").rows]))) == 8


@pytest.mark.slow
def test_times_are_drawn_and_errors_of_runs_that_left_a_record(tmp_path: Path, sketches: Sketches):
    run = tmp_path / "runs" / "thesis_0.4_0"
    assert not Helix1().draw(table_of({alpha: [None] * 8 for alpha in TIMES}), tmp_path, tmp_path)
    assert [f.name for f in Helix1().draw(table_of(TIMES), tmp_path / "runs", tmp_path)] == ["times"]
    run.mkdir(parents=True)
    t = np.arange(0.0, 25.0, 0.02)
    record = {"time": t, "servo.phase": np.where(t < 1.45, 0, 1), "servo.error": 0.3 * np.exp(-t / 10.0)}
    pq.write_table(pa.Table.from_pydict(record), run / "signals.parquet")
    sketches.clear()
    Helix1().draw(table_of(TIMES), tmp_path / "runs", tmp_path)
    assert list(sketches) == ["times", "errors", "single_errors"]
