"""Campaigns without processes of their own: real ones, and made-up tables for tests of pages."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from handover.scenarios.runs.campaign.campaign import run_campaign
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.plan_check import prepared
from handover.scenarios.runs.campaign.results import CampaignResults
from handover.scenarios.runs.campaign.table import CampaignTable
from support.cosim.native_units import native_fmu
from support.in_process_pool import InProcessPool


def short_plan(**given: Any) -> CampaignPlan:
    """Return the plan of runs that take hundredths of a second: a mass of 1 kg, and one of 2 kg, is pushed for 1 s."""
    whole: dict[str, Any] = {"points": [{"m": "1"}, {"m": "2"}], "fixed": {"f": "1"}, **given}
    return CampaignPlan(scenario=str(native_fmu("mass")), **whole)


def carried_out(plan: CampaignPlan, path: Path, lost: Sequence[str] = ()) -> CampaignFolder:
    """Run a campaign and return its folder."""
    folder = CampaignFolder(path)
    pool = InProcessPool(lambda job: "its worker went away" if job.name in lost else "")
    run_campaign(prepared(plan), folder, pool, lambda _tally: None)
    return folder


def campaign_metadata(
    scenario: str, points: Sequence[Mapping[str, str]], repetitions: int = 2, **more: Any
) -> dict[str, Any]:
    """Return the content of a campaign's campaign.json."""
    plan: dict[str, Any] = {
        "scenario": scenario,
        "points": list(points),
        "fixed": {},
        "repetitions": repetitions,
        "seed": 0,
    }
    return {**plan, "paired": False, **more}


def table_of(points: Sequence[Mapping[str, Any]], repetitions: int = 2, **more: Sequence[Any]) -> CampaignTable:
    """Return runs that took 1 s; every second repetition failed. `more`: other seeds or successes, and metrics, m."""
    runs = [(k, r) for k in range(len(points)) for r in range(repetitions)]
    columns: dict[str, Sequence[Any]] = {
        "run": [f"{k:03d}_r{r:04d}" for k, r in runs],
        "point": [k for k, _ in runs],
        "repetition": [r for _, r in runs],
        "seed": [100 + r for _, r in runs],
        "status": ["done"] * len(runs),
        "success": [r % 2 == 0 for _, r in runs],
        "reason": ["held" if r % 2 == 0 else f"slipped at {k}.{r} s" for k, r in runs],
        **{name: [points[k].get(name) for k, _ in runs] for name in dict.fromkeys(n for p in points for n in p)},
        **{name: [1.0] * len(runs) for name in ("simulated_seconds", "wall_seconds", "cpu_seconds")},
        **more,
    }
    table: Any = pa.Table.from_pydict({name: list(values) for name, values in columns.items()})
    metrics = more.keys() - {"seed", "success"}
    roles = {n: "parameter" for p in points for n in p} | dict.fromkeys(metrics, "metric")
    fields: list[Any] = [
        pa.field(f.name, f.type, metadata={"role": roles.get(f.name, "run"), "unit": "m" if f.name in metrics else "1"})
        for f in table.schema
    ]
    return CampaignTable(table.cast(pa.schema(fields)))


def results_of(
    scenario: str, points: Sequence[Mapping[str, str]], repetitions: int = 2, **more: Sequence[Any]
) -> CampaignResults:
    """Return what came out at points; columns of parameters are texts."""
    return CampaignResults(campaign_metadata(scenario, points, repetitions), table_of(points, repetitions, **more))


def folder_of(path: Path, plan: Mapping[str, Any], table: CampaignTable) -> CampaignFolder:
    """Write a campaign's file and table into a folder."""
    path.mkdir(parents=True, exist_ok=True)
    (path / "campaign.json").write_text(json.dumps(plan), encoding="utf-8")
    pq.write_table(table.table, path / "runs.parquet")
    return CampaignFolder(path)
