from dataclasses import replace

import numpy as np
import pytest
from support.scenarios.made_signals import made_signals

from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.robots.vsl.arms import unlike_lengths
from handover.scenarios.robots.vsl.evaluation import PathEvaluator, distance_to_path
from handover.scenarios.robots.vsl.parameters import HybridParameters, Parameters
from handover.scenarios.robots.vsl.path_experiments import PathExperiment

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
    seen: bool = True,
) -> Signals:
    """Return a goal at x = goal and a tip `below` the point at x = at; servos are 1 mm off, the tracker 0.5 mm."""
    entries, reached = (np.array([x, 0.0, 0.1]) for x in (goal, goal if at is None else at))
    tip = reached - below * UP
    planner = {"p_WG_goal": entries, "moving": segment > 0 and not done, "done": done, "segment": segment}
    arm = {"p_WG": tip + 0.0005 * UP, "p_WG_meas": tip, "shape": np.array([0.0 * UP, 0.15 * UP, lowest * UP])}
    kinematics = {"p_WG_model": reached - 0.001 * UP, "p_WG_est": tip + 0.003 * UP, "outside": outside}
    return made_signals({"planner": planner, "arm": arm} | ({"kinematics": kinematics} if seen else {}))


def follow(evaluator: PathEvaluator, *moments: Signals) -> PathEvaluator:
    for k, seen in enumerate(moments):
        evaluator(0.02 * k, seen)
    return evaluator


def path(*below: float, outside: bool = False, seen: bool = True) -> list[Signals]:
    """Return a run along points 1 cm apart; the tip is below each of them by so much when it is left."""
    x = [0.3 + 0.01 * k for k in range(len(below) + 1)]
    begun = [signals(x[0], segment=0, seen=seen), signals(x[1], at=x[0], below=0.5, seen=seen)]
    between = [signals(x[k + 1], at=x[k], below=below[k - 1], outside=outside, seen=seen) for k in range(1, len(below))]
    return [*begun, *between, signals(x[-1], done=True, below=below[-1], seen=seen)]


def test_errors_are_those_of_the_points_at_the_times_when_they_are_left():
    evaluator = follow(PathEvaluator(Parameters(), hybrid=False), *path(0.01, 0.02, 0.06, 0.03, 0.05))
    assert [p.error for p in evaluator.points] == pytest.approx([0.01, 0.02, 0.06, 0.03, 0.05])
    assert [p.desired[0] for p in evaluator.points] == pytest.approx([0.31, 0.32, 0.33, 0.34, 0.35])
    metrics = evaluator.outcome().metrics
    wanted = {"mean_error": 0.034, "median_error": 0.03, "error_p25": 0.02, "error_p75": 0.05, "max_error": 0.06}
    wanted |= {"mean_error_true": 0.0335, "error_near": 0.01, "error_far": 0.05, "path_distance": 0.034}
    assert {name: metrics[name].value for name in wanted} == pytest.approx(wanted)
    assert metrics["path_time"].value == pytest.approx(0.1)
    assert "estimate_error" not in metrics
    units = {"path_time": "s", "points_visited": "1"}
    assert {name: m.unit for name, m in metrics.items()} == {name: units.get(name, "m") for name in metrics}


@pytest.mark.parametrize(
    ("parameters", "below", "succeeds", "text"),
    [
        (Parameters(tolerance=0.04), (0.03, 0.04), True, "35.0 mm, within the tolerance of 40.0 mm"),
        (HybridParameters(), (0.004, 0.008), False, "6.0 mm, above the tolerance of 5.0 mm"),
        (HybridParameters(), (0.005, 0.00508), False, "5.040 mm, above the tolerance of 5.000 mm"),
    ],
)
def test_a_completed_path_succeeds_within_the_tolerance(
    parameters: Parameters, below: tuple[float, float], succeeds: bool, text: str
):
    evaluator = follow(PathEvaluator(parameters, hybrid=isinstance(parameters, HybridParameters)), *path(*below))
    assert evaluator.over
    assert evaluator.outcome().success is succeeds
    assert f"mean error of the tip {text}" in evaluator.outcome().reason


def test_a_path_that_was_cut_short_or_never_began_fails_and_says_how_far_it_came():
    evaluator = follow(PathEvaluator(Parameters(), hybrid=False), *path(0.01, 0.01, 0.01)[:-1])
    outcome = evaluator.outcome()
    assert (evaluator.over, outcome.success) == (False, False)
    assert "stopped at 0.1 s in segment 1 of the path, 2 of the path's 200 points visited" in outcome.reason
    assert "path_time" not in outcome.metrics
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
    assert (above.metrics["lowest"].value, above.success) == (pytest.approx(0.04), True)
    assert "ground" not in above.reason
    dipped = signals(0.3, segment=0, lowest=-0.0421)
    below = follow(PathEvaluator(Parameters(), hybrid=False), dipped, *path(0.01, 0.02)).outcome()
    assert (below.metrics["lowest"].value, below.success) == (pytest.approx(-0.0421), False)
    assert below.reason.endswith("the links dipped 42.1 mm below it")


def test_the_hybrid_reports_its_forward_model_and_of_extrapolation():
    evaluator = follow(PathEvaluator(HybridParameters(), hybrid=True), *path(0.003, 0.003, outside=True))
    metrics = evaluator.outcome().metrics
    assert metrics["estimate_error"].value == pytest.approx(0.0025)
    assert metrics["model_error"].value == pytest.approx(0.0015)  # 2.5 mm below the point, taken to be 1 mm below it
    assert metrics["servo_error"].value == pytest.approx(0.001)
    assert metrics["outside"].value == 0.5
    assert "extrapolate at 50 % of the points" in evaluator.outcome().reason


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
    full, short = (
        follow(PathEvaluator(Parameters(), hybrid=True), *path(0.01, 0.02, seen=seen)) for seen in (True, False)
    )
    assert short.outcome().reason == full.outcome().reason
    lacking = {"servo_error", "model_error", "estimate_error", "outside"}
    metrics = full.outcome().metrics
    assert lacking <= set(metrics)
    assert short.outcome().metrics == {name: metric for name, metric in metrics.items() if name not in lacking}
