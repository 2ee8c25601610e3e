"""A campaign's page in a browser: its metric can be chosen, its tables sorted and filtered, also on a phone."""

from pathlib import Path

import pytest
from playwright.sync_api import Browser
from support.campaigns import campaign_metadata, carried_out, folder_of, table_of
from support.opened_page import opened, overflow, wait_until

from handover.scenarios.pages.campaign_report.campaign_page import write_campaign_page
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan import CampaignPlan

PLAN = CampaignPlan(
    scenario="ir_grasp", points=[{"strategy": "reflex"}, {"strategy": "blind"}], repetitions=2, seed=1, paired=True
)
LOST = "001_strategy=blind_r0001"
BEYOND_THE_TEXT = """[...document.querySelectorAll(".scroll")].map(table => {
    const [inner, outer] = [table, document.querySelector("main")].map(e => e.getBoundingClientRect());
    return Math.max(outer.left - inner.left, inner.right - outer.right);
})"""
"""By how much tables are wider than the text, pixels."""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> CampaignFolder:
    folder = carried_out(PLAN, tmp_path_factory.mktemp("campaigns") / "grasps", lost=[LOST])
    write_campaign_page(folder)
    return folder


def test_a_metric_is_chosen_runs_are_sorted_and_filtered_and_all_fits_the_window(
    browser: Browser, campaign: CampaignFolder
):
    with opened(browser, campaign.report) as page:
        assert page.inner_text("h1") == "ir_grasp"
        assert page.locator(".plot").count() == page.locator(".plot:has(.main-svg)").count() == 2
        plot = "document.querySelector('.chooser .plot')"
        before = page.evaluate(f"JSON.stringify({plot}.data.map(t => t.y ?? t.median))")
        page.select_option(".chooser select", label="refinement time")
        wait_until(page, f"{plot}.layout.yaxis.title.text === 'refinement time (s)'")
        assert page.evaluate(f"JSON.stringify({plot}.data.map(t => t.y ?? t.median))") != before
        assert "until the hand closes" in page.inner_text(".chooser .description")

        rows = page.locator("#all-runs tbody tr")
        seeds = "[...document.querySelectorAll('#all-runs tbody tr')].map(r => Number(r.cells[2].textContent))"
        page.click("#all-runs th:nth-child(3) button")
        up = page.evaluate(seeds)
        page.click("#all-runs th:nth-child(3) button")
        assert page.evaluate(seeds) == up[::-1] == sorted(up, reverse=True)
        page.fill("input[data-filters]", "went away blind")
        assert page.locator("#all-runs tbody tr:visible").count() == 0
        page.fill("input[data-filters]", "LOST blind")
        assert page.locator("#all-runs tbody tr:visible").count() == 1
        assert rows.count() == 4
        assert page.inner_text("[data-counts]").startswith("1 of 4 runs")

        page.set_viewport_size({"width": 400, "height": 800})
        wait_until(page, "[...document.querySelectorAll('.plot svg.main-svg')].every(s => s.clientWidth < 400)")
        assert overflow(page) <= 0
        page.emulate_media(color_scheme="dark")
        assert overflow(page) <= 0
        page.set_viewport_size({"width": 1600, "height": 900})
        beyond = page.evaluate(BEYOND_THE_TEXT)
        assert len(beyond) >= 4
        assert max(beyond) < 1.0


def test_values_stand_along_an_axis_of_numbers(browser: Browser, tmp_path: Path):
    points = [{"forward": "0.01"}, {"forward": "0.02"}]
    table = table_of([{"forward": 0.01}, {"forward": 0.02}], final_distance_thumb=[0.03, 0.01, 0.06, 0.05])
    folder = folder_of(tmp_path, campaign_metadata("ir_grasp", points), table)
    write_campaign_page(folder)
    with opened(browser, folder.report) as page:
        types = page.evaluate(
            "[...document.querySelectorAll('.plot')].flatMap(p => [p._fullLayout.xaxis.type, p._fullLayout.yaxis.type])"
        )
        assert types == ["linear"] * 4


def test_a_page_says_what_became_of_every_run(campaign: CampaignFolder):
    html = campaign.report.read_text(encoding="utf-8")
    assert "in 2 of 3 runs done the task succeeded; 1 was lost." in html
    assert "its worker went away" in html
    assert "2 of 2" in html
    assert "0 of 1" in html


def test_pages_of_runs_are_linked_where_they_are(campaign: CampaignFolder, tmp_path: Path):
    page = tmp_path / "page.html"
    name = "000_strategy=reflex_r0000"
    write_campaign_page(campaign, page)
    assert "<a href='runs/" not in page.read_text(encoding="utf-8")
    (campaign.runs / name / "report.html").touch()
    write_campaign_page(campaign, page)
    assert f"<a href='runs/{name.replace('=', '%3D')}/report.html'>" in page.read_text(encoding="utf-8")
