"""`--stop` of a scenario: a run ends there, and is judged as one that was ended."""

from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest
from support.campaigns import carried_out, short_plan
from support.commands import call, data_in
from support.kept_runs import kept_run

import handover
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.robots.ir_grasp.evaluation import GraspEvaluator
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.plan_check import prepared
from handover.scenarios.runs.results.run_folder import InvalidRunFolder


def test_a_run_ends_at_the_first_point_at_or_after_it_and_has_not_succeeded(tmp_path: Path):
    out = tmp_path / "r"
    done = call("run", "ir_grasp", "--stop", "1", "--no-report", "--out", out)
    assert done.exit_code == 1, done.output
    assert Record(out / "signals.parquet").time[-1] == pytest.approx(1.005)  # steps of 15 ms
    assert "; its stop time was reached" in done.output
    summary, run = data_in(out), data_in(out, "run")
    assert (summary["success"], summary["complete"], summary["stop"]) == (False, True, "1")
    assert run["stop"] == "1"
    assert ["stop", "1 s", "given stop time of the run"] in run["told_parameters"]


BLIND = ("run", "ir_grasp", "--seed", "3", "-p", "strategy=blind", "--no-report")


def test_what_is_over_before_is_judged_as_ever(tmp_path: Path):
    whole = handover.Run(kept_run(*BLIND))
    later = handover.run("ir_grasp", seed=3, strategy="blind", stop=1000, out=tmp_path / "later", progress=False)
    assert (later.success, later.reason) == (whole.success, whole.reason)
    records = [(run.folder / "signals.parquet").read_bytes() for run in (whole, later)]
    assert records[0] == records[1]
    assert "stop" not in data_in(whole.folder, "run")


def test_what_ended_by_itself_was_not_asked_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(_self: GraspEvaluator) -> Outcome:
        raise KeyError("of the evaluation")

    own_end = handover.Run(kept_run(*BLIND)).signals.time[-1]
    monkeypatch.setattr(GraspEvaluator, "outcome", fail)
    done = call(*BLIND, "--stop", f"{own_end + 1:.1f}", "--out", tmp_path / "r")
    assert "not judged: the verdict failed: KeyError" in done.output
    assert "as asked" not in done.output
    assert Record(tmp_path / "r" / "signals.parquet").time[-1] == own_end


def test_of_a_campaign_it_ends_all_runs_and_is_a_part_of_its_identity(tmp_path: Path):
    plan = short_plan(stop=Fraction(1, 2))
    folder = carried_out(plan, tmp_path / "c")
    assert [data_in(run)["simulated_seconds"] for run in folder.runs.iterdir()] == pytest.approx([0.5, 0.5])
    fmus = prepared(plan).fmus
    folder.check(plan, fmus)
    with pytest.raises(InvalidRunFolder, match="stop is 1/2 there, not given in this command"):
        CampaignFolder(folder.path).check(replace(plan, stop=None), fmus)
