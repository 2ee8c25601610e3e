"""The command `handover paper`."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from click.testing import Result
from support.commands import call, data_in
from support.in_process_pool import InProcessPool

from handover.scenarios.pages.campaign_report.campaign_page import write_campaign_page
from handover.scenarios.published.catalog import EXPERIMENTS
from handover.scenarios.published.ir_grasp.ir_table import IrTable
from handover.scenarios.runs.campaign import pools
from handover.scenarios.runs.campaign.folder import CampaignFolder

_PUBLISHED_VERDICTS = {"reproduced", "not reproduced", "not comparable"}
_OWN_VERDICTS = {"holds", "does not hold", "too few runs"}
"""Of claims of this project's own, which no paper makes."""


def paper(*arguments: object) -> Result:
    return call("paper", *arguments)


def test_without_a_name_it_lists_the_experiments():
    shown = paper().output
    assert all(name in shown and experiment.title in shown for name, experiment in EXPERIMENTS.items())


@pytest.mark.slow
@pytest.mark.usefixtures("empty_figures")
def test_it_leaves_claims_figures_and_a_page_and_a_second_call_repeats_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    whole = IrTable().plan(quick=True)
    cylinder = [point for point in whole.points if point["thing"] == "cylinder"]
    few = replace(whole, points=cylinder, repetitions=1)
    monkeypatch.setattr(EXPERIMENTS["ir-table"], "plan", lambda _experiment, quick: few)  # type: ignore  # noqa: ARG005
    monkeypatch.setattr(pools, "LocalPool", InProcessPool.opened)
    folder = tmp_path / "c"
    first = paper("ir-table", "--quick", "--out", folder)
    assert first.exit_code == 0, first.output
    claims = data_in(folder, "claims")
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
    assert data_in(folder, "claims") == claims
    page = (folder / "report.html").read_bytes()
    shutil.rmtree(folder / "figures")
    write_campaign_page(CampaignFolder(folder))
    assert (folder / "report.html").read_bytes() == page, "it is made of the claims and the table that were left"
    assert not (folder / "figures").exists()


@pytest.mark.paper
@pytest.mark.parametrize("experiment", ["vsl-1", "vsl-2"])
def test_quick_plans_of_the_vsl_arm_at_full_length(experiment: str, tmp_path: Path):
    folder = tmp_path / "c"
    ended = paper(experiment, "--quick", "--out", folder)
    assert ended.exit_code == 0, ended.output
    assert {claim["verdict"] for claim in data_in(folder, "claims")} == {"not comparable", "too few runs"}
    assert len(list((folder / "figures").glob("*.png"))) >= 3
    assert (folder / "report.html").exists()


@pytest.mark.paper
def test_table_1_of_luberto_at_full_size(tmp_path: Path):
    result = paper("ir-table", "--out", tmp_path / "c")
    assert result.exit_code == 0, result.output
    verdicts = {c["claim"]: c["verdict"] for c in data_in(tmp_path / "c", "claims")}
    fewer = "The IR-guided hand succeeds less often in perturbed poses than in nominal ones."
    assert verdicts[fewer] in ("reproduced", "not reproduced")
    for pose in ("nominal", "perturbed"):  # the blind hand's failure was put in by a choice
        more = f"In {pose} poses the IR-guided hand succeeds more often than the blind one."
        assert verdicts[more] == "not comparable"
