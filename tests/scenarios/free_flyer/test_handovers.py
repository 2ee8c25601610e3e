"""The free-flyer's four handovers, on the built FMUs."""

import itertools
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flyer_runs import metric, run

import handover
from handover.cosim.record.reader import Record
from handover.cosim.system.schedule import Schedule
from handover.fmus.build import cached
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.free_flyer.handover.handovers import (
    Collaborative,
    FailedReception,
    FlyerHandover,
    HandoverOfTask,
    HumanToRobot,
    RobotToHuman,
)
from handover.scenarios.free_flyer.parameters import HandoverParameters, Task, TaskParameters

HANDOVERS_OF = dict(zip(Task, (RobotToHuman, HumanToRobot, FailedReception, Collaborative), strict=True))
HANDOVERS = (RobotToHuman, HumanToRobot, FailedReception, Collaborative)
FREE, GRIPPER, HAND, BOTH = range(4)


def holders(record: Record) -> list[int]:
    """Return who held the object in turn."""
    return [k for k, _ in itertools.groupby(record["person.holder"].tolist())]


def test_a_command_acts_in_the_step_that_follows_its_measurement():
    system = RobotToHuman().build(HandoverParameters(), 0, lambda name: cached(RobotToHuman.units[name], 3))
    schedule = Schedule(system)
    assert [s.unit for s in schedule.sampled] == ["decision", "impedance", "pose"]
    assert [s.unit for s in schedule.continuous] == ["thrusters", "robot", "navigation", "person"]


def test_a_biased_estimate_leads_the_gripper_astray_and_the_truth_tells(tmp_path: Path):
    exact, biased = (
        handover.run(
            "flyer_robot_to_human",
            seed=1,
            parameters={"navigation.position_bias": bias},
            out=tmp_path / name,
            report=False,
        )
        for name, bias in (("exact", 0.0), ("biased", 0.02))
    )
    record = Record(tmp_path / "biased" / "signals.parquet")
    bias = np.mean(record["navigation.p_WB_meas"] - record["robot.p_WB"], axis=0)
    assert np.linalg.norm(bias) > 0.02
    assert exact.metrics["arrival_error"] < 0.01
    assert biased.metrics["arrival_error"] == pytest.approx(float(np.linalg.norm(bias)), abs=0.01)


@pytest.mark.slow
def test_the_robot_gives_an_object_to_a_person(tmp_path: Path):
    ended = run(RobotToHuman, tmp_path / "r", drawn=True)
    assert ended.outcome.success, ended.outcome.reason
    record = Record(tmp_path / "r" / "signals.parquet")
    assert holders(record) == [FREE, GRIPPER, BOTH, HAND]
    assert record["person.gripper_angle"][0] == pytest.approx(0.60)  # "initiates the handover with a closed gripper"
    assert record["person.gripper_angle"][record.time > 1.1][0] == pytest.approx(1.20)
    assert "failed_receptions" not in ended.summary["metrics"]
    assert metric(ended, "arrival_error") < 0.05
    assert metric(ended, "transfer_speed") > 0.059
    assert metric(ended, "transfer_displacement") >= metric(ended, "transfer_displacement_z") > 0.01
    assert not np.any(record["decision.impedance"] & record["decision.pose"])
    figures = {p.name for p in (tmp_path / "r" / "figures").iterdir()}
    names = ("scene", "transfer", "positions", "orientations", "gripper", "thrust")
    assert figures == {f"{n}.{s}" for n in names for s in ("png", "svg")}


@pytest.mark.slow
def test_a_compliant_robot_gives_way_further_where_the_thrusters_can_tell_it_from_a_rigid_one(tmp_path: Path):
    rigid, compliant = (
        run(RobotToHuman, tmp_path / b, f"behaviour={b}", "propulsion=ideal") for b in ("rigid", "compliant")
    )
    assert rigid.outcome.success, rigid.outcome.reason
    assert compliant.outcome.success, compliant.outcome.reason
    assert metric(compliant, "transfer_displacement_z") > 1.3 * metric(rigid, "transfer_displacement_z")
    assert metric(compliant, "transfer_speed") > 0.08


def test_a_person_gives_an_object_to_the_robot(tmp_path: Path):
    ended = run(HumanToRobot, tmp_path / "r", "behaviour=compliant")
    assert ended.outcome.success, ended.outcome.reason
    assert holders(Record(tmp_path / "r" / "signals.parquet")) == [HAND, BOTH, GRIPPER]
    assert metric(ended, "transfer_speed") > 0.037


def test_a_failed_reception_is_noticed_and_repeated(tmp_path: Path):
    ended = run(FailedReception, tmp_path / "r")
    assert ended.outcome.success, ended.outcome.reason
    assert "after 1 failed reception" in ended.outcome.reason
    record = Record(tmp_path / "r" / "signals.parquet")
    assert holders(record) == [HAND, BOTH, GRIPPER]
    assert record["decision.failed_receptions"][-1] == 1
    angle, felt = record["person.gripper_angle"], ended.summary["metrics"]["phase_close_gripper"]["value"]
    closed_on_nothing = (record["decision.failed_receptions"] == 0) & (record.time > felt)
    assert angle[closed_on_nothing].min() < 0.71
    assert angle[-1] > 0.71


