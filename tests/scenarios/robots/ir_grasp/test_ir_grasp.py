"""The grasp itself, also with the correction on the move, on the built FMUs."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner
from support.kept_runs import kept_run
from support.scenarios.flyer_runs import metric, run
from support.wording import Wording

from handover.controllers.ir_grasp.ir_reflex import Phase, Stop
from handover.controllers.ir_grasp.parameters import Correction, Strategy
from handover.cosim.master.master import Master
from handover.cosim.record.reader import Record
from handover.cosim.system.schedule import Schedule
from handover.fmus.build import cached
from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.cli.command import main
from handover.scenarios.experiment.experiment import Outcome
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.ir_grasp.parameters import Parameters, Situation, pregrasp_position


def fmu(unit: str) -> Path:
    return cached(IrGrasp.units[unit], 3)


def grasp(seed: int, **parameters: Any) -> Outcome:
    """Run one grasp without leaving a folder."""
    p, experiment = Parameters(**parameters), IrGrasp()
    evaluator = experiment.evaluator(p)
    with Master(experiment.build(p, seed, fmu)) as master:
        master.run(experiment.stop_time(p), [evaluator], until=lambda: evaluator.over)
    return evaluator.outcome()


def test_a_command_acts_in_the_step_that_follows_its_scan():
    schedule = Schedule(IrGrasp().build(Parameters(), 0, fmu))
    assert [s.unit for s in schedule.sampled] == ["reflex"]
    assert [s.unit for s in schedule.continuous] == ["scene"]
    assert float(schedule.tick) == 0.015


@pytest.fixture(scope="module")
def usual() -> tuple[Record, dict[str, Any]]:
    folder = kept_run("run", "ir_grasp", "--no-report")
    return Record(folder / "signals.parquet"), json.loads((folder / "summary.json").read_text())


def test_a_moved_cylinder_is_grasped_and_the_summary_says_what_the_record_shows(usual: tuple[Record, dict[str, Any]]):
    record, summary = usual
    assert summary["success"] is True, summary["reason"]
    found = {name: metric["value"] for name, metric in summary["metrics"].items()}
    phase, p_WO = record["reflex.phase"], record["scene.p_WO"]
    assert phase[-1] == Phase.DONE
    closing = int(np.argmax(phase == Phase.CLOSE))
    assert np.linalg.norm(p_WO[-1] - p_WO[closing]) == pytest.approx(0.15, abs=0.04)
    assert record["scene.touching"][-1] >= 2
    for i, finger in enumerate(("thumb", "index", "ring")):
        assert found[f"final_distance_{finger}"] == record["reflex.distance"][closing, i]
    assert found["final_cost"] == record["reflex.cost"][closing]
    assert found["steps"] == record["reflex.steps"][-1]
    assert found["refinement_time"] == pytest.approx(
        record.time[closing] - record.time[np.argmax(phase == Phase.CHECK)]
    )
    assert found["displacement"] == pytest.approx(np.linalg.norm(p_WO[closing] - p_WO[0]))
    drawn = Situation.draw(Parameters(), 0)
    assert found["moved"] == pytest.approx(np.linalg.norm(drawn.p_WO))
    assert found["turned"] == pytest.approx(drawn.turn)
    off = drawn.p_WH_pregrasp - pregrasp_position(Parameters().expected_solid, Parameters().standoff)
    assert found["vision_position_error"] == pytest.approx(np.linalg.norm(off))
    assert found["vision_yaw_error"] == pytest.approx(drawn.yaw)
    stop = Stop(int(record["reflex.stop"][-1]))
    assert found["stop"] == stop
    assert stop.name.lower() in summary["reason"]


@pytest.mark.slow
def test_a_run_leaves_its_figures():
    folder = kept_run("run", "ir_grasp")
    names = {p.name for p in (folder / "figures").iterdir()}
    assert names == {f"{n}.{s}" for n in ("scene", "distances", "commands") for s in ("png", "svg")}
    assert (folder / "report.html").is_file()


@pytest.mark.slow
def test_the_reflex_beats_closing_blind_on_the_moved_cylinder_and_forward_does_as_well():
    """The control in the class's docstring: with a standoff so large, coming nearer is what counts."""
    for seed in (2000, 2001):
        blind = grasp(seed, strategy=Strategy.BLIND)
        assert (blind.success, blind.metrics["steps"].value) == (False, 0)
        assert "(blind)" in blind.reason
        assert grasp(seed).success
        assert grasp(seed, strategy=Strategy.FORWARD, forward=0.055).success


@pytest.mark.slow
@pytest.mark.parametrize("thing", [Thing.PAPER_BOX_B, Thing.BABY_CUP_A, Thing.POLYGON])
def test_things_of_every_kind_can_be_grasped(thing: Thing):
    assert any(grasp(seed, thing=thing, perturbed=bool(seed)).success for seed in range(2))


@pytest.mark.slow
def test_as_printed_the_refinement_runs_to_its_end():
    outcome, own = grasp(0, literal=True), grasp(0)
    assert outcome.metrics["stop"].value in (Stop.THRESHOLD, Stop.STALLED, Stop.PATIENCE)
    assert outcome.metrics["steps"].value >= 1
    assert outcome.metrics["probing_moves"].value > own.metrics["probing_moves"].value


@pytest.mark.parametrize(
    ("seed", "changes"),
    [(7, ("shift=0.05,0.04",)), pytest.param(8, ("carried_speed=0.015",), marks=pytest.mark.slow)],
    ids=["shifted", "carried"],
)
def test_an_object_that_is_elsewhere_or_carried_away_is_tracked_and_held(
    seed: int, changes: tuple[str, ...], tmp_path: Path
):
    ended = run(IrGrasp, tmp_path / "run", "correction=fast", *changes, seed=seed)
    assert ended.summary["success"], ended.summary["reason"]
    phases = {Phase(k).name for k in np.unique(Record(tmp_path / "run" / "signals.parquet")["reflex.phase"])}
    assert {"SEARCH", "RECOVER", "TRACK", "CLOSE"} <= phases or seed == 8
    assert "TRACK" in phases
    assert metric(ended, "steps") > 0
    assert seed == 7 or (metric(ended, "refinement_time") < 3.0 and metric(ended, "displacement") < 5e-3)


@pytest.mark.slow
def test_a_run_begins_with_what_the_last_one_learnt_of_the_jacobian(tmp_path: Path):
    given = ("-p", "correction=fast", "-p", "perturbed=false", "--no-report")
    last = kept_run("run", "ir_grasp", *given)
    learnt = Record(last / "signals.parquet")["reflex.jacobian_offset"]
    assert np.max(np.abs(learnt[-1])) > 0.01
    second = ["run", "ir_grasp", *given, "--stop", "0.1", "-p", f"last_grasp={last}", "--out", str(tmp_path / "second")]
    CliRunner().invoke(main, second)
    begun = Record(tmp_path / "second" / "signals.parquet")["reflex.jacobian_offset"]
    assert begun[0] == pytest.approx(learnt[-1], abs=1e-12)  # to rounding: the design is added and taken off
    assert np.array_equal(learnt[0], np.zeros((3, 4)))


def test_a_last_grasp_that_is_none_is_refused(tmp_path: Path, wording: Wording):
    fast = Parameters(correction=Correction.FAST, last_grasp=str(tmp_path))
    wording.check(*fast.faults())
    pq.write_table(pa.table({"time": [0.0], "reflex.steps": [0]}), tmp_path / "signals.parquet")
    wording.check(*fast.faults())
