"""The scenario `vsl_pick_and_place`: an object is carried to its place, touched more softly by softer links."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.kept_runs import kept_run
from support.scenarios.flyer_runs import metric, run
from support.wording import Wording

from handover.controllers.vsl.pick_and_place import Params, TaskPhase
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.cosim.system.system import PlacedUnit
from handover.fmus.build import cached
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.robots.vsl.path_experiments import VslModelBased
from handover.scenarios.robots.vsl.penetration import start_faults
from handover.scenarios.robots.vsl.pick_and_place import VslPickAndPlace
from handover.scenarios.robots.vsl.pick_and_place_evaluation import PickAndPlaceEvaluator, PickAndPlaceParameters
from handover.scenarios.runs.execution.unit_values import built_system


def test_the_planner_has_the_defaults_of_the_scenario():
    names = {"pick": "p_WP", "place": "p_WQ", "speed": "V", "contact_speed": "V_contact"}
    names |= {"contact_pressure": "p_contact", "carry_pressure": "p_carry"}
    names |= {name: name for name in ("hover", "press", "settle", "wait")}
    for ours, theirs in names.items():
        assert np.array_equal(getattr(PickAndPlaceParameters(), ours), getattr(Params(), theirs)), ours


@pytest.mark.parametrize(
    "given",
    [
        {"place": np.array([0.36, 0.0, 0.1])},
        {"pick": np.array([0.3, 0.0, -0.05])},
        {"place": PickAndPlaceParameters().pick},
        {"pick": np.array([0.9, 0.0, 0.06])},
    ],
    ids=["heights", "below", "same", "far"],
)
def test_places_that_contradict_each_other_are_refused(given: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidParameter) as refused:
        VslPickAndPlace().build(PickAndPlaceParameters(**given), 0, Path)
    wording.check(refused.value)


@cache
def arm_in(scenario: Any) -> PlacedUnit:
    fmus = {name: cached(unit, 3) for name, unit in scenario.units.items()}
    return built_system(scenario(), scenario.parameters_type(), 0, fmus, {}).units["arm"]


@pytest.mark.parametrize(
    ("scenario", "start", "faults"),
    [
        (VslModelBased, {"q_0": [0.0, -0.73, 1.0]}, 0),  # of sin(-0.7297) = -0.150 / 0.225
        (VslModelBased, {"q_0": [0.0, -0.8411, 1.6821]}, 1),
        (VslModelBased, {"q_0": [0.0, 0.0, -0.9]}, 1),
        (VslModelBased, {"q_0": [0.0, 0.0, -0.9], "L_3": 0.15}, 0),
        (VslModelBased, {"L_1": 0.0, "q_0": [0.0, -1.0, -0.5]}, 2),
        (VslPickAndPlace, {"q_0": [0.0, 0.0, -0.5]}, 1),
    ],
)
def test_an_arm_that_starts_too_low_is_refused(scenario: Any, start: dict[str, Any], faults: int, wording: Wording):
    arm = arm_in(scenario)
    found = start_faults({"arm": replace(arm, start={**arm.start, **start})}, elbow=True)
    assert len(found) == faults
    for fault in found:
        wording.check(fault)


@pytest.mark.parametrize(
    ("scenario", "given", "values"),
    [
        (VslPickAndPlace, [], {"gripper.p_WO_0": "0.3,0,0.2"}),
        (VslPickAndPlace, [], {"arm.q_0": "0,-0.8411,1.6821"}),
        (VslModelBased, ["elbow=down"], {"arm.q_0": "0,0,-0.9"}),
    ],
    ids=["object", "elbow", "tip"],
)
def test_no_run_starts_in_the_ground_or_the_object(
    scenario: Any, given: list[str], values: dict[str, str], wording: Wording
):
    fmus = {name: cached(unit, 3) for name, unit in scenario.units.items()}
    with pytest.raises(InvalidParameter) as refused:
        built_system(scenario(), parse_parameters(scenario, given), 0, fmus, values)
    wording.check(refused.value)
    built_system(scenario(), parse_parameters(scenario, given), 0, fmus, {})  # an elbow that points down is not a fault


@pytest.mark.slow
def test_it_carries_an_object_to_its_place_and_touches_more_softly_with_softer_links(tmp_path: Path):
    folder = kept_run("run", "vsl_pick_and_place", "--no-report")
    soft = json.loads((folder / "summary.json").read_text())
    stiff = run(VslPickAndPlace, tmp_path / "stiff", "contact_pressure=2e5", "settle=1", "wait=0.3")
    assert soft["success"], soft["reason"]
    figures = {name: value["value"] for name, value in soft["metrics"].items()}
    assert figures["place_error"] < 0.005
    assert 0.1 < figures["pick_force"] < metric(stiff, "pick_force")
    assert figures["carry_error"] < 0.01
    record = Record(folder / "signals.parquet")
    phase, held, pressure = record["planner.phase"], record["gripper.held"], record["arm.p_meas"][:, 0]
    assert not held[phase < TaskPhase.GRASP].any()
    assert held[phase == TaskPhase.CARRY].all()
    assert pressure[phase == TaskPhase.CARRY].min() > 1.8e5
    assert pressure[phase == TaskPhase.LOWER].max() < 0.6e5


def seen(phase: int, p_WO: Floats, **changes: Any) -> Any:
    """Return what the evaluator sees while the gripper holds the object at the tip, which is at its goal."""
    arm = {"arm.f_G": 0.0, "arm.p_WG": p_WO, "gripper.held": True, "gripper.p_WO": p_WO}
    planner = {"planner.phase": phase, "planner.done": phase == TaskPhase.DONE, "planner.p_WG_goal": p_WO}
    return arm | planner | {name.replace("__", "."): value for name, value in changes.items()}


def test_a_tip_that_carries_is_compared_with_the_goal_that_it_was_to_reach():
    evaluator = PickAndPlaceEvaluator(PickAndPlaceParameters())

    def at(phase: int, goal: float, tip: float) -> Any:
        return seen(phase, np.array([tip, 0.0, 0.1]), planner__p_WG_goal=np.array([goal, 0.0, 0.1]))

    for k in range(1, 5):
        evaluator(0.04 * k, at(TaskPhase.CARRY, 0.002 * k, 0.002 * (k - 1)))
        evaluator(0.04 * k + 0.02, at(TaskPhase.CARRY, 0.002 * k, 0.002 * (k - 0.5)))  # half the way
    assert evaluator.carried_off == pytest.approx(0.0, abs=1e-12)
    evaluator(0.2, at(TaskPhase.SOFTEN, 0.008, 0.007))
    assert evaluator.carried_off == pytest.approx(0.001)
    evaluator(0.22, at(TaskPhase.SOFTEN, 0.008, 0.1))
    assert evaluator.carried_off == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("force", "phase", "dragged"),
    [(0.0, TaskPhase.CARRY, 0.0), (0.5, TaskPhase.LOWER, 0.0), (0.5, TaskPhase.CARRY, 0.06)],
)
def test_an_object_that_is_dragged_to_its_place_is_not_placed(force: float, phase: int, dragged: float):
    parameters = PickAndPlaceParameters()
    evaluator, pick, place = PickAndPlaceEvaluator(parameters), np.array(parameters.pick), np.array(parameters.place)
    for k in range(11):
        evaluator(0.1 * k, seen(phase, pick + k / 10 * (place - pick), arm__f_G=force))
    evaluator(2.0, seen(TaskPhase.DONE, place, gripper__held=False))
    outcome = evaluator.outcome()
    assert outcome.success is (dragged == 0.0)
    assert outcome.metrics["dragged"].value == pytest.approx(dragged)
    wanted = "it came down too early and was dragged over 60 mm of the table, above the tolerance of 10 mm"
    assert outcome.success or outcome.reason.endswith(wanted)
    never = PickAndPlaceEvaluator(parameters)
    for t, at in ((0.0, TaskPhase.CARRY), (2.0, TaskPhase.DONE)):
        never(t, seen(at, pick, gripper__held=False))
    assert (never.outcome().success, never.outcome().reason) == (False, "the object was never picked up")


@pytest.mark.parametrize(("mass", "asked", "share"), [(0.3, False, 1.0), (0.13, False, 0.0), (0.13, True, 1.0)])
def test_a_load_beyond_the_training_is_extrapolation_while_it_is_held(mass: float, asked: bool, share: float):
    evaluator = PickAndPlaceEvaluator(PickAndPlaceParameters(mass=mass))
    for k, phase in enumerate((TaskPhase.DESCEND, TaskPhase.GRASP, TaskPhase.LIFT, TaskPhase.CARRY)):
        changes = {"gripper__held": k > 0, "kinematics__outside": asked}
        evaluator(0.1 * k, seen(phase, np.array([0.3, 0.0, 0.1]), **changes))
    outcome = evaluator.outcome()
    assert outcome.metrics["outside"].value == share
    assert ("trained up to 130 g" in outcome.reason) == (mass > 0.13)
    assert ("extrapolate" in outcome.reason) == (share > 0.0)


@pytest.mark.slow
def test_on_a_table_higher_than_the_shoulder_the_arm_starts_above_it(tmp_path: Path):
    run(VslPickAndPlace, tmp_path / "r", "pick=0.3,0,0.2", "place=0.36,0,0.2", "settle=0.5", stop=0.5)
    record = Record(tmp_path / "r" / "signals.parquet")
    assert record["arm.p_WG"][0, 2] > 0.2
    assert np.all(record["arm.f_G"][record["planner.phase"] == TaskPhase.SETTLE] == 0.0)
