"""The free-flyer's four handovers, on the built FMUs."""

import itertools
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from support.scenarios.flyer_runs import Kept, fmu, kept, metric, run
from support.wording import Wording

from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.cosim.record.reader import Record
from handover.cosim.system.schedule import Schedule
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.free_flyer.handover.handovers import (
    Collaborative,
    FailedReception,
    FlyerHandover,
    HandoverOfTask,
    HumanToRobot,
    RobotToHuman,
)
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.robots.free_flyer.parameters import HandoverParameters, Task, TaskParameters

HANDOVERS_OF = dict(zip(Task, (RobotToHuman, HumanToRobot, FailedReception, Collaborative), strict=True))
FREE, GRIPPER, HAND, BOTH = range(4)


def holders(run: Kept) -> list[int]:
    """Return who held the object in turn."""
    return [k for k, _ in itertools.groupby(run.record["person.holder"].tolist())]


def test_a_command_acts_in_the_step_that_follows_its_measurement():
    system = RobotToHuman().build(HandoverParameters(), 0, lambda name: fmu(RobotToHuman.units[name]))
    schedule = Schedule(system)
    assert [s.unit for s in schedule.sampled] == ["decision", "impedance", "pose"]
    assert [s.unit for s in schedule.continuous] == ["thrusters", "robot", "navigation", "person"]


def test_the_robot_gives_an_object_to_a_person():
    done = kept("flyer_robot_to_human")
    assert done.success, done.reason
    assert "the person had the object" in done.reason
    assert done.metric("decided_by") == Cause.NONE
    assert holders(done) == [FREE, GRIPPER, BOTH, HAND]
    angle = done.record["person.gripper_angle"]
    assert angle[0] == pytest.approx(0.60)  # "initiates the handover with a closed gripper"
    assert angle[done.record.time > 1.1][0] == pytest.approx(1.20)
    assert "failed_receptions" not in done.summary["metrics"]
    assert done.metric("arrival_error") < 0.05
    assert done.metric("transfer_speed") > 0.059
    assert done.metric("transfer_displacement") >= done.metric("transfer_displacement_z") > 0.01
    assert not np.any(done.record["decision.impedance"] & done.record["decision.pose"])


@pytest.mark.slow
def test_a_person_gives_an_object_to_the_robot():
    done = kept("flyer_human_to_robot", "behaviour=compliant")
    assert done.success, done.reason
    assert holders(done) == [HAND, BOTH, GRIPPER]
    assert done.metric("transfer_speed") > 0.037
    assert done.metric("arrival_error") < 0.01


@pytest.mark.slow
def test_a_biased_estimate_leads_the_gripper_astray_and_the_truth_tells(tmp_path: Path):
    stop = kept("flyer_human_to_robot", "behaviour=compliant").metric("phase_signal") + 1.0
    given = "behaviour=compliant", "navigation.position_bias=0.02"
    biased = run(HumanToRobot, tmp_path / "r", *given, seed=1, stop=stop)
    record = Record(tmp_path / "r" / "signals.parquet")
    bias = np.linalg.norm(np.mean(record["navigation.p_WB_meas"] - record["robot.p_WB"], axis=0))
    assert bias > 0.02
    assert metric(biased, "arrival_error") == pytest.approx(float(bias), abs=0.01)


@pytest.mark.slow
def test_a_failed_reception_is_noticed_and_repeated():
    done = kept("flyer_failed_reception")
    assert done.success, done.reason
    assert "after 1 failed reception" in done.reason
    assert holders(done) == [HAND, BOTH, GRIPPER]
    failed, angle = done.record["decision.failed_receptions"], done.record["person.gripper_angle"]
    assert failed[-1] == 1
    closed_on_nothing = (failed == 0) & (done.record.time > done.metric("phase_close_gripper"))
    assert angle[closed_on_nothing].min() < 0.71
    assert angle[-1] > 0.71


def test_the_robot_holds_an_object_for_a_person():
    done = kept("flyer_collaborative")
    assert done.success, done.reason
    record = done.record
    assert holders(done) == [FREE, GRIPPER, BOTH, HAND, BOTH, GRIPPER]
    assert {"transfer_time", "return_time", "transfer_speed", "return_speed"} <= set(done.summary["metrics"])
    speed = next(p for p in Collaborative().plots(HandoverParameters(), record) if p.title == "Speed of the gripper")
    threshold = speed.curves[-1].values
    names, shown = record.items("decision.phase"), np.isfinite(threshold)
    waits = [names[k] in ("SIGNAL", "CHECK_VELOCITY") for k in record["decision.phase"].tolist()]
    assert shown[waits].all()
    assert shown.sum() == pytest.approx(sum(waits), abs=2)  # drawn as far as the next phase begins
    published, rigid = paper_values("free_flyer", "published"), HandoverParameters().behaviour
    pull_and_push = [published[f"velocity_{who}"][rigid] for who in ("hand", "gripper")]
    assert [k for k, _ in itertools.groupby(threshold[shown].tolist())] == pull_and_push


