"""The hand, the object and a gripper that the test moves."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand_and_object import (
    Activity,
    HandAndObject,
    Holder,
    Inputs,
    Motion,
    Outputs,
    Params,
    StartHolder,
)

DT = 0.016
PLACE = np.array([0.0, -0.07, 0.0])
CALM = Params(tremor_rms=0.0, drift_rms=0.0, reaction_spread=0.0, p_WO_0=np.zeros(3))
IDLE = replace(CALM, motion=Motion.NONE, motion_again=Motion.NONE)
GIVING = replace(CALM, motion=Motion.GIVE, object_with=StartHolder.HAND)


def flat(y: Outputs) -> Floats:
    return np.concatenate([np.ravel(getattr(y, v.name)) for v in describe(HandAndObject).outputs])


def off(x: float, y: float = 0.0, z: float = 0.0) -> Floats:
    """Return a place beside the gripper's."""
    return PLACE + np.array([x, y, z])


class Scene:
    """A unit and its time; the gripper is where `move` says and closes on command."""

    def __init__(self, params: Params, p_WG: Floats = PLACE) -> None:
        self.unit, self.i = HandAndObject(params), 0
        self.u = Inputs(p_WG=np.array(p_WG))
        self.y = self.unit.outputs(0.0, self.u)
        self.seen: list[Outputs] = []

    def go(self, seconds: float, dt: float = DT, **changes: Any) -> Outputs:
        self.u = replace(self.u, **changes)
        for _ in range(round(seconds / dt)):
            self.u.p_WG = self.u.p_WG + dt * self.u.v_WG
            self.y = self.unit.step(self.i * dt, dt, self.u)
            self.i += 1
            self.seen.append(self.y)
        return self.y

    def until(self, activity: Activity, **changes: Any) -> Outputs:
        for _ in range(2000):
            if self.go(DT, **changes).activity is activity:
                return self.y
        raise AssertionError(f"{activity!r} did not come about")

    def activities(self) -> list[Activity]:
        all_of_them = [y.activity for y in self.seen]
        return [a for a, b in zip(all_of_them, [None, *all_of_them], strict=False) if a is not b]


def test_a_time_that_whole_steps_fill_ends_at_the_same_step_whatever_their_last_digits():
    """Grasping takes 25 steps; hosts that take differences of times give steps that add up to a little less."""
    courses: list[list[Activity]] = []
    for dt in (DT, DT - 1e-16, DT + 1e-16):
        scene = Scene(CALM)
        for _ in range(400):
            scene.go(dt, dt, closure=1.0, light=True)
        courses.append([y.activity for y in scene.seen])
    assert courses[0].count(Activity.GRASP) == 25
    assert courses[0] == courses[1] == courses[2]


def test_starts_as_declared():
    y = HandAndObject(Params()).outputs(0.0, Inputs())
    np.testing.assert_array_equal(y.p_WO, [-0.10, -0.57, 0.0])
    np.testing.assert_array_equal(y.p_WH, [-0.40, 0.10, -0.05])
    assert (y.holder, y.activity) == (Holder.FREE, Activity.WAIT)
    assert y.gripper_angle == 1.2
    y = HandAndObject(GIVING).outputs(0.0, Inputs())
    np.testing.assert_allclose(y.p_WO, [-0.40, 0.03, -0.05])  # the hand's place on it is 0.07 m along y
    assert y.holder is Holder.HAND


def test_a_free_object_stays_where_it_is():
    y = Scene(IDLE, np.array([1.0, 0.0, 0.0])).go(1.6)
    np.testing.assert_array_equal(y.p_WO, np.zeros(3))
    np.testing.assert_array_equal(y.f_G, np.zeros(3))


def test_gripper_follows_its_command_at_its_rate_and_distinguishes_empty_from_full():
    scene = Scene(IDLE, np.array([0.5, 0.0, 0.0]))
    assert scene.go(0.32, closure=1.0).gripper_angle == pytest.approx(1.2 - 0.6 * 0.32)
    assert scene.go(2.0).gripper_angle == pytest.approx(0.60)
    assert scene.go(2.0, closure=0.5).gripper_angle == pytest.approx(0.90)
    assert scene.y.holder is Holder.FREE
    held = Scene(IDLE).go(2.0, closure=1.0)
    assert held.gripper_angle == pytest.approx(0.60 + 0.60 * 0.017 / 0.055)
    assert held.gripper_angle > 0.71 > 0.60
    assert held.holder is Holder.GRIPPER


