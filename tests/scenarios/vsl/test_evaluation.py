from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from support.scenarios.made_signals import made_signals

from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.vsl.arms import unlike_lengths
from handover.scenarios.vsl.evaluation import PathEvaluator, distance_to_path
from handover.scenarios.vsl.parameters import HybridParameters, Parameters
from handover.scenarios.vsl.path_experiments import PathExperiment

UP = np.array([0.0, 0.0, 1.0])


def signals(
    goal: float,
    *,
    at: float | None = None,
    below: float = 0.02,
    segment: int = 1,
    done: bool = False,
    outside: bool = False,
    lowest: float = 0.04,
) -> Signals:
    """Return a goal at x = goal and a tip `below` the point at x = at; servos are 1 mm off, the tracker 0.5 mm."""
    entries, reached = (np.array([x, 0.0, 0.1]) for x in (goal, goal if at is None else at))
    tip = reached - below * UP
    planner = {"p_WG_goal": entries, "moving": segment > 0 and not done, "done": done, "segment": segment}
    arm = {"p_WG": tip + 0.0005 * UP, "p_WG_meas": tip, "shape": np.array([0.0 * UP, 0.15 * UP, lowest * UP])}
    kinematics = {"p_WG_model": reached - 0.001 * UP, "p_WG_est": tip + 0.003 * UP, "outside": outside}
    return made_signals({"planner": planner, "arm": arm, "kinematics": kinematics})


def follow(evaluator: PathEvaluator, *moments: Signals) -> PathEvaluator:
    for k, seen in enumerate(moments):
        evaluator(0.02 * k, seen)
    return evaluator


def path(*below: float, outside: bool = False) -> list[Signals]:
    """Return a run along points 1 cm apart; the tip is below each of them by so much when it is left."""
    x = [0.3 + 0.01 * k for k in range(len(below) + 1)]
    begun = [signals(x[0], segment=0), signals(x[1], at=x[0], below=0.5)]
    between = [signals(x[k + 1], at=x[k], below=below[k - 1], outside=outside) for k in range(1, len(below))]
    return [*begun, *between, signals(x[-1], done=True, below=below[-1])]


def test_a_point_counts_when_it_is_left_not_while_the_arm_is_on_its_way():
    evaluator = follow(PathEvaluator(Parameters(), hybrid=False), *path(0.01, 0.02, 0.06))
    assert [p.error for p in evaluator.points] == pytest.approx([0.01, 0.02, 0.06])
    assert [p.desired[0] for p in evaluator.points] == pytest.approx([0.31, 0.32, 0.33])


def test_errors_are_those_of_the_points():
    metrics = follow(PathEvaluator(Parameters(), hybrid=False), *path(0.01, 0.02, 0.06, 0.03, 0.05)).outcome().metrics
    values = {name: m.value for name, m in metrics.items()}
    assert values["mean_error"] == pytest.approx(0.034)
    assert values["median_error"] == pytest.approx(0.03)
    assert values["error_p25"] == pytest.approx(0.02)
    assert values["error_p75"] == pytest.approx(0.05)
    assert values["max_error"] == pytest.approx(0.06)
    assert values["mean_error_true"] == pytest.approx(0.0335)
    assert values["error_near"] == pytest.approx(0.01)
    assert values["error_far"] == pytest.approx(0.05)
    assert values["path_distance"] == pytest.approx(0.034)
    assert values["path_time"] == pytest.approx(0.1)
    assert "estimate_error" not in values
    units = {"path_time": "s", "points_visited": "1"}
    assert {name: m.unit for name, m in metrics.items()} == {name: units.get(name, "m") for name in metrics}


def test_a_completed_path_within_the_tolerance_succeeds():
    evaluator = follow(PathEvaluator(Parameters(tolerance=0.04), hybrid=False), *path(0.03, 0.04))
    assert evaluator.over
    outcome = evaluator.outcome()
    assert outcome.success
    assert "mean error of the tip 35.0 mm, within the tolerance of 40.0 mm" in outcome.reason


def test_a_completed_path_with_a_mean_error_above_the_tolerance_fails():
    outcome = follow(PathEvaluator(HybridParameters(), hybrid=True), *path(0.004, 0.008)).outcome()
    assert not outcome.success
    assert "mean error of the tip 6.0 mm, above the tolerance of 5.0 mm" in outcome.reason


def test_a_path_that_was_cut_short_fails_and_says_how_far_it_came():
    evaluator = follow(PathEvaluator(Parameters(), hybrid=False), *path(0.01, 0.01, 0.01)[:-1])
    assert not evaluator.over
    outcome = evaluator.outcome()
    assert not outcome.success
    assert "stopped at 0.1 s in segment 1 of the path, 2 of the path's 200 points visited" in outcome.reason
    assert "path_time" not in outcome.metrics


