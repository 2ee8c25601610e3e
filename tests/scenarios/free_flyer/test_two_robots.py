"""Two robots, a large object and a person with two hands, on the built FMUs."""

import re
from pathlib import Path

import numpy as np
import pytest
from flyer_runs import metric, run

from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.free_flyer.parameters import Hands, TeamParameters, TeamTask
from handover.scenarios.free_flyer.two_robots.team_evaluation import TeamEvaluator
from handover.scenarios.free_flyer.two_robots.team_member import OneRobot, TeamCause
from handover.scenarios.free_flyer.two_robots.two_robots import TwoRobots


def cause(metrics: float) -> TeamCause:
    return TeamCause(int(metrics))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("task", ["robots_to_human", "human_to_robots"])
def test_the_object_changes_hands(task: str, seed: int, tmp_path: Path):
    done = run(TwoRobots, tmp_path / "run", f"task={task}", seed=seed)
    assert done.summary["success"], done.summary["reason"]
    assert metric(done, "squeeze") < 0.5
    assert metric(done, "turn") < 0.1
    if task == "robots_to_human":
        assert metric(done, "release_gap") == 0.0
        assert metric(done, "clearance") > 0.03


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3, 6))
@pytest.mark.parametrize("propulsion", ["limited", "ideal"])
@pytest.mark.parametrize("task", ["robots_to_human", "human_to_robots"])
def test_the_object_changes_hands_of_compliant_robots(task: str, propulsion: str, seed: int, tmp_path: Path):
    given = (f"task={task}", f"propulsion={propulsion}", "behaviour=compliant")
    done = run(TwoRobots, tmp_path / "run", *given, seed=seed)
    assert done.summary["success"], done.summary["reason"]


@pytest.mark.slow
def test_by_themselves_grippers_let_go_one_after_the_other(tmp_path: Path):
    """A hand at one end draws one gripper sooner than the other; the team's mean decides for both."""
    gaps = [
        metric(run(TwoRobots, tmp_path / given, "hands=one_at_end", f"together={given}"), "release_gap")
        for given in ("true", "false")
    ]
    assert gaps[0] == 0.0
    assert gaps[1] > 0.1


@pytest.mark.slow
def test_one_hand_at_an_end_fills_one_gripper_first(tmp_path: Path):
    """Together, both open again and ask once more; each for itself, the one that has it keeps it."""
    given = ("task=human_to_robots", "hands=one_at_end", "patience=20")
    done = run(TwoRobots, tmp_path / "together", *given)
    assert metric(done, "failed_receptions") > 0.0
    done = run(TwoRobots, tmp_path / "alone", *given, "together=false", seed=1)
    assert cause(metric(done, "decided_by")) is TeamCause.ONE_RECEIVED_ALONE


def test_robots_that_verify_a_slow_release_do_not_disturb_the_person(tmp_path: Path):
    """At the published thresholds they coast on into the object, see the failures below."""
    done = run(TwoRobots, tmp_path / "run", "verify=true", "strength=1", "decision.release_velocity=0.011")
    assert done.summary["success"], done.summary["reason"]
    assert metric(done, "failed_deliveries") == 0.0


_NOISE = tuple(f"navigation_{i}.velocity_noise=0.015" for i in (1, 2))
_ONE_AT_END = ("task=human_to_robots", "hands=one_at_end", "decision.attempts=2")


@pytest.mark.parametrize(
    ("given", "why"),
    [
        (("hand_delay=1",), TeamCause.TORN_OUT),
        (_ONE_AT_END, TeamCause.ONE_RECEIVED_ALONE),
        pytest.param(("strength=0.3", "patience=20"), TeamCause.NOT_FELT, marks=pytest.mark.slow),
        pytest.param(("strength=0.3", "hand_delay=3", "patience=20"), TeamCause.ONE_HAND_HELD, marks=pytest.mark.slow),
        pytest.param(("verify=true",), TeamCause.RAN_INTO_IT, marks=pytest.mark.slow),
        pytest.param(_NOISE, TeamCause.OUT_OF_REACH, marks=pytest.mark.slow),
    ],
)
def test_a_run_that_fails_says_why(given: tuple[str, ...], why: TeamCause, tmp_path: Path):
    done = run(TwoRobots, tmp_path / "run", *given)
    assert not done.summary["success"]
    assert cause(metric(done, "decided_by")) is why, done.summary["reason"]


@pytest.mark.slow
def test_robots_that_do_not_come_to_rest_tell_how_far_from_their_places_they_were(tmp_path: Path):
    done = run(TwoRobots, tmp_path / "run", *_NOISE)
    assert not done.summary["success"]
    away = re.findall(r"gripper (\d) was (\d+) mm from its place", done.summary["reason"])
    record = Record(tmp_path / "run" / "signals.parquet")
    half = 0.5 * float(paper_values("free_flyer", "large_object")["grip_spacing"])
    for (number, told), side in zip(away, (half, -half), strict=True):
        phase = f"decision.phase_{number}"
        given_up = {words: code for code, words in record.items(phase).items()}["GIVEN_UP"]
        gave_up = np.flatnonzero(record[phase] == given_up)[0]
        place = TeamParameters().p_WG_handover + np.array([0.0, side, 0.0])
        away_by_record = float(np.linalg.norm(record[f"robot_{number}.p_WG"][gave_up] - place))
        assert float(told) == pytest.approx(1e3 * away_by_record, abs=1.0)


def test_a_run_is_drawn_with_its_moments_and_curves(tmp_path: Path):
    done = run(TwoRobots, tmp_path / "run", "hands=one_at_middle", "patience=1", drawn=True)
    assert not done.summary["success"]
    names = {file.stem for file in (tmp_path / "run" / "figures").glob("*.png")}
    assert names == {"scene", "positions", "orientation", "forces", "grippers", "thrust_1", "thrust_2"}
    parameters = parse_parameters(TwoRobots, ("hands=one_at_middle",))
    record = Record(tmp_path / "run" / "signals.parquet")
    plots = [plot for figure in TwoRobots().time_figures(parameters, record) for plot in figure.plots]
    assert len({plot.title for plot in plots}) == len(plots)
    assert not any("hand 2" in curve.label for plot in plots for curve in plot.curves)
    assert (tmp_path / "run" / "report.html").stat().st_size > 100_000


def test_a_track_leads_no_pair_of_hands():
    with pytest.raises(InvalidParameter, match="hand_track"):
        TwoRobots().build(TeamParameters(hand_track="a.csv"), 0, lambda name: cached(TwoRobots.units[name], 3))


def test_a_place_out_of_reach_is_rejected():
    far = TeamParameters(p_WG_handover=[1.0, 0.9, 0.0])  # type: ignore
    with pytest.raises(InvalidParameter, match="out of the person's reach"):
        TwoRobots().build(far, 0, lambda name: cached(TwoRobots.units[name], 3))


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
