"""The command `handover paper`."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

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
    ("arguments", "content"),
    [
        (["ir-tabel"], "no experiment 'ir-tabel': did you mean ir-table?"),
        (["ir-table", "--workers", "2", "--scheduler", "tcp://127.0.0.1:1"], "one of both is right"),
        (["ir-table", "--workers", "0"], "0 is not in the range x>=1"),
        (["ir-table", "--seed", "-1"], "-1 is not in the range 0<=x<="),
        (["ir-table", "--model", "m.json"], "ir-table has no use for a trained model"),
        (["vsl-2", "--model", "none.json"], "none.json: there is no such file"),
    ],
)
def test_a_call_that_cannot_be_executed_is_refused_and_leaves_nothing(
    arguments: list[str], content: str, tmp_path: Path
):
    result = paper(*arguments, "--out", tmp_path / "c")
    assert result.exit_code == 2
    assert content in result.output
    assert not (tmp_path / "c").exists()


def test_a_folder_of_something_else_is_refused(tmp_path: Path):
    (tmp_path / "letter.txt").write_text("Dear reader")
    result = paper("ir-table", "--quick", "--out", tmp_path)
    assert result.exit_code == 2
    assert "it is not empty and has no campaign.json" in result.output
    assert [p.name for p in tmp_path.iterdir()] == ["letter.txt"]


@pytest.mark.slow
@pytest.mark.parametrize("experiment", ["vsl-1", "vsl-2"])
def test_the_quick_plan_of_the_vsl_arm_ends_with_tables_figures_and_too_few_runs(experiment: str, tmp_path: Path):
    ended = paper(experiment, "--quick", "--out", tmp_path / "c")
    assert ended.exit_code == 0, ended.output
    claims = json.loads((tmp_path / "c" / "claims.json").read_text(encoding="utf-8"))
    assert {claim["verdict"] for claim in claims} == {"not comparable", "too few runs"}
    assert len(list((tmp_path / "c" / "figures").glob("*.png"))) >= 3
    assert (tmp_path / "c" / "report.html").exists()


@pytest.mark.slow
def test_it_leaves_claims_figures_and_a_page_and_a_second_call_repeats_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    whole = IrTable().plan(quick=True)
    cylinder = [point for point in whole.points if point["thing"] == "cylinder"]
    few = replace(whole, points=cylinder, repetitions=1)

    def plan(_experiment: IrTable, _quick: bool) -> CampaignPlan:
        return few

    monkeypatch.setattr(IrTable, "plan", plan)
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
def test_table_1_of_luberto_at_full_size(tmp_path: Path):
    result = paper("ir-table", "--out", tmp_path / "c")
    assert result.exit_code == 0, result.output
    content = {c["claim"]: c["verdict"] for c in json.loads((tmp_path / "c/claims.json").read_text(encoding="utf-8"))}
    for pose in ("nominal", "perturbed"):
        assert content[f"In {pose} poses the IR-guided hand succeeds more often than the blind one."] == "reproduced"
