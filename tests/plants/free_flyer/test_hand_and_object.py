"""The unit of hand and object: what the person does, its start, its steps, its state, and what it refuses."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.plants.hand_scene import CALM, DT, GIVING, IDLE, PLACE, Scene, called, giving
from support.restored_states import assert_continues, assert_outputs_change_nothing
from support.wording import Wording

from handover.cosim.blocks.plain_rotation import Vector
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.hand_and_object import (
    Activity,
    HandAndObject,
    Holder,
    Inputs,
    InvalidHandParameters,
    Motion,
    Params,
    StartHolder,
)
from handover.plants.free_flyer.hand.hand_kinematics import CLOSED
from handover.plants.hand_motion import minimum_jerk


def test_a_time_that_whole_steps_fill_ends_at_the_same_step_whatever_their_last_digits():
    """Grasping takes 25 steps; hosts that take differences of times give steps that add up to a little less."""
    courses: list[list[Activity]] = []
    for dt in (DT, DT - 1e-16, DT + 1e-16):
        scene = Scene(CALM)
        for _ in range(260):
            scene.go(dt, dt, closure=1.0, light=True)
        courses.append([y.activity for y in scene.seen])
    assert courses[0].count(Activity.GRASP) == 25
    assert courses[0] == courses[1] == courses[2]


def test_a_free_object_stays_where_it_is_and_a_held_one_is_where_the_hand_is_on_it():
    y = Scene(IDLE, np.array([1.0, 0.0, 0.0])).go(1.6)
    np.testing.assert_array_equal([y.p_WO, y.f_G], np.zeros((2, 3)))
    np.testing.assert_allclose(Scene(GIVING).y.p_WO, [-0.40, 0.03, -0.05])  # 0.07 m along y from the hand
    assert_outputs_change_nothing(lambda: HandAndObject(Params()), Inputs())


@pytest.mark.parametrize("params", [replace(CALM, seed=3), replace(GIVING, seed=4, tremor_rms=0.001)])
def test_goes_on_bit_for_bit_after_a_state_is_restored(params: Params):

    def inputs(i: int) -> Inputs:
        taking = params.motion is Motion.TAKE
        closed = (100 < i < 400) if taking else i > 300
        return Inputs(closure=float(closed), light=130 < i < 160, v_WG=np.array([0.0, 0.0, 0.001]))

    assert_continues(lambda: HandAndObject(params), inputs, [0, *range(35, 420, 70)], 70)


TAKEN = [Activity.WAIT, Activity.REACH, Activity.GRASP, Activity.PULL, Activity.WITHDRAW, Activity.REST]


def test_takes_what_the_robot_gives():
    scene = called(replace(CALM, motion_again=Motion.NONE))
    scene.go(1.0, light=False)
    assert scene.y.holder is Holder.BOTH
    assert scene.y.f_G[2] > 0.5
    scene.until(Activity.REST, closure=0.0)
    assert scene.activities() == TAKEN
    holders = [y.holder for y in scene.seen[125:]]
    assert Holder.FREE not in holders
    assert holders[-1] is Holder.HAND
    y = scene.go(6.0)
    np.testing.assert_allclose(y.p_WH, [-0.40, 0.10, -0.05], atol=5e-3)
    np.testing.assert_allclose(y.p_WH - y.p_WO, [0.0, 0.07, 0.0], atol=5e-3)


def test_gives_what_it_holds():
    scene = giving(replace(GIVING, motion_again=Motion.NONE))
    scene.go(1.0)
    assert scene.y.f_G[0] > 0.2
    assert abs(scene.y.f_G[2]) < 0.05
    scene.until(Activity.LET_GO, closure=1.0)
    assert scene.y.holder is Holder.GRIPPER
    scene.until(Activity.REST)
    assert scene.activities() == [TAKEN[0], Activity.OFFER, Activity.PUSH, Activity.LET_GO, *TAKEN[4:]]
    assert Holder.FREE not in [y.holder for y in scene.seen]
    np.testing.assert_allclose(scene.y.p_WO - scene.u.p_WG, [0.0, 0.07, 0.0], atol=0.012)
    np.testing.assert_allclose(scene.go(0.5).p_WH, [-0.40, 0.10, -0.05], atol=1e-5)


HIGHER = [(-0.2, 0.0, 0.4), (-0.25, 0.1, 0.3)]
"""Places of an object above the hand's rest; a hand on straight courses sweeps it with its fingers from below."""


