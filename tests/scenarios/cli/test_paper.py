"""The command `handover paper`."""

import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from support.in_process_pool import LOCAL_CLUSTER, InProcessPool, local_cluster_of
from support.wording import Wording

from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign_report.campaign_page import write_campaign_page
from handover.scenarios.cli.command import main
from handover.scenarios.published.catalog import EXPERIMENTS
from handover.scenarios.published.ir_grasp.ir_table import IrTable

_PUBLISHED_VERDICTS = {"reproduced", "not reproduced", "not comparable"}
_OWN_VERDICTS = {"holds", "does not hold", "too few runs"}
"""Of claims of this project's own, which no paper makes."""


def paper(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, ["paper", *map(str, arguments)])


def test_without_a_name_it_lists_the_experiments():
    shown = paper().output
    for name, experiment in EXPERIMENTS.items():
        assert name in shown
        assert experiment.title in shown


@pytest.mark.parametrize(
    "arguments",
    [
        ["ir-tabel"],
        ["ir-table", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"],
        ["ir-table", "--workers", "0"],
        ["ir-table", "--seed", "-1"],
        ["ir-table", "--model", "m.json"],
        ["vsl-2", "--model", "none.json"],
    ],
    ids=" ".join,
)
def test_a_call_that_cannot_be_executed_is_refused_and_leaves_nothing(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(tmp_path)
    result = paper(*arguments, "--out", tmp_path / "c")
    assert result.exit_code == 2
    wording.check(result.output)
    assert not (tmp_path / "c").exists()


def test_a_folder_of_something_else_is_refused(tmp_path: Path):
    (tmp_path / "letter.txt").write_text("Dear reader")
    result = paper("ir-table", "--quick", "--out", tmp_path)
    assert result.exit_code == 2
    assert "it is not empty and has no campaign.json" in result.output
    assert [p.name for p in tmp_path.iterdir()] == ["letter.txt"]


def plan_of(name: str, few: CampaignPlan, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let an experiment have a plan, whose runs are executed by this process."""

    def plan(_experiment: object, _quick: bool) -> CampaignPlan:
        return few

    monkeypatch.setattr(EXPERIMENTS[name], "plan", plan)
    monkeypatch.setitem(sys.modules, LOCAL_CLUSTER, local_cluster_of(InProcessPool()))


@pytest.mark.slow
@pytest.mark.usefixtures("empty_figures")
def test_the_quick_plan_of_the_vsl_arm_ends_with_tables_figures_and_too_few_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    whole = EXPERIMENTS["vsl-2"]().plan(quick=True)
    short = {"points": "3", "settle": "0.2"}
    plan_of("vsl-2", replace(whole, fixed={**whole.fixed, **short}), monkeypatch)
    assert_few_runs("vsl-2", tmp_path / "c")


def assert_few_runs(experiment: str, folder: Path) -> None:
    ended = paper(experiment, "--quick", "--out", folder)
    assert ended.exit_code == 0, ended.output
    claims = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    assert {claim["verdict"] for claim in claims} == {"not comparable", "too few runs"}
    assert len(list((folder / "figures").glob("*.png"))) >= 3
    assert (folder / "report.html").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("empty_figures")
def test_it_leaves_claims_figures_and_a_page_and_a_second_call_repeats_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    whole = IrTable().plan(quick=True)
    cylinder = [point for point in whole.points if point["thing"] == "cylinder"]
    plan_of("ir-table", replace(whole, points=cylinder, repetitions=1), monkeypatch)
    folder = tmp_path / "c"
    first = paper("ir-table", "--quick", "--out", folder)
    assert first.exit_code == 0, first.output
    claims = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    for claim in claims:
        words = _OWN_VERDICTS if claim["beyond"] else _PUBLISHED_VERDICTS
        assert claim["verdict"] in words
        assert claim["claim"] in " ".join(first.output.split())
    left = {"campaign.json", "claims.json", "figures", "report.html", "runs.parquet"}
    assert {p.name for p in folder.iterdir()} >= left
    assert {p.name for p in (folder / "figures").iterdir()} >= {"success_rates.png", "success_by_point.png"}
    made = {p: p.stat().st_mtime_ns for p in (folder / "runs").glob("*/summary.json")}
    assert len(made) == 8
    second = paper("ir-table", "--quick", "--out", folder, "--no-report")
    assert second.exit_code == 0, second.output
    assert {p: p.stat().st_mtime_ns for p in made} == made
    assert json.loads((folder / "claims.json").read_text(encoding="utf-8")) == claims
    page = (folder / "report.html").read_bytes()
    shutil.rmtree(folder / "figures")
    write_campaign_page(CampaignFolder(folder))
    assert (folder / "report.html").read_bytes() == page, "it is made of the claims and the table that were left"
    assert not (folder / "figures").exists()


@pytest.mark.paper
@pytest.mark.parametrize("experiment", ["vsl-1", "vsl-2"])
def test_quick_plans_of_the_vsl_arm_at_full_length(experiment: str, tmp_path: Path):
    assert_few_runs(experiment, tmp_path / "c")


@pytest.mark.paper
def test_table_1_of_luberto_at_full_size(tmp_path: Path):
    result = paper("ir-table", "--out", tmp_path / "c")
    assert result.exit_code == 0, result.output
    content = {c["claim"]: c["verdict"] for c in json.loads((tmp_path / "c/claims.json").read_text(encoding="utf-8"))}
    for pose in ("nominal", "perturbed"):
        assert content[f"In {pose} poses the IR-guided hand succeeds more often than the blind one."] == "reproduced"
