import itertools
import math

import pytest

from handover.controllers.ir_grasp.visibility import RECOVERY, Action, Motion, Recovery, Visibility, displaced

STEP, CLOSING, LEAST = 0.010, 0.05, 0.002


def recovery() -> Recovery:
    return Recovery(STEP, CLOSING, LEAST)


@pytest.mark.parametrize(
    ("case", "action"),
    [
        (Visibility.NONE, Action.FORWARD),
        (Visibility.THUMB, Action.TO_THUMB),
        (Visibility.INDEX, Action.FORWARD),
        (Visibility.RING, Action.BACK),
        (Visibility.INDEX_RING, Action.TO_FINGERS),
        (Visibility.THUMB_INDEX, Action.FORWARD),
        (Visibility.THUMB_RING, Action.CLOSE),
    ],
)
def test_each_case_leads_to_its_action(case: Visibility, action: Action):
    motion = recovery().motion(case, may_close=True)
    assert motion == Motion(action, CLOSING if action is Action.CLOSE else STEP)


def test_there_are_seven_cases_and_five_actions():
    assert set(RECOVERY) == set(Visibility) - {Visibility.ALL_SEEN}
    assert set(RECOVERY.values()) == set(Action)


def test_a_case_is_the_sum_of_its_fingers():
    thumb, index, ring = Visibility.THUMB, Visibility.INDEX, Visibility.RING
    assert Visibility(thumb + index) is Visibility.THUMB_INDEX
    assert Visibility(thumb + index + ring) is Visibility.ALL_SEEN


def test_an_object_that_is_seen_by_one_side_then_the_other_is_approached_instead_of_swung_about():
    r = recovery()
    made = [r.motion(case, may_close=True) for case in [Visibility.INDEX_RING, Visibility.THUMB] * 4]
    assert made[0] == Motion(Action.TO_FINGERS, STEP)
    assert [m.action for m in made[1:]] == [Action.FORWARD] * 7


def test_after_a_reversal_the_step_across_is_halved_down_to_the_least():
    r = recovery()
    sizes: list[float] = []
    for case in [Visibility.INDEX_RING, Visibility.THUMB, Visibility.THUMB] * 5:
        motion = r.motion(case, may_close=True)
        if motion.action is Action.TO_THUMB:
            sizes.append(motion.size)
    assert sizes[0] == STEP / 2
    assert sizes[-1] == LEAST


def test_the_limit_cycle_left_left_right_right_makes_its_way_forward():
    r, across, ahead = recovery(), 0.0, 0.0
    cases = [Visibility.INDEX_RING] * 2 + [Visibility.THUMB] * 2
    farthest = 0.0
    for case in itertools.islice(itertools.cycle(cases), 40):
        motion = r.motion(case, may_close=False)
        across += motion.size * {Action.TO_FINGERS: 1, Action.TO_THUMB: -1}.get(motion.action, 0)
        ahead += motion.size * (motion.action is Action.FORWARD)
        farthest = max(farthest, abs(across))
    assert farthest <= 2 * STEP
    assert ahead >= 18 * STEP


def test_back_and_forth_ends_on_the_fingers_side():
    r = recovery()
    assert r.motion(Visibility.RING, may_close=True).action is Action.BACK
    assert r.motion(Visibility.INDEX, may_close=True).action is Action.TO_FINGERS
    assert r.motion(Visibility.RING, may_close=True).action is Action.TO_FINGERS


def test_an_object_that_is_not_in_sight_is_approached_by_whole_steps():
    r = recovery()
    for _ in range(4):
        r.motion(Visibility.RING, may_close=True)
        assert r.motion(Visibility.NONE, may_close=True) == Motion(Action.FORWARD, STEP)


def test_a_hand_that_may_not_close_more_goes_forward():
    assert recovery().motion(Visibility.THUMB_RING, may_close=False) == Motion(Action.FORWARD, STEP)


def test_a_recovery_goes_on_from_its_state():
    r, other = recovery(), recovery()
    for case in (Visibility.INDEX_RING, Visibility.THUMB):
        r.motion(case, may_close=True)
    other.set_state(r.get_state())
    for case in (Visibility.INDEX_RING, Visibility.RING, Visibility.INDEX, Visibility.THUMB):
        assert other.motion(case, may_close=True) == r.motion(case, may_close=True)


@pytest.mark.parametrize(
    ("action", "moved"),
    [
        (Action.FORWARD, (0.0, 0.01, 0.0, 0.0)),
        (Action.BACK, (0.0, -0.01, 0.0, 0.0)),
        (Action.TO_FINGERS, (-0.01, 0.0, 0.0, 0.0)),
        (Action.TO_THUMB, (0.01, 0.0, 0.0, 0.0)),
        (Action.CLOSE, (0.0, 0.0, 0.0, 0.01)),
    ],
)
def test_motions_are_in_the_hands_axes(action: Action, moved: tuple[float, ...]):
    x = (0.1, 0.2, math.pi / 2.0, 0.3)  # the hand looks along y
    got = displaced(x, Motion(action, 0.01))
    assert [b - a for a, b in zip(x, got, strict=True)] == pytest.approx(moved)