@pytest.mark.parametrize("place", [*HIGHER, (0.2, -0.25, 0.4), (-0.1, 0.2, -0.45)])
def test_an_open_hand_touches_nothing_until_it_closes_and_reaches_no_faster_than_its_highest_speed(place: Vector):
    p_WO = np.array(place)
    scene = called(replace(CALM, p_WO_0=p_WO), Activity.GRASP, p_WO + PLACE)
    assert max(float(np.abs(y.f_H).max()) for y in scene.seen) == 0.0
    np.testing.assert_allclose(scene.y.p_WH - scene.y.p_WO, [0.0, 0.07, 0.0], atol=1e-3)
    places = np.array([y.p_WH for y in scene.seen if y.activity is Activity.REACH])
    speeds = np.linalg.norm(np.diff(places, axis=0), axis=1) / DT
    assert 0.1 < speeds.max() <= 1.01 * Params().reach_speed
    scene.until(Activity.PULL)
    assert scene.go(0.5).holder is Holder.BOTH


def test_a_hand_that_has_given_leaves_without_a_touch():
    scene = giving(replace(GIVING, motion_again=Motion.NONE), np.array(HIGHER[1]) + PLACE)
    scene.until(Activity.LET_GO, closure=1.0)
    scene.until(Activity.WITHDRAW)
    begin = len(scene.seen)
    scene.until(Activity.REST)
    assert max(float(np.abs(y.f_H).max()) for y in scene.seen[begin:]) < 1e-3
    assert scene.y.holder is Holder.GRIPPER


def test_a_gripper_that_is_turned_gets_the_object_turned():
    q = Rotation.from_euler("xyz", [0.2, -0.15, 0.3]).as_quat(scalar_first=True)
    scene = Scene(GIVING)
    scene.until(Activity.PUSH, light=True, q_WG=q)
    scene.go(0.5)
    assert scene.until(Activity.LET_GO, closure=1.0).holder is Holder.GRIPPER
    assert abs(scene.y.q_WO @ q) > math.cos(0.5 * 0.07)  # the push at one end tilts it in the hand


def test_false_reception_pushes_and_leaves_nothing():
    scene = giving(replace(GIVING, motion=Motion.PUSH, motion_again=Motion.GIVE))
    while scene.go(DT).f_G[0] < 0.5:
        assert scene.y.activity is Activity.PUSH
    scene.until(Activity.REST, closure=1.0, light=False)
    assert scene.y.gripper_angle == pytest.approx(0.60)
    assert {y.holder for y in scene.seen} == {Holder.HAND}
    assert max(y.f_G[0] for y in scene.seen) <= 2.0 * 1.03
    scene.go(1.5, closure=0.0)
    scene.until(Activity.PUSH, light=True)
    scene.until(Activity.LET_GO, closure=1.0)
    assert scene.y.holder is Holder.GRIPPER


def test_without_a_motion_nothing_moves():
    scene = Scene(IDLE)
    np.testing.assert_array_equal(scene.go(3.0, light=True).p_WH, [-0.40, 0.10, -0.05])
    assert scene.activities() == [Activity.WAIT]


def test_reacts_to_the_light_after_the_reaction_time_and_the_interfaces_delay():
    for delay in (0.0, 0.16):
        scene = Scene(replace(CALM, reaction_time=0.4, interface_delay=delay))
        scene.go(0.8)
        begin = scene.i
        scene.until(Activity.REACH, light=True)
        assert (scene.i - begin) * DT == pytest.approx(0.4 + delay, abs=0.017)


def test_a_light_that_stays_on_is_one_signal():
    scene = called(replace(CALM, motion_again=Motion.TAKE))
    scene.until(Activity.REST, closure=0.0)
    scene.go(5.0)
    assert scene.activities() == TAKEN


