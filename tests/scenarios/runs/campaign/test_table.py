"""The table of a campaign: what its columns hold, and how they are read."""

import json
import math
from collections import defaultdict
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow.parquet as pq
import pytest

from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.runs.campaign.plan import CampaignPlan, PlannedRun
from handover.scenarios.runs.campaign.table import CampaignTable, RunRow, row_of
from handover.scenarios.runs.campaign.table_writer import TableWriter, table_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder

PLAN = CampaignPlan(
    scenario="vsl_hybrid",
    points=[{"load": "0.1", "path": "linear"}, {"load": "0.2", "path": "custom", "x_0": "0.3,0,0.05"}],
    fixed={"points": "10", "model": ""},
    repetitions=2,
)
MEAN = Metric(0.25, "m", "mean error")


def rows() -> list[RunRow]:
    first, second, third, _ = PLAN.runs()
    metrics = {"mean": MEAN, "load": Metric(1.0, "kg", "what it carried"), "none": Metric(math.nan)}
    spent = {"simulated": 5.0, "wall": 1.0, "cpu": 0.5}
    return [
        RunRow(run=first, status="done", success=True, reason="there", metrics=metrics, **spent),
        RunRow(run=second, status="lost", success=None, reason="its machine burnt"),
        RunRow(run=third, status="failed", success=None, reason="the arm broke", metrics={"late": MEAN}, **spent),
    ]


@pytest.fixture
def table() -> CampaignTable:
    return CampaignTable(table_of(PLAN, rows()))


def test_columns_are_typed_and_reported(table: CampaignTable):
    schema: Any = table.table.schema
    kinds: dict[str, list[str]] = defaultdict(list)
    for name in table.table.column_names:
        kinds[str(schema.field(name).type)].append(name)
    spent = ["simulated_seconds", "wall_seconds", "cpu_seconds"]
    assert kinds == {
        "string": ["run", "status", "reason", "path", "model"],
        "int64": ["point", "repetition", "seed", "points"],
        "bool": ["success"],
        "double": ["load", *spent, "mean", "load_metric", "none", "late"],
        "list<item: double>": ["x_0"],
    }
    assert table.parameters == ("load", "path", "x_0", "points", "model")
    assert table.metrics == ("mean", "load_metric", "none", "late")
    assert [table.unit(name) for name in ("load", "path", "mean", "none", "cpu_seconds")] == ["kg", "1", "m", "1", "s"]
    assert table.description("mean") == "mean error"

    np.testing.assert_array_equal(table.column("mean"), [0.25, math.nan, math.nan])
    np.testing.assert_array_equal(table.column("none"), [math.nan] * 3)
    assert table.column("success").tolist() == [True, None, None]
    assert table.column("points").dtype == np.int64
    assert table.column("x_0").tolist() == [[0.3, 0, 0.05]] * 3  # a point that does not set it has its start
    with pytest.raises(KeyError, match="no column 'meen': did you mean mean"):
        table.column("meen")

    empty = CampaignTable(table_of(PLAN, []))
    assert (empty.rows, empty.metrics, empty.column("load").tolist()) == ([], (), [])


def test_rows_come_in_any_order_and_are_in_the_plans(tmp_path: Path, table: CampaignTable):
    writer = TableWriter(PLAN, tmp_path / "runs.parquet")
    for row in reversed(rows()):
        writer.add(row)
    writer.write()
    assert CampaignTable.read(tmp_path).column("run").tolist() == table.column("run").tolist()
    assert CampaignTable.read(tmp_path).metrics == table.metrics


def test_it_is_written_seldom_while_runs_come_fast(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    now = [100.0]
    written: list[float] = []
    write_table = cast(Any, pq).write_table

    def take_a_second(*given: Any) -> None:
        write_table(*given)
        written.append(now[0])
        now[0] += 0.05

    monkeypatch.setattr("handover.scenarios.runs.campaign.table_writer.time.monotonic", lambda: now[0])
    monkeypatch.setattr("handover.scenarios.runs.campaign.table_writer.pq.write_table", take_a_second)
    writer = TableWriter(PLAN, tmp_path / "runs.parquet")
    for _ in range(1000):
        now[0] += 0.1
        writer.add(rows()[0])
    assert 9 <= len(written) <= 10  # 0.05 s each in 100 s


def test_a_table_that_is_none_or_torn_is_reported(tmp_path: Path, table: CampaignTable):
    with pytest.raises(InvalidRunFolder, match=r"it has no runs\.parquet"):
        CampaignTable.read(tmp_path)
    pq.write_table(table.table, tmp_path / "runs.parquet")
    (tmp_path / "runs.parquet").write_bytes((tmp_path / "runs.parquet").read_bytes()[:900])
    with pytest.raises(InvalidRunFolder, match=r"its runs\.parquet is damaged"):
        CampaignTable.read(tmp_path)


def test_a_metric_is_described_as_by_a_run_that_has_a_value():
    first, second, third, _ = PLAN.runs()
    lacks, has = Metric(math.nan, "m", "distance (sees nothing)"), Metric(0.1, "m", "distance")
    ended = [
        RunRow(run=run, status="done", success=True, reason="there", metrics={"distance": metric})
        for run, metric in ((first, lacks), (second, has), (third, lacks))
    ]
    table = CampaignTable(table_of(PLAN, ended))
    assert table.description("distance") == "distance"


def test_a_run_of_a_scenario_that_draws_no_random_numbers_has_its_row(tmp_path: Path):
    run = PlannedRun(name="r", point=0, repetition=0, parameters={}, seed=7)
    summary: dict[str, Any] = {"failure": None, "complete": True, "success": True, "reason": "there", "metrics": {}}
    summary |= dict.fromkeys(("simulated_seconds", "wall_seconds", "cpu_seconds"), 1.0)
    (tmp_path / "summary.json").write_text(json.dumps(summary | {"seed": None}))
    row = row_of(run, tmp_path)
    assert row is not None
    assert (row.status, row.success) == ("done", True)
    (tmp_path / "summary.json").write_text(json.dumps(summary | {"seed": 8}))
    assert row_of(run, tmp_path) is None
