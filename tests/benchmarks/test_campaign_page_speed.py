"""What the page of a campaign of many points costs, beside that of a tenth of them.

`pytest tests/benchmarks/test_campaign_page_speed.py --benchmark-enable -s` prints it.
"""

import json
import time
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from pytest_benchmark.fixture import BenchmarkFixture

from handover.scenarios.experiment.experiment import Metric
from handover.scenarios.pages.campaign_report.campaign_page import write_campaign_page
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import RunRow
from handover.scenarios.runs.campaign.table_writer import table_of

STRATEGIES = ("reflex", "blind", "forward")
FEW, MANY = 300, 3000
"""Points."""


def campaign(path: Path, points: int) -> CampaignFolder:
    """Return a paired campaign of two varied parameters, a run a point."""
    entries = [{"forward": f"{0.0001 * (k // 3):.4f}", "strategy": STRATEGIES[k % 3]} for k in range(points)]
    plan = CampaignPlan(scenario="ir_grasp", points=entries, paired=True)
    rows = [
        RunRow(
            run=run,
            status="done",
            success=run.point % 3 == 0,
            reason="closed",
            metrics={"displacement": Metric(1e-3 * run.point, "m")},
        )
        for run in plan.runs()
    ]
    path.mkdir()
    data: dict[str, Any] = {"scenario": plan.scenario, "points": entries, "fixed": {}, "repetitions": 1, "seed": 0}
    (path / "campaign.json").write_text(json.dumps({**data, "paired": True}), encoding="utf-8")
    pq.write_table(table_of(plan, rows), path / "runs.parquet")
    return CampaignFolder(path)


def test_the_page_of_many_points(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    """Ten times the points cost about ten times as much, and what every page costs is in both."""
    folders = {n: campaign(tmp_path / str(n), n) for n in (FEW, MANY)}
    write_campaign_page(folders[FEW])  # what it loads is not measured
    costs: dict[str, float] = {}

    def measure() -> None:
        for n, folder in folders.items():
            began = time.process_time()
            write_campaign_page(folder)
            costs[str(n)] = time.process_time() - began

    benchmark.pedantic(measure)
    print(f"\ns of CPU: {', '.join(f'{seconds:.2f} for {n} points' for n, seconds in costs.items())}")
    benchmark.extra_info.update(costs)
    assert costs[str(MANY)] <= 15 * costs[str(FEW)]
