import itertools
import math

import numpy as np
import pytest

from handover.controllers.ir_grasp.visibility import Action, Motion, Recovery, Visibility, displaced

STEP, CLOSING, LEAST = 0.010, 0.05, 0.002


def recovery() -> Recovery:
    return Recovery(STEP, CLOSING, LEAST)


@pytest.mark.parametrize(
    ("case", "action", "moved"),
    [
        (Visibility.NONE, Action.FORWARD, (0.0, STEP, 0.0, 0.0)),
        (Visibility.THUMB, Action.TO_THUMB, (STEP, 0.0, 0.0, 0.0)),
        (Visibility.INDEX, Action.FORWARD, (0.0, STEP, 0.0, 0.0)),
        (Visibility.RING, Action.BACK, (0.0, -STEP, 0.0, 0.0)),
        (Visibility.INDEX_RING, Action.TO_FINGERS, (-STEP, 0.0, 0.0, 0.0)),
        (Visibility.THUMB_INDEX, Action.FORWARD, (0.0, STEP, 0.0, 0.0)),
        (Visibility.THUMB_RING, Action.CLOSE, (0.0, 0.0, 0.0, CLOSING)),
    ],
)
def test_each_case_leads_to_its_action_in_the_hands_axes(case: Visibility, action: Action, moved: tuple[float, ...]):
    motion = recovery().motion(case, may_close=True)
    assert motion == Motion(action, CLOSING if action is Action.CLOSE else STEP)
    x = (0.1, 0.2, math.pi / 2.0, 0.3)  # the hand looks along y
    assert np.subtract(displaced(x, motion), x) == pytest.approx(moved)
    no_more = recovery().motion(case, may_close=False)
    assert no_more == (Motion(Action.FORWARD, STEP) if action is Action.CLOSE else motion)


def test_an_object_that_is_seen_by_one_side_then_the_other_is_approached_instead_of_swung_about():
    r = recovery()
    made = [r.motion(case, may_close=True) for case in [Visibility.INDEX_RING, Visibility.THUMB] * 4]
    assert made[0] == Motion(Action.TO_FINGERS, STEP)
    assert [m.action for m in made[1:]] == [Action.FORWARD] * 7
    r, twice = recovery(), [Visibility.INDEX_RING, Visibility.THUMB, Visibility.THUMB] * 5
    sizes = [m.size for m in (r.motion(case, may_close=True) for case in twice) if m.action is Action.TO_THUMB]
    assert (sizes[0], sizes[-1]) == (STEP / 2, LEAST)  # halved after each reversal


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
    r, cases = recovery(), (Visibility.RING, Visibility.INDEX, Visibility.RING)
    actions = [r.motion(case, may_close=True).action for case in cases]
    assert actions == [Action.BACK, Action.TO_FINGERS, Action.TO_FINGERS]


def test_an_object_that_is_not_in_sight_is_approached_by_whole_steps():
    r = recovery()
    for _ in range(4):
        r.motion(Visibility.RING, may_close=True)
        assert r.motion(Visibility.NONE, may_close=True) == Motion(Action.FORWARD, STEP)


def test_a_recovery_goes_on_from_its_state():
    r, other = recovery(), recovery()
    for case in (Visibility.INDEX_RING, Visibility.THUMB):
        r.motion(case, may_close=True)
    other.set_state(r.get_state())
    for case in (Visibility.INDEX_RING, Visibility.RING, Visibility.INDEX, Visibility.THUMB):
        assert other.motion(case, may_close=True) == r.motion(case, may_close=True)