def test_a_path_that_never_began_fails_without_errors():
    outcome = follow(PathEvaluator(Parameters(), hybrid=False), signals(0.3, segment=0)).outcome()
    assert not outcome.success
    assert outcome.reason == "stopped at 0.0 s, before the path began"
    assert not outcome.metrics


def test_points_that_fell_between_two_periods_are_reported():
    metrics = follow(PathEvaluator(Parameters(points=2), hybrid=False), *path(0.01, 0.02, 0.03)).outcome().metrics
    assert metrics["points_visited"].value == 3
    assert metrics["points_visited"].description.startswith("points visited of the path's 4; the others fell between")
    metrics = follow(PathEvaluator(Parameters(points=1), hybrid=False), *path(0.01, 0.02)).outcome().metrics
    assert metrics["points_visited"].description == "points visited of the path's 2"


def test_links_below_the_ground_are_reported():
    above = follow(PathEvaluator(Parameters(), hybrid=False), *path(0.01, 0.02)).outcome()
    assert above.metrics["lowest"].value == pytest.approx(0.04)
    assert "ground" not in above.reason
    assert above.success
    below = follow(
        PathEvaluator(Parameters(), hybrid=False), signals(0.3, segment=0, lowest=-0.0421), *path(0.01, 0.02)
    )
    assert below.outcome().metrics["lowest"].value == pytest.approx(-0.0421)
    assert below.outcome().reason.endswith("the links dipped 42.1 mm below it")
    assert not below.outcome().success


def test_errors_that_round_to_the_tolerance_are_told_with_more_digits():
    reason = follow(PathEvaluator(HybridParameters(), hybrid=True), *path(0.005, 0.00508)).outcome().reason
    assert "mean error of the tip 5.040 mm, above the tolerance of 5.000 mm" in reason


def test_the_hybrid_reports_its_forward_model_and_of_extrapolation():
    evaluator = follow(PathEvaluator(HybridParameters(), hybrid=True), *path(0.003, 0.003, outside=True))
    metrics = evaluator.outcome().metrics
    assert metrics["estimate_error"].value == pytest.approx(0.0025)
    assert metrics["model_error"].value == pytest.approx(0.0015)  # 2.5 mm below the point, taken to be 1 mm below it
    assert metrics["servo_error"].value == pytest.approx(0.001)
    assert metrics["outside"].value == 0.5


@pytest.mark.parametrize(("load", "load_steps", "share"), [(0.075, "", 0.0), (0.2, "", 1.0), (0.075, "0:0.2", 1.0)])
def test_loads_beyond_the_training_are_extrapolation(load: float, load_steps: str, share: float):
    parameters = HybridParameters(load=load, load_steps=load_steps)
    outcome = follow(PathEvaluator(parameters, hybrid=True), *path(0.003, 0.003)).outcome()
    assert outcome.metrics["outside"].value == share
    assert ("with 200 g, and was trained up to 130 g" in outcome.reason) == (share > 0.0)


def test_links_that_the_controllers_take_for_others_are_named():
    system = System()
    for name, unit in PathExperiment.units.items():
        system.add(name, cached(unit, 3))
    system.units["arm"] = replace(system.units["arm"], start={"L_2": 0.3})
    text = unlike_lengths(system.units)
    assert text.count("0.225 m") == 2
    assert "L_2 of the arm was 0.3 m" in text
    for name in ("planner", "kinematics"):
        system.units[name] = replace(system.units[name], start={"L_2": 0.3})
    assert unlike_lengths(system.units) == ""
    assert unlike_lengths({}) == ""


def test_distance_to_a_path_is_to_its_nearest_leg_or_corner():
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0]])
    assert distance_to_path(np.array([0.4, 0.3, 0.0]), corners) == pytest.approx(0.3)
    assert distance_to_path(np.array([1.3, 0.0, -0.4]), corners) == pytest.approx(0.5)
    assert distance_to_path(np.array([0.9, 0.0, 0.6]), corners) == pytest.approx(0.1)


def test_kinematics_that_only_command_are_judged_without_their_own_view_of_the_tip():
    class Short(Signals):
        def __init__(self, full: Signals) -> None:
            self.full = full

        def __contains__(self, name: object) -> bool:
            return not str(name).startswith("kinematics.")

        def __getitem__(self, name: str) -> NDArray[Any]:
            if name not in self:
                raise KeyError(name)
            return self.full[name]

    moments = path(0.01, 0.02, 0.03)
    full = follow(PathEvaluator(Parameters(), hybrid=True), *moments).outcome()
    short = follow(PathEvaluator(Parameters(), hybrid=True), *map(Short, moments)).outcome()
    assert short.reason == full.reason
    lacking = {"servo_error", "model_error", "estimate_error", "outside"}
    assert lacking <= set(full.metrics)
    assert short.metrics == {name: metric for name, metric in full.metrics.items() if name not in lacking}
