"""The summary that is printed at the end of a campaign: at most a screen."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from handover.scenarios.cli.summaries.campaign import campaign_data, print_campaign, print_report_place
from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan, PlannedRun
from handover.scenarios.runs.campaign.results import CampaignResults
from handover.scenarios.runs.campaign.table import CampaignTable, RunRow
from handover.scenarios.runs.campaign.table_writer import table_of
from handover.scenarios.runs.campaign.worker_pool import RunCounts


def printed(plan: CampaignPlan, rows: list[RunRow], capsys: pytest.CaptureFixture[str]) -> tuple[str, list[Any]]:
    """Return what is printed of a campaign, and its points as data."""
    output = {"scenario": plan.scenario, "points": plan.points, "repetitions": plan.repetitions}
    results = CampaignResults(output, CampaignTable(table_of(plan, rows)))
    of_campaign = (results, RunCounts(total=plan.size, ended=len(rows)), CampaignFolder(Path("c")))
    print_campaign(*of_campaign)
    return capsys.readouterr().out, campaign_data(*of_campaign)["points"]


def done(run: PlannedRun, *, success: bool = True, metrics: Mapping[str, Metric] = {}) -> RunRow:
    return RunRow(run=run, status="done", success=success, reason="closed", metrics=metrics)


def test_each_point_has_its_rate_with_an_interval_and_its_medians(capsys: pytest.CaptureFixture[str]):
    plan = CampaignPlan(scenario="ir_grasp", points=[{"forward": "0.03"}], repetitions=10)
    metrics = [{"final_distance_thumb": Metric(0.001 * k, "m")} for k in range(10)]
    rows = [done(run, success=run.repetition < 9, metrics=metrics[run.repetition]) for run in plan.runs()]
    output, (point,) = printed(plan, rows, capsys)
    (row,) = [line.split() for line in output.splitlines() if " of 10 " in line and "runs" not in line]
    # Clopper and Pearson of 9 of 10, as in tables: 0.555 to 0.997
    assert " ".join(row) == "0.03 10 9 of 10 55 % to 100 % 4.5 mm"
    assert "more reason" not in output
    assert point["interval"] == pytest.approx([0.555, 0.997], abs=1e-3)
    assert point["medians"]["final_distance_thumb"] == {"value": pytest.approx(0.0045), "unit": "m"}


def test_of_many_points_and_reasons_the_first_are_reported(capsys: pytest.CaptureFixture[str]):
    plan = CampaignPlan(scenario="ir_grasp", points=[{"forward": f"0.{n}"} for n in range(100, 200)])
    broke = "the hand broke {} times"
    rows = [RunRow(run=run, status="failed", success=None, reason=broke.format(run.point % 10)) for run in plan.runs()]
    output, _ = printed(plan, rows, capsys)
    assert "and 88 points more" in output
    assert "10 failed: the hand broke 3 times" in output
    assert "and 5 more reasons, in the table" in output
    assert len(output.splitlines()) <= 24


def test_a_page_that_is_older_than_the_table_is_not_reported(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    folder = CampaignFolder(tmp_path)
    for file in (folder.table, folder.report):
        file.touch()
    for age, output in ((-1, True), (1, False)):
        os.utime(folder.table, (0, folder.report.stat().st_mtime + age))
        print_report_place(folder)
        assert ("report: " in capsys.readouterr().out) == output