def test_gripper_that_starts_closed_opens_and_takes_nothing_by_that():
    scene = Scene(replace(IDLE, angle_0=0.60), np.array([0.5, 0.0, 0.0]))
    assert scene.y.gripper_angle == 0.60
    assert scene.go(0.48, closure=0.0).gripper_angle == pytest.approx(0.60 + 0.6 * 0.48)
    assert scene.go(1.0).gripper_angle == pytest.approx(1.20)
    assert {y.holder for y in scene.seen} == {Holder.FREE}


def test_object_comes_free_when_the_fingers_are_open_enough():
    scene = Scene(IDLE)
    closed = scene.go(2.0, closure=1.0).gripper_angle
    while scene.go(DT, closure=0.0).holder is Holder.GRIPPER:
        assert scene.y.gripper_angle <= closed + 0.2 + 1e-9
    assert scene.y.gripper_angle > closed + 0.2


def test_closing_again_before_that_keeps_it():
    scene = Scene(IDLE)
    closed = scene.go(2.0, closure=1.0).gripper_angle
    scene.go(0.2, closure=0.0)
    assert scene.go(1.0, closure=1.0).holder is Holder.GRIPPER
    assert scene.y.gripper_angle == closed


@pytest.mark.parametrize(
    ("beside", "taken"),
    [
        ((0.029, 0.0, 0.0), True),
        ((0.031, 0.0, 0.0), False),
        ((0.0, 0.0, 0.019), True),
        ((0.0, 0.0, -0.021), False),
        ((0.0, 0.167, 0.0), True),  # along the object, at its other end
        ((0.0, -0.037, 0.0), True),  # a centimetre beyond its end
        ((0.0, -0.039, 0.0), False),
    ],
)
def test_fingers_reach_so_far_and_no_farther(beside: tuple[float, float, float], taken: bool):
    y = Scene(IDLE, off(*beside)).go(2.0, closure=1.0)
    assert (y.holder is Holder.GRIPPER) is taken


def test_what_is_gripped_is_drawn_to_the_fingers_middle():
    scene = Scene(IDLE, off(0.02, z=0.01))
    y = scene.go(10.0, closure=1.0)
    np.testing.assert_allclose(y.p_WO[[0, 2]], [0.02, 0.01], atol=1e-6)
    assert max(float(np.linalg.norm(y.f_G)) for y in scene.seen) < 0.5


def test_a_gripped_object_is_carried_in_position_and_attitude():
    scene = Scene(IDLE)
    scene.go(2.0, closure=1.0)
    turn = np.array([0.0, 0.0, 0.3])
    for i in range(1, 251):  # a turn about G, and a way along y
        q = Rotation.from_rotvec(turn * i * DT).as_quat(scalar_first=True)
        scene.go(DT, q_WG=q, w_WB=turn, v_WG=np.array([0.0, 0.05, 0.0]))
    R = Rotation.from_quat(scene.u.q_WG, scalar_first=True)
    np.testing.assert_allclose(scene.y.p_WO, scene.u.p_WG + R.apply([0.0, 0.07, 0.0]), atol=5e-4)
    assert abs(scene.y.q_WO @ scene.u.q_WG) > math.cos(0.5 * 2e-3)
    inwards = -0.1 * 0.3**2 * R.apply([0.0, 0.07, 0.0])  # the force that keeps the centre on its circle
    np.testing.assert_allclose(scene.y.f_G, -inwards, atol=2e-5)


def test_an_object_held_beside_the_fingers_middle_resists_with_force_and_torque():
    scene, a = Scene(replace(IDLE, centring_time=100.0), off(0.02, z=0.01)), np.array([0.3, 0.0, 0.4])
    scene.go(1.0, closure=1.0)
    for i in range(1, 126):
        scene.go(DT, v_WG=DT * i * a)
    np.testing.assert_allclose(scene.y.f_G, -0.1 * a, rtol=1e-3, atol=1e-5)  # its inertia, acting at its centre
    p_GO = scene.y.p_WO - scene.u.p_WG
    np.testing.assert_allclose(scene.y.tau_G, np.cross(p_GO, -0.1 * a), atol=2e-5)
    assert np.linalg.norm(p_GO[[0, 2]]) > 0.015


def test_grip_slides_at_its_limit_and_loses_what_slides_too_far():
    fast = replace(
        CALM, grip_force_max=1.0, grip_torque_max=50.0, arm_force_max=100.0, pull_direction=np.array([0, 0, 1.0])
    )
    scene = Scene(fast)
    scene.go(2.0, closure=1.0)
    scene.until(Activity.PULL, light=True)
    scene.until(Activity.WITHDRAW)
    pull = [y.f_G[2] for y in scene.seen if y.holder is Holder.BOTH]
    assert max(pull) == pytest.approx(1.0, rel=0.02)
    assert max(np.linalg.norm(y.f_G) for y in scene.seen) < 1.05
    slipped = next(y for y in scene.seen if y.activity is Activity.PULL and y.holder is Holder.HAND)
    assert slipped.p_WO[2] > 0.02  # the fingers reach 2 cm along z