@pytest.mark.slow
def test_a_compliant_robot_gives_way_further_where_the_thrusters_can_tell_it_from_a_rigid_one(tmp_path: Path):
    runs = [run(RobotToHuman, tmp_path / b, f"behaviour={b}", "propulsion=ideal") for b in ("rigid", "compliant")]
    assert [ended.outcome.success for ended in runs] == [True, True]
    rigid, compliant = (metric(ended, "transfer_displacement_z") for ended in runs)
    assert compliant > 1.3 * rigid
    assert metric(runs[1], "transfer_speed") > 0.08


@pytest.mark.parametrize("place", ["50,-0.07,0", "0.9,0.9,0.9"])
def test_a_place_out_of_reach_is_refused_before_anything_is_written(tmp_path: Path, place: str, wording: Wording):
    with pytest.raises(InvalidParameter) as refused:
        run(RobotToHuman, tmp_path / "r", f"p_WG_handover={place}")
    wording.check(refused.value)
    assert not (tmp_path / "r").exists()


@pytest.mark.paper
@pytest.mark.parametrize("scenario", HANDOVERS_OF.values())
@pytest.mark.parametrize("behaviour", ["rigid", "compliant"])
def test_ten_of_ten_handovers_succeed(tmp_path: Path, scenario: type[FlyerHandover], behaviour: str):
    ended = [run(scenario, tmp_path / f"{seed}", f"behaviour={behaviour}", seed=seed) for seed in range(10)]
    assert [each.outcome.reason for each in ended if not each.outcome.success] == []


def test_the_plants_step_by_the_rate_of_controllers_that_have_another():
    names = {"decision": "HandoverStateMachine", "impedance": "ImpedanceController", "pose": "PoseController"}
    at_67_5 = {role: f"handover.controllers.free_flyer.published_rate:{name}67" for role, name in names.items()}

    def system(**others: str) -> dict[str, Fraction]:
        given = {**RobotToHuman.units, **others}
        built = RobotToHuman().build(HandoverParameters(), 0, lambda name: fmu(given[name]))
        return {name: unit.period for name, unit in built.units.items()}

    assert set(system().values()) == {Fraction(2, 125)}
    (other,) = set(system(**at_67_5).values())
    assert float(other) == pytest.approx(1 / 67.5, rel=1e-15)
    one = system(pose=at_67_5["pose"])
    assert {one[name] for name in ("thrusters", "robot", "person")} == {Fraction(2, 125)}


def test_a_person_of_nominal_skill_is_the_units_own_and_less_skill_is_worse_in_all():
    person = vars(PersonParams())
    of_skill = {"sight_error", "depth_error", "timing_error", "effort_spread", "haste", "reaction_time"}
    nominal, unskilled = HandoverParameters().traits, HandoverParameters(skill=0.0).traits
    assert {name: nominal[name] for name in of_skill} == {name: person[name] for name in of_skill}
    assert all(unskilled[name] > nominal[name] for name in of_skill)
    assert unskilled["effort_spread"] == pytest.approx(8.0 * float(person["effort_spread"]))


@pytest.mark.parametrize("task", [Task.HUMAN_TO_ROBOT, Task.COLLABORATIVE])
def test_the_scenario_of_any_task_is_that_of_the_task(task: Task):
    for any_task, scenario in HANDOVERS_OF.items():
        given = TaskParameters(task=any_task)
        assert HandoverOfTask().stop_time(given) == scenario().stop_time(given)
        assert HandoverOfTask().evaluator(given).receivers == scenario.receivers
    p, own = TaskParameters(task=task), HANDOVERS_OF[task]
    units = [s.build(p, 3, lambda name: fmu(RobotToHuman.units[name])).units for s in (HandoverOfTask(), own())]
    starts = [{f"{n}.{k}": np.array(v).tolist() for n, unit in u.items() for k, v in unit.start.items()} for u in units]
    assert starts[0] == starts[1]


def test_a_robot_that_verifies_has_time_for_as_many_deliveries_as_it_attempts():
    scenario, p = RobotToHuman(), HandoverParameters(verify=True)
    attempts = DecisionParams().attempts
    assert scenario.stop_time(p) >= attempts * p.patience
    assert scenario.stop_time(HandoverParameters()) < attempts * p.patience
