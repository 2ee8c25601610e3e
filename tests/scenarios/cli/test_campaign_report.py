"""`handover report` on a campaign: the page alone, also beside a folder that may not be written to, or figures too."""

import os
from pathlib import Path
from urllib.parse import quote

import pytest
from click.testing import CliRunner
from support.campaigns import campaign_metadata, carried_out, folder_of, table_of

from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.cli.command import main

POINTS = [{"strategy": "reflex"}, {"strategy": "blind"}]


@pytest.fixture
def campaign(tmp_path: Path) -> CampaignFolder:
    return folder_of(tmp_path / "c", campaign_metadata("ir_grasp", POINTS), table_of(POINTS))


def report(*arguments: object) -> tuple[int, str]:
    """Return status and output, without what the command says it is doing."""
    done = CliRunner().invoke(main, ["report", *map(str, arguments)])
    return done.exit_code, "".join(
        t for t in done.output.splitlines(keepends=True) if not t.startswith(("drawing ", "writing "))
    )


def test_a_page_that_goes_elsewhere_leaves_the_campaigns_folder_as_it_is(campaign: CampaignFolder, tmp_path: Path):
    before = sorted(os.listdir(campaign.path))
    page = tmp_path / "page.html"
    assert report(campaign.path, "--out", page) == (0, f"report: {page}\n")
    assert sorted(os.listdir(campaign.path)) == before


def test_figures_are_drawn_if_they_are_asked_for(campaign: CampaignFolder):
    assert report(campaign.path)[0] == 0
    assert not campaign.figures.exists()
    assert report(campaign.path, "--figures")[0] == 0
    assert {p.name for p in campaign.figures.iterdir()} == {"success_by_point.png", "success_by_point.svg"}


def test_pages_of_the_runs_are_written_and_linked_if_they_are_asked_for(tmp_path: Path):
    plan = CampaignPlan(scenario="ir_grasp", points=[{"strategy": "blind"}], repetitions=2)
    lost = "000_strategy=blind_r0001"
    campaign = carried_out(plan, tmp_path / "c", lost=[lost])
    assert report(campaign.path)[0] == 0
    assert "handover report c --runs" in campaign.report.read_text(encoding="utf-8")
    assert report(campaign.path, "--runs") == (0, f"report: {campaign.report}\n")
    run = campaign.runs / "000_strategy=blind_r0000"
    assert "ir_grasp: " in (run / "report.html").read_text(encoding="utf-8")
    page = campaign.report.read_text(encoding="utf-8")
    assert f"<a href='runs/{quote(run.name)}/report.html'>" in page
    assert quote(lost) not in page
    status, told = report(run, "--runs")
    assert (status, told.count("\n")) == (2, 1)
    assert "--runs is for that of a campaign" in told