def test_arm_gives_in_at_the_force_that_a_person_cares_to_exert():
    scene = Scene(replace(CALM, arm_force_max=1.5, wrist_torque_max=50.0, pull_direction=np.array([0.0, 0.0, 1.0])))
    scene.go(2.0, closure=1.0)
    scene.until(Activity.PULL, light=True)
    scene.go(3.0)
    assert scene.y.holder is Holder.BOTH
    assert max(float(np.linalg.norm(y.f_H)) for y in scene.seen) == pytest.approx(1.5, rel=0.03)
    np.testing.assert_allclose(scene.y.f_H, [0.0, 0.0, -1.5], atol=0.05)
    np.testing.assert_allclose(scene.y.f_G, -scene.y.f_H, atol=1e-3)


def test_torque_on_the_gripper_balances_the_hand_at_the_other_end():
    scene = Scene(replace(CALM, pull_distance=0.005, patience=100.0, wrist_torque_max=50.0))
    scene.go(2.0, closure=1.0)
    scene.until(Activity.PULL, light=True)
    y = scene.go(8.0)
    about_hand = np.cross(y.p_WH - scene.u.p_WG, -y.f_G)  # of the grip's force, about the hand
    wrist = y.tau_G + about_hand
    turned = Rotation.from_quat(y.q_WO, scalar_first=True).as_rotvec()
    np.testing.assert_allclose(wrist, -2.5 * turned, atol=2e-3)  # hand's course is not turned
    assert np.linalg.norm(y.tau_G) > 0.01


def test_palm_pushes_an_object_away_but_never_holds_it():
    scene = Scene(IDLE, off(0.05))
    scene.go(0.8, v_WG=np.array([-0.1, 0.0, 0.0]))  # the robot drives its palm into the object's end
    assert scene.y.v_WO[0] < -0.02
    assert max(y.f_G[0] for y in scene.seen) > 0.0
    assert min(y.f_G[0] for y in scene.seen) == 0.0
    impulse = -DT * sum(y.f_G[0] for y in scene.seen)
    assert impulse == pytest.approx(0.1 * scene.y.v_WO[0], rel=1e-9)


TAKEN = [Activity.WAIT, Activity.REACH, Activity.GRASP, Activity.PULL, Activity.WITHDRAW, Activity.REST]


def test_takes_what_the_robot_gives():
    scene = Scene(replace(CALM, motion_again=Motion.NONE))
    scene.go(2.0, closure=1.0)
    scene.until(Activity.PULL, light=True)
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
    scene = Scene(replace(GIVING, motion_again=Motion.NONE))
    scene.until(Activity.PUSH, light=True)
    scene.go(1.0)
    assert scene.y.f_G[0] > 0.2
    assert abs(scene.y.f_G[2]) < 0.05
    scene.until(Activity.LET_GO, closure=1.0)
    assert scene.y.holder is Holder.GRIPPER
    scene.until(Activity.REST)
    assert scene.activities() == [
        Activity.WAIT,
        Activity.OFFER,
        Activity.PUSH,
        Activity.LET_GO,
        Activity.WITHDRAW,
        Activity.REST,
    ]
    assert Holder.FREE not in [y.holder for y in scene.seen]
    np.testing.assert_allclose(scene.y.p_WO - scene.u.p_WG, [0.0, 0.07, 0.0], atol=0.012)
    np.testing.assert_allclose(scene.go(0.5).p_WH, [-0.40, 0.10, -0.05], atol=1e-5)


def test_a_gripper_that_is_turned_gets_the_object_turned():
    q = Rotation.from_euler("xyz", [0.2, -0.15, 0.3]).as_quat(scalar_first=True)
    scene = Scene(GIVING)
    scene.until(Activity.PUSH, light=True, q_WG=q)
    scene.go(0.5)
    scene.until(Activity.LET_GO, closure=1.0)
    assert scene.y.holder is Holder.GRIPPER
    assert abs(scene.y.q_WO @ q) > math.cos(0.5 * 0.03)


def test_false_reception_pushes_and_leaves_nothing():
    scene = Scene(replace(GIVING, motion=Motion.PUSH, motion_again=Motion.GIVE))
    scene.until(Activity.PUSH, light=True)
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
    y = scene.go(3.0, light=True)
    np.testing.assert_array_equal(y.p_WH, [-0.40, 0.10, -0.05])
    assert scene.activities() == [Activity.WAIT]


