"""One run for each cause of a failed handover, in which that goes wrong, and the cause that the verdict names."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path

import pytest
from flyer_runs import metric, run

import handover
from handover.scenarios.free_flyer.handover.handovers import RobotToHuman
from handover.scenarios.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.free_flyer.parameters import HandoverParameters

GIVES, RECEIVES, BOTH = "flyer_robot_to_human", "flyer_human_to_robot", "flyer_collaborative"
NOBODY = {"person.motion": "none"}
SLIPPERY = {"person.grip_force_max": 0.01}
ASIDE = {"sight_error": 0.1, "depth_error": 0.0, "patience": 20.0}


@dataclass(frozen=True)
class Staged:
    """A run, and words of the reason that its verdict gives."""

    cause: Cause
    words: str
    scenario: str = GIVES
    parameters: Mapping[str, float | bool | str] = field(default_factory=dict[str, float | bool | str])
    seed: int = 0


STAGED = (
    Staged(Cause.NONE, "the person had the object"),
    Staged(
        Cause.NOT_FETCHED,
        "found nothing in it: the object was 150 mm from its fingers",
        parameters={"model_arm_factor": 1.5},
    ),
    Staged(Cause.OUT_OF_REACH, "came no nearer than", RECEIVES, {"patience": 3.0}),
    Staged(Cause.MISSED_BY_HAND, "the last of 3 times", parameters=ASIDE, seed=1),
    Staged(Cause.PUSHED_BESIDE, "the push went past the gripper", RECEIVES, ASIDE, seed=1),
    Staged(Cause.NOT_FELT, "stayed below the threshold", parameters={"strength": 0.2, "patience": 20.0}),
    Staged(Cause.NOT_TRIED, "the person did not pull", parameters={**NOBODY, "patience": 20.0}),
    Staged(Cause.BUMPED, "which bumped the object", parameters={"skill": 0.0}),
    Staged(
        Cause.RELEASED_UNHELD,
        "nobody had pulled, but it saw its gripper move at",
        parameters={**NOBODY, "gated": False, "decision.gate_error": 0.2},
    ),
    Staged(Cause.LET_GO_EARLY, "before the fingers closed", RECEIVES, {"person.haste": 1.0}),
    Staged(
        Cause.RECEPTIONS_FAILED,
        "gave up after 5 failed receptions",
        "flyer_failed_reception",
        {"person.motion_again": "push"},
    ),
    Staged(
        Cause.SLIPPED,
        "was lost at",
        parameters={**SLIPPERY, "person.object_mass": 2.0, "person.centring_time": 100.0},
    ),
    Staged(Cause.TORN_OUT, "torn out of the closed gripper", parameters=SLIPPERY),
    Staged(
        Cause.DELIVERIES_FAILED,
        "still held what it had released",
        parameters={"skill": 0.0, "verify": True, "decision.attempts": 1},
        seed=9,
    ),
    Staged(
        Cause.NOT_SETTLED,
        "never at rest and aligned there",
        parameters={"navigation.velocity_bias": 0.016, "patience": 20.0},
    ),
    Staged(
        Cause.NOT_RETREATED,
        "changed hands, but then the robot gave up in phase RETREAT",
        RECEIVES,
        {"navigation.velocity_bias": 0.004, "patience": 30.0},
    ),
    Staged(Cause.OTHER, "0 failed receptions where 1 was staged", "flyer_failed_reception", {"person.motion": "give"}),
)


@pytest.mark.parametrize("staged", STAGED, ids=lambda staged: staged.cause.name.lower())
def test_the_verdict_names_what_was_staged_to_go_wrong(tmp_path: Path, staged: Staged):
    ended = handover.run(
        staged.scenario, seed=staged.seed, parameters=dict(staged.parameters), out=tmp_path / "r", report=False
    )
    assert Cause(int(ended.metrics["decided_by"])) is staged.cause, ended.reason
    assert staged.words in ended.reason
    assert ended.success is (staged.cause is Cause.NONE)


class CutShort(RobotToHuman):
    """A handover that ends before the robot is at its place."""

    def stop_time(self, parameters: HandoverParameters) -> Fraction:  # noqa: ARG002
        """Return a time in the middle of the flight."""
        return Fraction(20)


def test_a_run_that_is_cut_short_is_out_of_time(tmp_path: Path):
    ended = run(CutShort, tmp_path / "r")
    assert Cause(int(metric(ended, "decided_by"))) is Cause.OUT_OF_TIME
    assert "stopped at 20.0 s in phase MOVE_TO_HANDOVER" in ended.outcome.reason


def test_every_cause_is_staged():
    assert {staged.cause for staged in STAGED} | {Cause.OUT_OF_TIME} == set(Cause)


def test_a_miss_that_was_made_good_is_not_why_a_later_push_was_not_felt(tmp_path: Path):
    """The hand closes twice beside the object before it takes it, and then gives it back too weakly."""
    weak = {"sight_error": 0.035, "depth_error": 0.0, "person.push_share": 0.05, "patience": 30.0}
    ended = handover.run(BOTH, seed=2, parameters=weak, out=tmp_path / "r", report=False)
    assert ended.metrics["misses"] == 2
    assert "transfer_time" in ended.metrics
    assert Cause(int(ended.metrics["decided_by"])) is Cause.NOT_FELT, ended.reason
