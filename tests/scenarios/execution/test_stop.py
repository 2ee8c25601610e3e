"""`--stop` of a scenario: a run ends there, is judged as one that was ended, and is resumed to the same time."""

import contextlib
import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result
from support.campaigns import carried_out
from support.kept_runs import kept_run

import handover
from handover.cosim.record.reader import Record
from handover.scenarios.campaign.folder import CampaignFolder
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.cli.command import main
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.request import RunRequest
from handover.scenarios.execution.resume import InterruptedRun
from handover.scenarios.execution.runner import run_task
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.ir_grasp.evaluation import GraspEvaluator
from handover.scenarios.results.run_folder import InvalidRunFolder, RunFolder


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def read(folder: Path, name: str) -> dict[str, Any]:
    return json.loads((folder / name).read_text())


def test_a_run_ends_at_the_first_point_at_or_after_it_and_has_not_succeeded(tmp_path: Path):
    out = tmp_path / "r"
    done = call("run", "ir_grasp", "--stop", "1", "--no-report", "--out", out)
    assert done.exit_code == 1, done.output
    assert Record(out / "signals.parquet").time[-1] == pytest.approx(1.005)  # steps of 15 ms
    assert "ir_grasp failed: ended at 1.005 s, as asked: " in done.output
    summary = read(out, "summary.json")
    assert (summary["success"], summary["complete"], summary["stop"]) == (False, True, "1")
    assert read(out, "run.json")["stop"] == "1"
    assert ["stop", "1 s", "given stop time of the run"] in read(out, "run.json")["told_parameters"]


BLIND = ("run", "ir_grasp", "--seed", "3", "-p", "strategy=blind", "--no-report")


def test_what_is_over_before_is_judged_as_ever(tmp_path: Path):
    whole = handover.Run(kept_run(*BLIND))
    later = handover.run("ir_grasp", seed=3, strategy="blind", stop=1000, out=tmp_path / "later", progress=False)
    assert (later.success, later.reason) == (whole.success, whole.reason)
    records = [(run.folder / "signals.parquet").read_bytes() for run in (whole, later)]
    assert records[0] == records[1]
    assert "stop" not in read(whole.folder, "run.json")


def test_what_ended_by_itself_was_not_asked_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def fail(_self: GraspEvaluator) -> Outcome:
        raise KeyError("of the evaluation")

    own_end = handover.Run(kept_run(*BLIND)).signals.time[-1]
    monkeypatch.setattr(GraspEvaluator, "outcome", fail)
    done = call(*BLIND, "--stop", f"{own_end + 1:.1f}", "--out", tmp_path / "r")
    assert "not judged: the verdict failed: KeyError" in done.output
    assert "as asked" not in done.output
    assert Record(tmp_path / "r" / "signals.parquet").time[-1] == own_end


class _AskedAt(Interruption):
    """Is asked to end a run at its first progress after a time, s."""

    def __init__(self, time: float) -> None:
        super().__init__(ending=())
        self._time = time

    def tell(self, t: float, _end: float) -> None:
        self.asked = t >= self._time


def test_an_interrupted_run_is_resumed_to_it(tmp_path: Path):
    out, whole = tmp_path / "r", tmp_path / "whole"
    arguments = ("run", "ir_grasp", "--stop", "1.5", "--checkpoint", "0.5", "--no-report", "--out")
    assert call(*arguments, whole).exit_code == 1
    interruption = _AskedAt(0.8)
    with contextlib.ExitStack() as opened:
        request = RunRequest(subject="ir_grasp", out=out, stop=Fraction("1.5"), every=Fraction(1, 2), presented=False)
        run_task(request.task(opened), interruption.tell, interruption)
        assert read(out, "summary.json")["reason"].startswith("interrupted: ")
        interrupted = InterruptedRun(RunFolder.of_run(out))
        run_task(
            replace(interrupted.task(opened), presented=False),
            lambda _t, _e: None,
            Interruption(),
            interrupted.resumption,
        )
    assert (out / "signals.parquet").read_bytes() == (whole / "signals.parquet").read_bytes()
    assert read(out, "summary.json")["reason"] == read(whole, "summary.json")["reason"]


def test_of_a_campaign_it_ends_all_runs_and_is_a_part_of_its_identity(tmp_path: Path):
    plan = CampaignPlan(scenario="ir_grasp", points=[{}], stop=Fraction(1))
    folder = carried_out(plan, tmp_path / "c")
    (run,) = folder.runs.iterdir()
    assert read(run, "summary.json")["simulated_seconds"] == pytest.approx(1.005)
    fmus = {name: next(folder.fmus.glob(f"*{model}*")) for name, model in (("scene", "Grasp"), ("reflex", "Reflex"))}
    folder.check(plan, fmus)
    with pytest.raises(InvalidRunFolder, match="stop is 1 there, not given in this command"):
        CampaignFolder(folder.path).check(replace(plan, stop=None), fmus)