def test_reacts_to_the_light_after_the_reaction_time():
    scene = Scene(replace(CALM, reaction_time=0.4))
    scene.go(0.8)
    begin = scene.i
    scene.until(Activity.REACH, light=True)
    assert (scene.i - begin) * DT == pytest.approx(0.4, abs=0.017)


def test_a_light_that_stays_on_is_one_signal():
    scene = Scene(replace(CALM, motion_again=Motion.TAKE))
    scene.go(1.0, closure=1.0)
    scene.until(Activity.PULL, light=True)
    scene.until(Activity.REST, closure=0.0)
    scene.go(5.0)
    assert scene.activities() == TAKEN


def test_reaction_times_differ_from_signal_to_signal_and_by_seed():
    def reaction(seed: int) -> float:
        scene = Scene(replace(CALM, reaction_spread=0.2, seed=seed, reaction_time=1.0))
        scene.until(Activity.REACH, light=True)
        return scene.i * DT

    times = [reaction(seed) for seed in range(12)]
    assert len(set(times)) > 6
    assert 0.08 < float(np.std(times)) < 0.35


def test_what_is_out_of_reach_is_waited_for():
    scene = Scene(replace(CALM, p_WO_0=np.array([1.0, 0.0, 0.0])), np.array([1.0, -0.07, 0.0]))
    scene.go(3.0, closure=1.0, light=True)
    assert scene.y.activity is Activity.WAIT
    scene.go(10.0, v_WG=np.array([-0.1, 0.0, 0.0]))
    assert Activity.REACH in scene.activities()


def test_lets_go_when_its_patience_is_at_an_end():
    scene = Scene(replace(CALM, patience=2.0, motion_again=Motion.NONE))
    scene.go(2.0, closure=1.0)
    scene.until(Activity.REST, light=True)
    assert scene.activities() == [*TAKEN[:4], Activity.LET_GO, *TAKEN[4:]]
    assert scene.y.holder is Holder.GRIPPER


def test_fingers_close_in_a_minimum_jerk_within_their_range():
    scene = Scene(CALM)
    scene.go(2.0, closure=1.0)
    scene.until(Activity.GRASP, light=True)
    scene.until(Activity.PULL)
    fingers = np.array([y.finger for y in scene.seen])
    assert np.min(fingers) == 0.0
    assert np.max(fingers) <= 0.5 * math.pi
    closed = scene.go(0.5).finger
    assert np.all(closed > 0.5)
    middle = next(y for y in scene.seen if y.finger[0] >= 0.5 * closed[0])
    np.testing.assert_allclose(middle.finger / closed, middle.finger[0] / closed[0], atol=1e-12)


def test_tremor_is_in_the_hand_and_comes_by_its_seed():
    def hand(seed: int) -> Floats:
        scene = Scene(Params(motion=Motion.NONE, seed=seed, tremor_rms=0.002, drift_rms=0.0))
        scene.go(4.0)
        return np.array([y.p_WH for y in scene.seen]) - scene.seen[0].p_WH

    a, b, c = hand(1), hand(1), hand(2)
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)
    assert 0.001 < np.sqrt(np.mean(np.sum(a**2, axis=1, dtype=np.float64))) < 0.004


@pytest.mark.parametrize("params", [replace(CALM, seed=3), replace(GIVING, seed=4, tremor_rms=0.001)])
def test_goes_on_bit_for_bit_after_a_state_is_restored(params: Params):
    def rest(unit: HandAndObject, begin: int) -> Floats:
        return np.array([flat(unit.step(DT * i, DT, inputs(i))) for i in range(begin, 700)])

    def inputs(i: int) -> Inputs:
        taking = params.motion is Motion.TAKE
        closed = (100 < i < 400) if taking else i > 300
        return Inputs(closure=float(closed), light=130 < i < 160, v_WG=np.array([0.0, 0.0, 0.001]))

    a = HandAndObject(params)
    states: dict[int, bytes] = {0: a.get_state()}
    path = list[Floats]()
    for i in range(700):
        if i % 70 == 35:
            states[i] = a.get_state()
        path.append(flat(a.step(DT * i, DT, inputs(i))))
    b = HandAndObject(params)
    for i, state in states.items():
        for unit in (a, b):
            unit.set_state(state)
            np.testing.assert_array_equal(rest(unit, i), path[i:])


def test_asking_for_outputs_changes_nothing():
    a, b = HandAndObject(Params()), HandAndObject(Params())
    np.testing.assert_array_equal(flat(a.outputs(0.0, Inputs())), flat(a.outputs(0.0, Inputs())))
    np.testing.assert_array_equal(flat(a.step(0.0, DT, Inputs())), flat(b.step(0.0, DT, Inputs())))
