"""Tables and claims of a small campaign of real grasps."""

from dataclasses import replace
from pathlib import Path

import pytest
from support.in_process_pool import InProcessPool

from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.campaign.campaign import run_campaign
from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.plan_check import prepared
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.ir_grasp.ir_table import IrTable
from handover.scenarios.published.ir_grasp.ir_table_runs import ARMS, BLIND, FORWARD_55, REFLEX, IrTableRuns
from handover.scenarios.published.published_experiment import draw_figures, write_claims

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> tuple[CampaignFolder, CampaignTable]:
    """A moved cylinder, grasped once in each way."""
    plan = IrTable().plan(quick=True)
    points = [p for p in plan.points if p["thing"] == "cylinder" and p["perturbed"] == "true"]
    folder = CampaignFolder(tmp_path_factory.mktemp("campaigns") / "c")
    few = prepared(replace(plan, points=points, repetitions=1))
    return folder, run_campaign(few, folder, InProcessPool(), lambda _tally: None)


def test_cells_are_the_runs_of_their_arm(campaign: tuple[CampaignFolder, CampaignTable]):
    runs = IrTableRuns(campaign[1])
    assert [runs.count(arm, True, Thing.CYLINDER)[1] for arm in ARMS] == [1, 1, 1, 1]
    assert runs.count(REFLEX, False) == (0, 0)
    assert runs.count(BLIND, True) == (0, 1)
    assert runs.pairs((REFLEX, True), (FORWARD_55, True)) == ([True], [True])


def test_distances_are_those_at_which_the_hand_closed(campaign: tuple[CampaignFolder, CampaignTable]):
    (thumb,) = IrTableRuns(campaign[1]).metric("final_distance_thumb", REFLEX, True, (Thing.CYLINDER,))
    assert thumb == pytest.approx(0.010, abs=0.004)  # the target, and what the threshold of the cost allows


def test_a_table_says_why_the_hand_closed(campaign: tuple[CampaignFolder, CampaignTable]):
    closing = IrTable().tables(campaign[1])[3]
    why = {row[0]: row[1] for row in closing.rows}
    assert why["blind, perturbed"] == "1 blind"
    assert why["forward 35 mm, perturbed"] == "1 forward"
    assert why["IR-guided, perturbed"] == "1 threshold"


def test_results_are_left_in_the_campaigns_folder(campaign: tuple[CampaignFolder, CampaignTable]):
    folder, table = campaign
    write_claims(IrTable().claims(table), folder)
    draw_figures(IrTable(), table, folder.runs, folder.figures)
    left = {p.relative_to(folder.path) for p in folder.path.rglob("*") if "runs" not in p.parts}
    assert {Path("claims.json"), Path("figures/success_rates.svg"), Path("figures/final_distances.png")} <= left
    assert folder.read()["experiment"] == "ir-table"