def test_reaction_times_differ_by_seed():
    times: list[float] = []
    for seed in range(8):
        scene = Scene(replace(CALM, reaction_spread=0.2, seed=seed, reaction_time=1.0))
        scene.until(Activity.REACH, light=True)
        times.append(scene.i * DT)
    assert len(set(times)) > 4
    assert 0.08 < float(np.std(times)) < 0.35


def test_what_is_out_of_reach_is_waited_for():
    scene = Scene(replace(CALM, p_WO_0=np.array([1.0, 0.0, 0.0])), np.array([1.0, -0.07, 0.0]))
    scene.go(3.0, closure=1.0, light=True)
    assert scene.y.activity is Activity.WAIT
    scene.until(Activity.REACH, v_WG=np.array([-0.1, 0.0, 0.0]))


def test_lets_go_when_its_patience_is_at_an_end():
    scene = called(replace(CALM, patience=0.5, motion_again=Motion.NONE), Activity.REST)
    assert scene.activities() == [*TAKEN[:4], Activity.LET_GO, *TAKEN[4:]]
    assert scene.y.holder is Holder.GRIPPER


def test_fingers_close_in_a_minimum_jerk_until_they_touch():
    scene = called(CALM, Activity.GRASP)
    begin = len(scene.seen) - 1
    scene.until(Activity.PULL)
    fingers = np.array([y.finger for y in scene.seen])
    assert np.min(fingers) == 0.0
    assert np.max(fingers) <= 0.5 * math.pi
    course = [minimum_jerk((k + 1) * DT / CALM.grasp_time) for k in range(10)]
    np.testing.assert_allclose(fingers[begin : begin + 10], np.outer(course, CLOSED), atol=1e-9)
    assert np.all(fingers[-1] <= np.array(CLOSED) + 1e-12)
    assert np.sum(fingers[-1] < np.array(CLOSED) - 0.1) >= 5  # stopped by the object, each at its own angle


def test_tremor_is_in_the_hand_and_comes_by_its_seed():
    def hand(seed: int) -> Floats:
        scene = Scene(Params(motion=Motion.NONE, seed=seed, tremor_rms=0.002, drift_rms=0.0))
        scene.go(4.0)
        return np.array([y.p_WH for y in scene.seen]) - scene.seen[0].p_WH

    a, b, c = hand(1), hand(1), hand(2)
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)
    assert 0.001 < np.sqrt(np.mean(np.sum(a**2, axis=1, dtype=np.float64))) < 0.004


def begun(p_WG: Floats, **changes: Any) -> None:
    HandAndObject(Params(p_WO_0=np.zeros(3), **changes)).step(0.0, 0.016, Inputs(p_WG=p_WG))


@pytest.mark.parametrize(
    "changes",
    [
        {"motion": Motion.GIVE},
        {"object_with": StartHolder.HAND},
        {"p_WH_0": np.array([-0.10, -0.60, 0.02])},
        {"object_size": np.array([0.3, 0.1, 0.1])},
        {"p_OH": np.array([0.0, 0.2, 0.0])},
        {"p_OH": np.array([0.0, -0.05, 0.0])},
        {"aperture": 0.01},
        {"angle_empty": 1.3},
        {"release_angle": 1.0},
        {"angle_0": 0.5},
        {"pull_direction": np.zeros(3)},
        {"q_WO_0": np.array([1.0, 1.0, 0.0, 0.0])},
        {"q_WH_0": np.zeros(4)},
        {"tremor_bandwidth": 20.0},
        {"motion": Motion.GIVE, "aperture": 0.01, "pull_direction": np.zeros(3)},
    ],
)
def test_contradictions_are_refused_all_at_once(changes: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidHandParameters) as refused:
        HandAndObject(replace(Params(), **changes))
    assert len(refused.value.faults) >= len(changes)
    wording.check(refused.value)


def test_a_robot_that_starts_in_the_hand_is_refused(wording: Wording):
    for p_WG, changes in (
        ([-0.40, 0.13, -0.05], {}),
        ([-0.03, -0.07, 0.0], {}),
        ([0.0, -0.07, 0.0], {"angle_0": 0.60}),
    ):
        with pytest.raises(InvalidHandParameters) as refused:
            begun(np.array(p_WG), **changes)
        wording.check(refused.value)
    begun(np.array([0.0, -0.07, 0.0]), angle_0=0.80)
