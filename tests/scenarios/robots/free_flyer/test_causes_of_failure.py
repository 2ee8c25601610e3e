"""One run for each cause of a failed handover, in which that goes wrong, and the cause that the verdict names."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from support.scenarios.flyer_runs import metric, run
from support.wording import Wording

from handover.scenarios.robots.free_flyer.handover.handovers import (
    Collaborative,
    FlyerHandover,
    HumanToRobot,
    RobotToHuman,
)
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause, PersonsDeeds

NOBODY = "person.motion=none"
ASIDE = ("sight_error=0.1", "depth_error=0", "patience=20")
UNGATED = (NOBODY, "gated=false", "decision.gate_error=0.2")


@dataclass(frozen=True)
class Staged:
    """A run, and words of the reason that its verdict gives."""

    cause: Cause
    words: str
    parameters: tuple[str, ...]
    scenario: type[FlyerHandover] = RobotToHuman
    seed: int = 0


STAGED = (
    Staged(Cause.NOT_FETCHED, "found nothing in it: the object was 150 mm from its fingers", ("model_arm_factor=1.5",)),
    Staged(Cause.MISSED_BY_HAND, "the last of 3 times", ASIDE, seed=1),
    Staged(Cause.PUSHED_BESIDE, "the push went past the gripper", ASIDE, HumanToRobot, seed=1),
    Staged(Cause.NOT_TRIED, "the person did not pull", (NOBODY, "patience=20")),
    Staged(Cause.BUMPED, "which bumped the object", ("skill=0",)),
    Staged(Cause.RELEASED_UNHELD, "nobody had pulled, but it saw its gripper move at", UNGATED),
    Staged(Cause.LET_GO_EARLY, "before the fingers closed", ("person.haste=1",), HumanToRobot),
)
"""Other causes are tested by staged signals, see test_handover_evaluation.py."""


@pytest.mark.parametrize(
    "staged",
    [pytest.param(s, id=s.cause.name.lower(), marks=pytest.mark.slow if k else ()) for k, s in enumerate(STAGED)],
)
def test_the_verdict_names_what_was_staged_to_go_wrong(tmp_path: Path, staged: Staged):
    ended = run(staged.scenario, tmp_path / "r", *staged.parameters, seed=staged.seed)
    assert Cause(int(metric(ended, "decided_by"))) is staged.cause, ended.outcome.reason
    assert staged.words in ended.outcome.reason
    assert not ended.outcome.success


LED: tuple[tuple[dict[str, Any], str, float | None, Cause], ...] = (
    ({"by_track": True}, "pull", 5.0, Cause.NOT_TRIED),
    ({"by_track": True}, "pull", None, Cause.NOT_TRIED),
    ({"by_track": True, "nearest": 0.5, "tried": True}, "pull", 30.0, Cause.NOT_TRIED),
    ({"nearest": 0.4}, "pull", None, Cause.NOT_TRIED),
    ({"nearest": 0.4}, "push", None, Cause.NOT_TRIED),
)
"""What is known of a hand that is led, what it was to do, when its track ended, and why it did not."""


def test_a_hand_that_is_led_and_did_not_answer_or_opened_too_soon_is_reported(wording: Wording):
    for known, touch, ended, cause in LED:
        found, why = PersonsDeeds(led=True, **known).untouched(touch, 21.0, ended)
        assert found is cause
        wording.check(why)
    for by_track in (True, False):
        found, why = PersonsDeeds(led=True, by_track=by_track, opened=(20.0, 0.51)).dropped(21.0)
        assert found is Cause.LET_GO_EARLY
        wording.check(why)
    assert PersonsDeeds(led=True, opened=(17.0, 0.51)).dropped(21.0)[0] is Cause.SLIPPED


@pytest.mark.slow
def test_a_miss_that_was_made_good_is_not_why_a_later_push_was_not_felt(tmp_path: Path):
    """The hand closes twice beside the object before it takes it, and then gives it back too weakly."""
    weak = ("sight_error=0.035", "depth_error=0", "person.push_share=0.05", "patience=30")
    ended = run(Collaborative, tmp_path / "r", *weak, seed=2)
    assert metric(ended, "misses") == 2
    assert metric(ended, "transfer_time") > 0.0
    assert Cause(int(metric(ended, "decided_by"))) is Cause.NOT_FELT, ended.outcome.reason
