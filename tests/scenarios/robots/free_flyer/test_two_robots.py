"""Two robots, a large object and a person with two hands, on the built FMUs."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.flyer_runs import fmu, metric, run
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.plants.free_flyer.large_object.parameters import Params as LargeObjectParams
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.robots.free_flyer.parameters import Hands, TeamParameters, TeamTask
from handover.scenarios.robots.free_flyer.two_robots.team_evaluation import OneRobot, TeamCause, TeamEvaluator
from handover.scenarios.robots.free_flyer.two_robots.two_robots import TwoRobots


def cause(metrics: float) -> TeamCause:
    return TeamCause(int(metrics))


@pytest.mark.slow
def test_a_person_gives_a_large_object_to_two_compliant_robots(tmp_path: Path):
    done = run(TwoRobots, tmp_path / "run", "task=human_to_robots", "behaviour=compliant", seed=1)
    assert done.outcome.success, done.outcome.reason
    assert metric(done, "squeeze") < 0.5
    assert metric(done, "turn") < 0.1


@pytest.mark.slow
def test_by_themselves_grippers_let_go_one_after_the_other(tmp_path: Path):
    """A hand at one end draws one gripper sooner than the other; the team's mean decides for both."""
    done = run(TwoRobots, tmp_path / "run", "hands=one_at_end", "together=false", stop=37.0)
    assert metric(done, "release_gap") > 0.1


@pytest.mark.slow
def test_robots_that_verify_a_slow_release_give_a_large_object_to_a_person_and_do_not_disturb_it(tmp_path: Path):
    """At the published thresholds they coast on into the object, see the failures below."""
    done = run(TwoRobots, tmp_path / "run", "verify=true", "strength=1", "decision.release_velocity=0.011")
    assert done.outcome.success, done.outcome.reason
    assert metric(done, "failed_deliveries") == metric(done, "release_gap") == 0.0
    assert metric(done, "squeeze") < 0.5
    assert metric(done, "turn") < 0.1
    assert metric(done, "clearance") > 0.03


ONE_AT_END = ("task=human_to_robots", "hands=one_at_end", "decision.attempts=1")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("given", "stop", "why", "metric_of_it"),
    [
        (ONE_AT_END, None, TeamCause.ONE_RECEIVED_ALONE, "failed_receptions"),
        (("verify=true",), 42.0, TeamCause.RAN_INTO_IT, "failed_deliveries"),
    ],
)
def test_a_run_that_fails_says_why(
    given: tuple[str, ...], stop: float | None, why: TeamCause, metric_of_it: str, tmp_path: Path
):
    done = run(TwoRobots, tmp_path / "run", *given, stop=stop)
    assert not done.outcome.success
    assert cause(metric(done, "decided_by")) is why, done.outcome.reason
    assert metric(done, metric_of_it) >= (why is TeamCause.ONE_RECEIVED_ALONE)


@pytest.mark.slow
def test_robots_that_do_not_come_to_rest_tell_how_far_from_their_places_they_were(tmp_path: Path):
    noise = (f"navigation_{i}.velocity_noise=0.03" for i in (1, 2))
    done = run(TwoRobots, tmp_path / "run", "task=human_to_robots", "patience=14", *noise)
    assert cause(metric(done, "decided_by")) is TeamCause.OUT_OF_REACH, done.outcome.reason
    away = re.findall(r"gripper (\d) was (\d+) mm from its place", done.outcome.reason)
    record = Record(tmp_path / "run" / "signals.parquet")
    half = 0.5 * float(LargeObjectParams().grip_spacing)
    for (number, reported), side in zip(away, (half, -half), strict=True):
        phase = f"decision.phase_{number}"
        given_up = {words: code for code, words in record.items(phase).items()}["GIVEN_UP"]
        gave_up = np.flatnonzero(record[phase] == given_up)[0]
        place = TeamParameters().p_WG_handover + np.array([0.0, side, 0.0])
        away_by_record = float(np.linalg.norm(record[f"robot_{number}.p_WG"][gave_up] - place))
        assert float(reported) == pytest.approx(1e3 * away_by_record, abs=1.0)


def test_a_run_is_drawn_with_its_moments_and_curves(tmp_path: Path, sketches: Sketches):
    run(TwoRobots, tmp_path / "run", "hands=one_at_middle", stop=0.3)
    parameters = parse_parameters(TwoRobots, ("hands=one_at_middle",))
    record, evaluator = Record(tmp_path / "run" / "signals.parquet"), TeamEvaluator(parameters)
    evaluator.robots[0].signalled, evaluator.robots[1].felt = 0.1, 0.2
    TwoRobots().draw(parameters, evaluator, record, tmp_path)
    titles = [axes.get_title().partition("\n")[0] for axes in sketches["scene"].axes]
    assert titles[:4] == ["0.0 s, start", "0.1 s, signal", "0.2 s, pull felt", "0.3 s, end"]
    plots = [plot for figure in TwoRobots().time_figures(parameters, record) for plot in figure.plots]
    assert len({plot.title for plot in plots}) == len(plots)
    assert not any("hand 2" in curve.label for plot in plots for curve in plot.curves)


@pytest.mark.parametrize("given", [{"hand_track": "a.csv"}, {"p_WG_handover": np.array([1.0, 0.9, 0.0])}])
def test_a_track_for_one_hand_and_a_place_out_of_reach_are_refused(given: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidParameter) as refused:
        TwoRobots().build(TeamParameters(**given), 0, lambda name: fmu(TwoRobots.units[name]))
    wording.check(refused.value)


def judged(task: TeamTask, grippers: int, hands: int, *phases: str, hand: Hands = Hands.TWO) -> TeamEvaluator:
    """Return an evaluator of a run that ended with who holds the object, and each robot's last two phases."""
    evaluator = TeamEvaluator(TeamParameters(task=task, hands=hand))
    for robot, ended in zip(evaluator.robots, phases, strict=True):
        before, _, last = ended.rpartition(" ")
        robot.phases = [(phase, 1.0) for phase in (before, last) if phase]
    evaluator._grippers, evaluator._hands = grippers, hands  # type: ignore
    evaluator._most_hands = hands  # type: ignore
    return evaluator


@pytest.mark.parametrize(
    ("evaluator", "why"),
    [
        (judged(TeamTask.ROBOTS_TO_HUMAN, 0, 1, "DONE", "DONE"), TeamCause.ONE_HAND_HELD),
        (judged(TeamTask.HUMAN_TO_ROBOTS, 0, 3, "CHECK_ANGLE GIVEN_UP", "DONE"), TeamCause.RECEPTIONS_FAILED),
        (judged(TeamTask.ROBOTS_TO_HUMAN, 0, 3, "RETREAT", "RETREAT"), TeamCause.OUT_OF_TIME),
    ],
)
def test_a_failure_says_what_was_wrong(evaluator: TeamEvaluator, why: TeamCause):
    outcome = evaluator.outcome()
    assert not outcome.success
    assert cause(outcome.metrics["decided_by"].value) is why


def test_a_gripper_that_loses_the_object_while_it_is_closed_had_it_torn_out():
    robot = OneRobot()
    robot.hold(True, True, 1.0)
    robot.hold(False, True, 2.0)
    assert (robot.let_go, robot.torn) == (2.0, 2.0)
    robot.hold(True, True, 3.0)
    robot.hold(False, False, 4.0)
    assert (robot.let_go, robot.torn) == (4.0, 2.0)
