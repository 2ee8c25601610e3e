"""Real runs of `helix-1`: what its claims and figures are read from is what campaigns leave."""

import json
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from support.in_process_pool import InProcessPool
from support.kept_runs import kept_run
from support.scenarios.helix_1_rows import table_of
from support.scenarios.made_tables import one
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.scenarios.campaign.campaign import run_campaign
from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.local_cluster import local_cluster
from handover.scenarios.campaign.plan_check import prepared
from handover.scenarios.cli.campaign import CampaignProgress
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.published_experiment import Claim, PaperResults, Verdict, draw_figures, write_claims

FAST = {"alpha": "0.4", "control_period": "1.45", "place": "front", "tuning": "thesis"}


@pytest.mark.slow
def test_an_arm_that_has_no_time_to_move_is_reported_as_such(tmp_path: Path):
    plan, place = Helix1().plan(quick=True), CampaignFolder(tmp_path / "campaign")
    few = replace(plan, points=[p for p in plan.points if p == FAST], fixed={**plan.fixed, "patience": "1"})
    table = run_campaign(prepared(few), place, InProcessPool(), CampaignProgress(StringIO()))
    results = PaperResults.of(Helix1(), table, place.runs)
    write_claims(results.claims, place)
    draw_figures(Helix1(), table, place.runs, place.figures)
    assert len(results.tables) == 4
    claims = [Claim.from_data(c) for c in json.loads((place.path / "claims.json").read_text("utf-8"))]
    closes = one(claims, "begins to close")
    assert (closes.measured, closes.verdict) == ("0 of 1", Verdict.NOT_REPRODUCED)
    assert not list(place.figures.iterdir())


@pytest.mark.slow
def test_the_record_of_a_handover_is_judged_and_drawn(tmp_path: Path, sketches: Sketches):
    run = kept_run("run", "helix_handover", "--seed", "3")
    (tmp_path / "thesis_0.4_0").symlink_to(run, target_is_directory=True)
    table = table_of({0.4: [20.0]})
    Helix1().draw(table, tmp_path, tmp_path)
    assert set(sketches) == {"times", "errors", "single_errors", "model", "estimate"}
    claims = PaperResults.of(Helix1(), table, tmp_path).claims
    assert one(claims, "Every handover succeeds").measured == "1 of 1"
    assert "/1 " in one(claims, "The error rises at the change from the first goal to the second").measured


@pytest.mark.paper
def test_table_1_at_full_size(tmp_path: Path):
    folder = CampaignFolder(tmp_path / "campaign")
    ready = prepared(Helix1().plan(quick=False))
    with local_cluster(None) as pool:
        table = run_campaign(ready, folder, pool, CampaignProgress(StringIO()))
    assert set(table.column("status")) == {"done"}
    for part in ("begins to close in every run", "The arm's time falls", "With our settings every handover succeeds"):
        assert one(Helix1().claims(table), part).verdict is Verdict.REPRODUCED
