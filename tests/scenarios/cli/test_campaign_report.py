"""`handover report` on a campaign: the page alone, also beside a folder that may not be written to, or figures too."""

import os
from pathlib import Path

import pytest
from campaigns import campaign_metadata, folder_of, table_of
from click.testing import CliRunner

from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.cli.command import main

POINTS = [{"strategy": "reflex"}, {"strategy": "blind"}]


@pytest.fixture
def campaign(tmp_path: Path) -> CampaignFolder:
    return folder_of(tmp_path / "c", campaign_metadata("ir_grasp", POINTS), table_of(POINTS))


def report(*arguments: object) -> tuple[int, str]:
    done = CliRunner().invoke(main, ["report", *map(str, arguments)])
    return done.exit_code, done.output


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