def test_the_robot_holds_an_object_for_a_person(tmp_path: Path):
    ended = run(Collaborative, tmp_path / "r")
    assert ended.outcome.success, ended.outcome.reason
    record = Record(tmp_path / "r" / "signals.parquet")
    assert holders(record) == [FREE, GRIPPER, BOTH, HAND, BOTH, GRIPPER]
    assert {"transfer_time", "return_time", "transfer_speed", "return_speed"} <= set(ended.summary["metrics"])
    speed = next(p for p in Collaborative().plots(HandoverParameters(), record) if p.title == "Speed of the gripper")
    threshold = speed.curves[-1].values
    names = record.items("decision.phase")
    waits = [names[k] in ("SIGNAL", "CHECK_VELOCITY") for k in record["decision.phase"].tolist()]
    assert np.isfinite(threshold[waits]).all()
    assert np.isfinite(threshold).sum() == pytest.approx(sum(waits), abs=2)  # drawn as far as the next phase begins
    published, rigid = paper_values("free_flyer", "published"), HandoverParameters().behaviour
    pull, push = (published[f"velocity_{who}"][rigid] for who in ("hand", "gripper"))
    assert [k for k, _ in itertools.groupby(threshold[np.isfinite(threshold)].tolist())] == [pull, push]


def test_a_pull_that_is_too_weak_is_not_felt_and_the_verdict_says_so(tmp_path: Path):
    ended = run(RobotToHuman, tmp_path / "r", "strength=0.2", "patience=20")
    assert not ended.outcome.success
    assert "never felt a pull" in ended.outcome.reason


@pytest.mark.parametrize("behaviour", ["rigid", "compliant"])
def test_a_stronger_person_moves_the_robot_farther_within_its_thrusters_limits(tmp_path: Path, behaviour: str):
    ended = [run(RobotToHuman, tmp_path / f, f"strength={f}", f"behaviour={behaviour}") for f in ("1", "4")]
    assert all(e.outcome.success for e in ended)
    weak, strong = (metric(e, "transfer_displacement") for e in ended)
    assert strong > 1.5 * weak > 0.06


@pytest.mark.parametrize(
    ("place", "text"), [("50,-0.07,0", "from -1 to 1 m"), ("0.9,0.9,0.9", "out of the person's reach")]
)
def test_a_place_out_of_reach_is_refused_before_anything_is_written(tmp_path: Path, place: str, text: str):
    with pytest.raises(InvalidParameter, match=text):
        run(RobotToHuman, tmp_path / "r", f"p_WG_handover={place}")
    assert not (tmp_path / "r").exists()


@pytest.mark.slow
@pytest.mark.parametrize("scenario", HANDOVERS)
@pytest.mark.parametrize("place", ["0.2,-0.2,0.15", "-0.2,0.1,-0.2"])
def test_another_place_is_as_good(tmp_path: Path, scenario: type[FlyerHandover], place: str):
    ended = run(scenario, tmp_path / "r", f"p_WG_handover={place}")
    assert ended.outcome.success, ended.outcome.reason


@pytest.mark.slow
@pytest.mark.parametrize("scenario", HANDOVERS)
@pytest.mark.parametrize("behaviour", ["rigid", "compliant"])
def test_ten_of_ten_handovers_succeed(tmp_path: Path, scenario: type[FlyerHandover], behaviour: str):
    failed: dict[int, Any] = {}
    for seed in range(10):
        ended = run(scenario, tmp_path / str(seed), f"behaviour={behaviour}", seed=seed)
        if not ended.outcome.success:
            failed[seed] = ended.outcome.reason
    assert not failed


RATE = "handover.controllers.free_flyer.published_rate"


def test_the_plants_step_by_the_rate_of_controllers_that_have_another():
    at_67_5 = {
        "decision": f"{RATE}:HandoverStateMachine67",
        "impedance": f"{RATE}:ImpedanceController67",
        "pose": f"{RATE}:PoseController67",
    }

    def system(**others: str) -> dict[str, Fraction]:
        given = {**RobotToHuman.units, **others}
        built = RobotToHuman().build(HandoverParameters(), 0, lambda name: cached(given[name], 3))
        return {name: unit.period for name, unit in built.units.items()}

    assert set(system().values()) == {Fraction(2, 125)}
    (other,) = set(system(**at_67_5).values())
    assert float(other) == pytest.approx(1 / 67.5, rel=1e-15)
    one = system(pose=at_67_5["pose"])
    assert {one[name] for name in ("thrusters", "robot", "person")} == {Fraction(2, 125)}


def test_a_person_of_nominal_skill_is_the_units_own_and_less_skill_is_worse_in_all():
    person = paper_values("free_flyer", "person")
    of_skill = {"sight_error", "depth_error", "timing_error", "effort_spread", "haste", "reaction_time"}
    nominal, unskilled = HandoverParameters().traits, HandoverParameters(skill=0.0).traits
    assert {name: nominal[name] for name in of_skill} == {name: person[name] for name in of_skill}
    assert all(unskilled[name] > nominal[name] for name in of_skill)
    assert unskilled["effort_spread"] == pytest.approx(8.0 * float(person["effort_spread"]))


@pytest.mark.parametrize("task", Task)
def test_the_scenario_of_any_task_is_that_of_the_task(task: Task):
    p = TaskParameters(task=task)
    own = HANDOVERS_OF[task]
    assert HandoverOfTask().stop_time(p) == own().stop_time(p)
    assert HandoverOfTask().evaluator(p).receivers == own.receivers
    units = [s.build(p, 3, lambda name: cached(RobotToHuman.units[name], 3)).units for s in (HandoverOfTask(), own())]
    starts = [
        {name: {k: np.array(v).tolist() for k, v in unit.start.items()} for name, unit in u.items()} for u in units
    ]
    assert starts[0] == starts[1]


def test_a_robot_that_verifies_has_time_for_as_many_deliveries_as_it_attempts():
    scenario, p = RobotToHuman(), HandoverParameters(verify=True)
    attempts = paper_values("free_flyer", "decision")["attempts"]
    assert scenario.stop_time(p) >= attempts * p.patience
    assert scenario.stop_time(HandoverParameters()) < attempts * p.patience
