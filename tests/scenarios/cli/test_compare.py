"""`handover compare`: campaigns that differ, run and compared; usage errors, which leave nothing; JSON."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from playwright.sync_api import Browser
from support.campaigns import campaign_metadata, carried_out, folder_of, table_of
from support.commands import call
from support.opened_page import opened, overflow

from handover.scenarios.experiment.plotting import PRINTED_FORMATS
from handover.scenarios.runs.campaign.plan import CampaignPlan


@pytest.fixture(scope="module")
def grasps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of two campaigns with the same seeds: `far`, where a hand goes 10 cm forward, and `near`."""
    folder = tmp_path_factory.mktemp("campaigns")
    for name, given in (("far", {"strategy": "forward", "forward": "0.1"}), ("near", {"strategy": "blind"})):
        fixed = {**given, "run_up": "0"}
        points = [{"thing": "cylinder"}, {"thing": "paper_box_a"}][: 1 + (name == "far")]
        carried_out(CampaignPlan(scenario="ir_grasp", points=points, fixed=fixed, repetitions=2, seed=2), folder / name)
    return folder


def compare(*arguments: object) -> Result:
    return call("compare", *arguments)


@pytest.mark.usefixtures("empty_figures")
def test_a_known_difference_is_found_run_by_run(grasps: Path, tmp_path: Path, browser: Browser):
    out = tmp_path / "out"
    call = (grasps / "far", grasps / "near", "--name", "10 cm", "--name", "<at once>", "--out", out)
    done = compare(*call, "--metric", "moved", "--metric", "left_behind", "--json")
    assert done.exit_code == 0, done.output
    printed: dict[str, Any] = json.loads(done.stdout)
    assert printed.pop("folder") == str(out)
    assert printed == json.loads((out / "comparison.json").read_bytes())
    assert printed["differences"] == [
        {"kind": "parameter", "name": "strategy", "values": {"10 cm": "forward", "<at once>": "blind"}},
        {"kind": "parameter", "name": "forward", "values": {"10 cm": "0.1", "<at once>": "0.035"}},
    ]
    assert [list(p["campaigns"]) for p in printed["points"]] == [["10 cm", "<at once>"], ["10 cm"]]
    success, *_ = printed["tests"]
    assert (success["of"], success["paired"], success["method"]) == ("success", True, "McNemar")
    assert success["counts"] == {"first": [2, 2], "second": [0, 2]}
    assert (success["only_first"], success["p"]) == (2, 0.5)
    moved = next(t for t in printed["tests"] if t["of"] == "moved")  # by the seed alone: the pairs are of one scene
    assert (moved["paired"], moved["n"], moved["difference"], moved["p"]) == (True, 2, 0.0, 1.0)
    assert len((out / "comparison.csv").read_text().splitlines()) == 4
    names = ("success_by_point", "moved_by_point", "left_behind_by_point")
    assert {p.name for p in (out / "figures").iterdir()} == {f"{n}.{end}" for n in names for end in PRINTED_FORMATS}
    with opened(browser, out / "report.html") as page:
        assert page.inner_text("h1") == "ir_grasp: 10 cm and <at once>"
        assert page.locator(".plot:has(.main-svg)").count() == page.locator(".plot").count() == 2
        assert page.evaluate("document.querySelector('#success .plot').data.map(t => t.name)") == ["10 cm", "<at once>"]
        rates = "document.querySelector('#success .plot').data.map(t => t.customdata.map(c => c[1]))"
        assert page.evaluate(rates) == [["2 of 2", "2 of 2"], ["0 of 2"]]
        assert "2 of 2" in page.inner_text("#tests tbody tr")
        assert "0.035" in page.inner_text("#differences")
        page.set_viewport_size({"width": 400, "height": 800})
        assert overflow(page) <= 0


@pytest.mark.usefixtures("empty_figures")
def test_runs_are_compared_by_their_curves(grasps: Path, tmp_path: Path, browser: Browser):
    folders = [grasps / name / "runs" / "000_thing=cylinder_r0000" for name in ("far", "near")]
    out = tmp_path / "out"
    done = compare(*folders, "--out", out, "--name", "far", "--name", "near", "--signal", "scene.p_WH")
    assert done.exit_code == 0, done.output
    assert f"report: {out / 'report.html'}" in done.stdout
    assert "they differ in: strategy, forward" in done.stdout
    assert {p.name for p in (out / "figures").iterdir()} == {f"curves.{end}" for end in PRINTED_FORMATS}
    assert json.loads((out / "comparison.json").read_bytes())["curves"] == ["scene.p_WH[1]", "scene.p_WH[2]"]
    assert (out / "comparison.csv").read_text().startswith("metric,unit,far,near\n")
    done = compare(*folders, "--out", tmp_path / "plots", "--json")  # the scenario's own, as no signal is named
    curves = json.loads(done.stdout)["curves"]
    assert curves[0] == "Distances of the fingers from the object: thumb, as seen"
    assert (len(curves), "Cost of thumb and ring, [Luberto] eq. (4)" in curves) == (6, True)
    with opened(browser, out / "report.html") as page:
        first = "document.querySelector('#time .plot')"
        assert page.evaluate(f"{first}.data.map(t => t.name)") == ["far", "near"] * 2
        assert page.evaluate(f"{first}.layout.yaxis.title.text") == "scene.p_WH[1] (mm)"
        last = f"{first}.calcdata.map(points => Math.max(...points.map(p => p.y ?? -1e9)))"
        far, near, *_ = page.evaluate(last)
        assert far - near == pytest.approx(100, abs=2)  # mm, which it goes forward before it closes


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.usefixtures("empty_figures")
def test_without_a_folder_it_is_one_of_its_own_and_long_tables_are_cut(here: Path):
    points = [{"forward": f"0.{n}"} for n in range(10, 23)]
    for name in ("a", "b"):
        folder_of(here / name, campaign_metadata("ir_grasp", points), table_of(points))
    done = compare("a", "b"), compare("a", "b")
    assert [d.exit_code for d in done] == [0, 0]
    assert "and 2 more rows, in the report" in done[0].stdout
    made = sorted((here / "comparisons").iterdir())
    assert len(made) == 2
    assert all((folder / "report.html").is_file() and "_ir_grasp" in folder.name for folder in made)


@pytest.mark.usefixtures("empty_figures")
@pytest.mark.parametrize("succeeded", [0, 3, 5])
def test_metrics_are_tested_always_and_successes_where_any_differ(here: Path, succeeded: int):
    for name, moved in (("a", [0.01, 0.02, 0.03, 0.04, 0.05]), ("b", [0.02, 0.04, 0.06, 0.08, 0.1])):
        table = table_of([{}], 5, moved=moved, success=[k < succeeded for k in range(5)])
        folder_of(here / name, campaign_metadata("ir_grasp", [{}], 5), table)
    done = compare("a", "b", "--metric", "moved")
    assert done.exit_code == 0, done.output
    lines = [line.split() for line in done.stdout.splitlines()]
    assert ["all", "runs", "moved", "b", "–", "a", "5", "of", "5", "+30", "mm", "Wilcoxon", "0.0625"] in lines
    assert ("McNemar" in done.stdout) == (succeeded == 3)  # otherwise its p is 1
    assert "With 5 pairs p cannot fall below 0.0625" in done.stdout
