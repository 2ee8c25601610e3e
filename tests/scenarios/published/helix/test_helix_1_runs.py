"""Real runs of `helix-1`: what its claims and figures are read from is what campaigns leave."""

import json
from collections.abc import Mapping
from dataclasses import replace
from io import StringIO
from pathlib import Path

import pytest
from support.in_process_pool import InProcessPool
from support.kept_runs import kept_run
from support.scenarios.helix_1_rows import table_of

from handover.scenarios.campaign.campaign import run_campaign
from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.local_cluster import local_cluster
from handover.scenarios.campaign.plan_check import prepared
from handover.scenarios.cli.campaign import CampaignProgress
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.published_experiment import PaperResults, Verdict, draw_figures, write_claims

FAST = {"alpha": "0.4", "control_period": "1.45", "place": "front", "tuning": "thesis"}


def one_run(folder: Path, **fixed: str) -> Mapping[str, object]:
    """Carry out one run of the plan and return the claims that are left, by their texts."""
    plan = Helix1().plan(quick=True)
    (point,) = [p for p in plan.points if p == FAST]
    ready = prepared(replace(plan, points=[point], fixed={**plan.fixed, **fixed}))
    place = CampaignFolder(folder)
    table = run_campaign(ready, place, InProcessPool(), CampaignProgress(StringIO()))
    results = PaperResults.of(Helix1(), table, place.runs)
    write_claims(results.claims, place)
    draw_figures(Helix1(), table, place.runs, place.figures)
    assert len(results.tables) == 4
    return {claim["claim"]: claim for claim in json.loads((folder / "claims.json").read_text("utf-8"))}


@pytest.mark.slow
def test_an_arm_that_has_no_time_to_move_is_reported_as_such(tmp_path: Path):
    claims = one_run(tmp_path / "campaign", patience="1")
    closes = next(claim for text, claim in claims.items() if "begins to close" in text)
    assert isinstance(closes, dict)
    assert (closes["measured"], closes["verdict"]) == ("0 of 1", "not reproduced")
    assert not list((tmp_path / "campaign" / "figures").iterdir())


@pytest.mark.slow
def test_the_record_of_a_handover_is_judged_and_drawn(tmp_path: Path):
    runs, figures = tmp_path / "runs", tmp_path / "figures"
    runs.mkdir()
    figures.mkdir()
    (runs / "thesis_0.4_0").symlink_to(kept_run("run", "helix_handover", "--seed", "3"), target_is_directory=True)
    table = table_of({0.4: [20.0]})
    names = {figure.name for figure in Helix1().draw(table, runs, figures)}
    assert names == {"times", "errors", "single_errors", "model", "estimate"}
    claims = {claim.claim: claim for claim in PaperResults.of(Helix1(), table, runs).claims}
    assert claims["Every handover succeeds"].measured == "1 of 1"
    assert "/1 " in claims["The error rises at the change from the first goal to the second"].measured


@pytest.mark.paper
def test_table_1_at_full_size(tmp_path: Path):
    experiment, folder = Helix1(), CampaignFolder(tmp_path / "campaign")
    ready = prepared(experiment.plan(quick=False))
    with local_cluster(None) as pool:
        table = run_campaign(ready, folder, pool, CampaignProgress(StringIO()))
    assert set(table.column("status")) == {"done"}
    verdicts = {claim.claim: claim.verdict for claim in experiment.claims(table)}
    assert verdicts["The arm reaches the ball and the gripper begins to close in every run"] is Verdict.REPRODUCED
    assert verdicts["The arm's time falls with the step size"] is Verdict.REPRODUCED
    assert verdicts["With our settings every handover succeeds"] is Verdict.REPRODUCED
