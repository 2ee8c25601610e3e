"""What goes wrong by a person's errors of sight and timing, and that it does by where things are."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.plants.hand_scene import CALM, DT, GIVING, Scene, called, giving
from support.restored_states import assert_continues

from handover.cosim.blocks.plain_rotation import IDENTITY, ZERO
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.hand_and_object import Activity, HandAndObject, Holder, Inputs, Motion, Params
from handover.plants.free_flyer.hand.sight import Perception, Sight

END = np.array([0.0, 0.07, 0.0])
STRONG: dict[str, Any] = {"effort": 4.0, "arm_force_max": 6.0}


def reaching(**changes: Any) -> Scene:
    """Return a scene in which the gripper holds the object and the person has been called."""
    return called(replace(CALM, motion_again=Motion.NONE, **(STRONG | changes)), Activity.REACH)


def test_errors_of_sight_have_their_deviations_along_and_across_the_line_of_sight():
    line = np.array([0.6, 0.0, 0.8])
    spread: dict[str, Any] = {"sight_error": 0.002, "depth_error": 0.02, "timing_error": 0.1, "effort_spread": 0.2}
    sight, drawn = Sight(Params(line_of_sight=2.0 * line, **spread)), list[tuple[float, ...]]()
    for _ in range(2000):
        sight.begin_attempt()
        drawn.append((*sight.error, sight.lead, sight.strength))
    errors, leads, strengths = np.array(drawn)[:, :3], np.array(drawn)[:, 3], np.array(drawn)[:, 4]
    depth: Floats = errors @ line
    aside: Floats = errors - depth[:, np.newaxis] * line
    assert np.std(depth) == pytest.approx(0.02, rel=0.06)
    assert np.linalg.norm(aside) / math.sqrt(2.0 * len(aside)) == pytest.approx(0.002, rel=0.06)
    assert np.sqrt(np.mean(np.square(leads))) == pytest.approx(0.1, rel=0.06)
    assert min(leads) >= 0.0
    assert np.mean(strengths) == pytest.approx(1.0, abs=0.02)
    assert np.std(strengths) == pytest.approx(0.2, rel=0.06)


def test_a_share_of_the_attempts_is_hasty_and_the_other_errors_are_drawn_as_without_haste():
    sight, calm = Sight(Params(haste=0.3)), Sight(Params())
    hasty: list[bool] = []
    for n in range(1000):
        sight.begin_attempt()
        calm.begin_attempt()
        hasty.append(sight.hasty)
        assert not calm.hasty
        if n == 0:
            assert (sight.error, sight.lead, sight.strength) == (calm.error, calm.lead, calm.strength)
    assert np.mean(hasty) == pytest.approx(0.3, abs=0.04)


def test_the_object_is_seen_late_and_felt_at_once():
    still = Frame(ZERO, IDENTITY)
    poses: dict[str, Any] = {"G": still, "O": still, "p_WH": ZERO, "q_WH": IDENTITY, "p_OH": ZERO, "q_OH": IDENTITY}
    there = Perception(light=False, angle=1.2, gripped=False, held=False, f_H=ZERO, **poses)
    sight = Sight(Params(interface_delay=5 * DT))
    sight.look(DT, there)
    has = replace(there, gripped=True, held=True, angle=0.7, f_H=(1.0, 0.0, 0.0))
    for n in range(1, 8):
        seen = sight.look(DT, has)
        assert seen.held
        assert seen.f_H == (1.0, 0.0, 0.0)
        assert (seen.gripped, seen.angle) == ((True, 0.7) if n >= 6 else (False, 1.2))


def test_fingers_get_the_object_where_they_close_near_enough_and_nowhere_else():
    got: dict[bool, int] = {True: 0, False: 0}
    for seed in range(5):
        scene = reaching(depth_error=0.05, sight_error=0.01, seed=seed, attempts=1)
        closing = scene.until(Activity.PULL)
        x, _, z = closing.p_WH - closing.p_WO - END
        held = scene.go(0.1).holder is Holder.BOTH
        assert held is (math.hypot(x, z) <= 0.04)
        got[held] += 1
    assert min(got.values()) >= 1


def test_a_hand_that_reaches_too_far_bumps_the_object_and_one_that_stops_short_does_not():
    bumps = 0
    for seed in range(6):
        scene = reaching(depth_error=0.03, seed=seed, attempts=1)
        begin = len(scene.seen)
        scene.until(Activity.PULL)
        seen = scene.seen[begin:]
        pushed, felt = max(float(y.f_G[0]) for y in seen), -min(float(y.f_H[0]) for y in seen)
        assert (pushed > 0.3) is (felt > 0.3)
        assert pushed > 0.3 or max(float((y.p_WH - y.p_WO)[0]) for y in seen) < 0.03
        bumps += pushed > 0.3
    assert 1 <= bumps <= 5


def test_a_hand_that_got_nothing_is_felt_and_tries_again_with_other_errors():
    scene = reaching(depth_error=0.4, arm_reach=3.0, seed=2, interface_delay=0.1)
    scene.until(Activity.REST)
    assert scene.activities().count(Activity.REACH) == 3
    assert scene.y.holder is Holder.GRIPPER
    begun = [i for i, y in enumerate(scene.seen) if y.activity is Activity.PULL is not scene.seen[i - 1].activity]
    end = next(i for i in range(begun[0], len(scene.seen)) if scene.seen[i].activity is not Activity.PULL)
    assert (end - begun[0]) * DT == pytest.approx(0.35, abs=1.5 * DT)  # a reaction, though what is seen is late
    assert len({round(float(scene.seen[i].p_WH[0]), 3) for i in begun}) == 3


def test_who_lets_go_before_the_fingers_have_closed_lets_the_object_float():
    early: list[bool] = []
    spread: list[dict[str, Any]] = [{"timing_error": 0.5, "seed": seed} for seed in range(4)]
    for changes in (*spread, {"haste": 1.0}, {"haste": 0.0}):
        both: dict[str, Any] = STRONG | changes
        scene = giving(replace(GIVING, reaction_time=0.1, **both))
        scene.go(0.5)
        scene.until(Activity.LET_GO, closure=1.0)
        early.append(scene.y.gripper_angle > 0.79)
        assert scene.y.holder is (Holder.FREE if early[-1] else Holder.GRIPPER)
    assert 1 <= sum(early[:-2]) <= 3
    assert early[-2:] == [True, False]  # who is hasty lets go as soon as the fingers move


def test_who_pulls_before_the_fingers_hold_leaves_the_object_behind():
    scene = reaching(timing_error=0.0)
    assert scene.until(Activity.WITHDRAW, closure=0.0).holder is Holder.HAND
    hasty = reaching(timing_error=5.0, seed=1, attempts=1, pull_ramp=0.01)
    assert hasty.until(Activity.PULL).finger.max() < 1.4 * 0.1
    assert hasty.go(2.0).holder is Holder.GRIPPER


def test_who_is_hasty_tears_the_object_out_of_a_gripper_that_never_opens():
    """A pull of 4 N is less than the grip's 5 N; the arm that withdraws yields at 6 N."""
    patient, hasty = reaching(), reaching(haste=1.0)
    for scene in (patient, hasty):
        scene.until(Activity.PULL)
        scene.go(4.0)
    assert patient.y.activity is Activity.PULL
    assert patient.y.holder is Holder.BOTH
    pulling = [y for y in hasty.seen if y.activity is Activity.PULL and y.holder is Holder.BOTH]
    assert len(pulling) * DT == pytest.approx(0.35, abs=2.5 * DT)
    assert hasty.y.holder is Holder.HAND
    assert max(y.gripper_angle for y in hasty.seen[-250:]) < 0.8


def test_a_push_that_meets_nothing_is_tried_again_and_the_object_kept():
    scene = Scene(replace(GIVING, motion_again=Motion.NONE, sight_error=0.5, seed=3, arm_reach=5.0, **STRONG))
    scene.until(Activity.REST, light=True)
    assert scene.activities().count(Activity.OFFER) == 3
    assert {y.holder for y in scene.seen} == {Holder.HAND}


def test_a_person_with_errors_continues_from_a_restored_state_bit_for_bit():
    errors: dict[str, Any] = dict.fromkeys(("interface_delay", "timing_error", "effort_spread"), 0.1)
    moving: dict[str, Any] = {"depth_error": 0.2, "sight_error": 0.02, "tremor_rms": 0.001, "drift_rms": 0.002}
    clumsy, at = replace(CALM, arm_reach=3.0, seed=4, **moving, **errors), [round(t / DT) for t in (2.5, 3.6, 4.4, 5.2)]
    assert_continues(lambda: HandAndObject(clumsy), lambda i: Inputs(closure=1.0, light=i * DT > 2.0), at, 50)
