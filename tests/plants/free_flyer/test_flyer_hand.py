"""The hand as such: its effort, its fingers at a box, how it moves with what it holds, what it pushes."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.plants.hand_scene import CALM, DT, called

from handover.cosim.blocks.plain_rotation import IDENTITY, ZERO, Vector, from_rotation_vector, vector
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.box import Box
from handover.plants.free_flyer.hand.finger_contact import HandFingers
from handover.plants.free_flyer.hand.floating_object import FloatingObject
from handover.plants.free_flyer.hand.flyer_hand import FlyerHand
from handover.plants.free_flyer.hand.hand_and_object import Activity
from handover.plants.free_flyer.hand.hand_kinematics import (
    CLOSED,
    FINGERS,
    JOINT_MAX,
    JOINTS,
    RADIUS,
    STRAIGHT,
    Finger,
    joint_places,
    phalanges,
)
from handover.plants.free_flyer.hand.person import Effort, force_at_rest

END = (0.0, 0.07, 0.0)


def free_object() -> FloatingObject:
    return FloatingObject(0.1, (0.021, 0.195, 0.017))


def test_a_hand_moves_as_the_turning_object_that_it_holds():
    hand, thing = FlyerHand(CALM, END, IDENTITY), free_object()
    hand.take_or_leave(True, thing.body)
    thing.body.v, thing.body.spin = (0.1, -0.2, 0.3), (2e-4, 1e-5, -3e-4)
    places, velocities, h = list[Floats](), list[Frame](), 1e-4
    for _ in range(3):
        hand.arrive(hand.course, thing.body)
        places.append(np.array([*hand.p, *hand.q]))
        velocities.append(hand.carried_by(thing.body))
        thing.body.advance(h, ZERO, ZERO, ZERO, ZERO)
    v, w = velocities[1].v, velocities[1].w
    np.testing.assert_allclose(v, (places[2] - places[0])[:3] / (2.0 * h), atol=1e-6)
    assert np.linalg.norm(np.subtract(v, thing.body.v)) > 0.05
    before, after = (Rotation.from_quat(place[3:], scalar_first=True).as_matrix() for place in (places[0], places[2]))
    turned = Rotation.from_matrix(after @ np.transpose(before)).as_rotvec()
    np.testing.assert_allclose(w, turned / (2.0 * h), atol=1e-3)


def test_a_closed_hand_that_was_stretched_takes_again_after_it_has_opened():
    hand, thing = FlyerHand(replace(CALM, arm_reach=0.05), END, IDENTITY), free_object()
    hand.take_or_leave(hand.grasps(True, True), thing.body)
    assert hand.hold is not None
    thing.body.p = (0.2, 0.0, 0.0)
    hand.arrive(hand.course, thing.body)
    hand.take_or_leave(hand.grasps(True, False), thing.body)
    assert hand.hold is None
    assert not hand.grasps(True, True)
    assert not hand.grasps(False, True)
    assert hand.grasps(True, True)


def test_a_fist_presses_the_palm_from_before_it_and_not_on_its_way_back_from_behind():
    def pressed(start: float, end: float) -> list[float]:
        hand, thing = FlyerHand(CALM, (start, 0.0, 0.0), IDENTITY), free_object().body
        forces: list[float] = []
        for x in np.linspace(start, end, 30)[1:].tolist():
            course, f, _ = hand.press(DT, Frame((x, 0.0, 0.0), IDENTITY), Frame(ZERO, IDENTITY))
            hand.arrive(course, thing)
            forces.append(f[0])
        return forces

    assert max(pressed(-0.02, 0.10)) == CALM.arm_force_max
    assert max(pressed(0.10, -0.02)) == 0.0


def test_an_open_hand_bumps_what_is_before_its_palm_and_not_what_it_has_passed():
    thing, too_far = free_object(), Frame((0.05, 0.07, 0.0), IDENTITY)
    for start, bumps in ((-0.02, True), (0.08, False)):
        hand = FlyerHand(CALM, (start, 0.07, 0.0), IDENTITY)
        assert (hand.palm(too_far, thing.body) is not None) is bumps
        assert (hand.kept_off(DT, too_far, thing.body).p[0] < 0.03) is bumps


def test_a_palm_yields_where_the_arm_does():
    thing, weak = free_object(), replace(CALM, arm_force_max=0.5, arm_stiffness=100.0)
    palm = FlyerHand(weak, (-0.02, 0.07, 0.0), IDENTITY).palm(Frame((0.05, 0.07, 0.0), IDENTITY), thing.body)
    assert palm is not None
    assert palm.depth == pytest.approx(0.005)


def test_a_bump_is_one_push_and_no_stronger_than_the_arm():
    """The thumb stands before the palm: each pushed with the arm's limit."""
    felt: list[float] = []
    for seed in range(6):
        clumsy = replace(CALM, depth_error=0.03, seed=seed, attempts=1, arm_force_max=0.5, reach_speed=3.0)
        scene = called(clumsy, Activity.GRASP)
        felt += [-float(y.f_H[0]) for y in scene.seen if y.activity is Activity.REACH]
    assert 0.45 < max(felt) <= 0.5 + 1e-9


SIDES = (0.021, 0.195, 0.017)
RATE = 12.0
FULL = (JOINT_MAX,) * JOINTS
FAR = Frame((1.0, 0.0, 0.0), IDENTITY)


def closed_on(H: Frame, goal: tuple[float, ...] = FULL) -> HandFingers:
    fingers = HandFingers(SIDES, RATE)
    fingers.settle(goal, H)
    return fingers


def room(fingers: HandFingers, H: Frame) -> Floats:
    """Return the distance of each phalanx from the box, by many points of its middle line."""
    R: Floats = np.array(H.R).reshape(3, 3)
    p = np.array(H.p)
    rooms: list[float] = []
    for finger in FINGERS:
        for a, b in phalanges(finger, fingers.angles[finger.first : finger.first + len(finger.lengths)]):
            line: Floats = np.array(a) + np.linspace(0.0, 1.0, 4001)[:, None] * (np.array(b) - a)
            out: Floats = np.abs(line @ np.transpose(R) + p) - np.array(SIDES) / 2.0
            signed = np.linalg.norm(np.maximum(out, 0.0), axis=1) + np.minimum(out.max(axis=1), 0.0)
            rooms.append(float(signed.min()) - RADIUS)
    return np.array(rooms)


def test_a_hand_has_fourteen_hinges_of_ninety_degrees_that_turn_at_a_limited_rate():
    assert sum(len(f.lengths) for f in FINGERS) == len(CLOSED) == JOINTS == 14
    for angles in (FULL, STRAIGHT):
        assert closed_on(FAR, tuple(3.0 * a - 1.0 for a in angles)).angles == angles
    fingers = HandFingers(SIDES, RATE)
    fingers.advance(DT, FULL, FAR)
    np.testing.assert_allclose(fingers.angles, RATE * DT)


@pytest.mark.parametrize("finger", FINGERS, ids=[f.name for f in FINGERS])
def test_bones_keep_their_lengths_and_bend_by_the_joints_angles(finger: Finger):
    angles = (0.3, 0.7, 0.2)[: len(finger.lengths)]
    bones = np.diff(np.array(joint_places(finger, angles)), axis=0)
    np.testing.assert_allclose(np.linalg.norm(bones, axis=1), finger.lengths, rtol=1e-12)
    before = np.vstack([finger.ahead, bones])
    before = before / np.linalg.norm(before, axis=1)[:, None]
    bent = np.arccos(np.sum(before[1:] * before[:-1], axis=1))  # [Fernandes2020] eq. (4.5)
    np.testing.assert_allclose(bent, angles, rtol=1e-12)
    assert np.dot(bones[-1], finger.bend) > 0.0


def test_distance_from_a_box_is_that_of_its_nearest_point():
    box = Box((0.1, 0.2, 0.3))
    for p, d in (((0.13, 0.24, 0.0), 0.05), ((0.05, 0.0, 0.0), -0.05), ((0.0, 0.0, 0.31), 0.01)):
        assert box.distance(p) == pytest.approx(d)
    assert box.normal((0.13, 0.24, 0.0)) == pytest.approx((0.6, 0.8, 0.0))


def test_the_nearest_point_of_a_line_is_that_of_many_of_its_points_and_no_nearer_than_its_least_room():
    box, rng, at_ends, apart = Box((0.01, 0.1, 0.008)), np.random.default_rng(1), 0, 0
    for a, b in rng.uniform(-1.0, 1.0, (200, 2, 3)) * (0.03, 0.12, 0.03):
        many = min(box.distance(vector(a + s * (b - a))) for s in np.linspace(0.0, 1.0, 201))
        line = vector(a), vector(b)
        away, p = box.nearest(line)
        assert many - 0.005 * np.linalg.norm(b - a) <= away <= many + 1e-3 * np.linalg.norm(b - a)
        assert away == box.distance(p)
        assert box.least_room(line) <= away + 1e-12
        apart += box.least_room(line) > 0.0
        at_ends += p in line
    assert 25 < at_ends < 175
    assert apart > 20


@pytest.mark.parametrize(
    ("p", "turn"),
    [
        ((0.0, 0.07, 0.0), (0.0, 0.0, 0.0)),
        ((0.004, 0.05, -0.003), (0.1, 0.15, 0.3)),
    ],
)
def test_fingers_stop_at_the_objects_surface(p: Vector, turn: Vector):
    H = Frame(p, from_rotation_vector(turn))
    fingers = closed_on(H)
    rooms = room(fingers, H)
    assert np.min(rooms) > -1e-6
    touching = [c.joint for c in fingers.contacts(H, 1e-5) if c.joint is not None]
    assert len(touching) >= 5
    np.testing.assert_allclose(rooms[touching], 0.0, atol=2e-5)
    stopped = [a for a in fingers.angles if 0.0 < a < JOINT_MAX]
    assert len(set(np.round(stopped, 4).tolist())) >= (8 if any(turn) else 3)  # each ends at its own angle


def test_a_finger_gives_way_to_an_object_that_comes_nearer():
    fingers = closed_on(Frame((0.0, 0.07, 0.0), IDENTITY))
    nearer = Frame((0.0, 0.07, -0.003), IDENTITY)
    before = fingers.angles
    fingers.advance(DT, FULL, nearer)
    assert fingers.angles != before
    assert np.min(room(fingers, nearer)) > -1e-6
    assert np.max(np.abs(np.subtract(fingers.angles, before))) <= RATE * DT + 1e-12


def test_thumb_and_fingers_enclose_what_is_between_them_only():
    for p, encloses in (((0.0, 0.07, 0.0), True), ((0.0, 0.07, 0.1), False), ((0.0, 0.2, 0.0), False)):
        H = Frame(p, IDENTITY)
        assert closed_on(H).encloses(H) is encloses
        open_hand = HandFingers(SIDES, RATE)
        assert not open_hand.encloses(H)


def test_fingers_of_the_person_differ_by_where_the_object_is():
    a, b = (called(replace(CALM, p_OH=np.array([x, 0.07, 0.0]))).y.finger for x in (0.0, 0.006))
    assert np.sum(np.abs(a - b) > 0.01) >= 4


NO_END = 1e9


def moved(mass: float, force: float, free_speed: float, load: float, seconds: float, dt: float) -> Effort:
    effort = Effort(mass)
    effort.begin()
    for _ in range(round(seconds / dt)):
        effort.advance(dt, force, free_speed, NO_END, load)
    return effort


def test_an_effort_rises_holds_and_is_eased():
    forces = [force_at_rest(4.0, t, 0.3, 7.0, 3.0) for t in (0.0, 0.15, 0.3, 5.0, 7.0, 8.5, 10.0)]
    np.testing.assert_allclose(forces, [0.0, 2.0, 4.0, 4.0, 4.0, 2.0, 0.0], atol=1e-12)


def test_a_free_hand_gets_to_its_speed_as_the_law_says():
    m, F, v_0, t = 1.0, 4.0, 0.35, 0.1
    tau = m * v_0 / F
    exact = v_0 * (1.0 - np.exp(-t / tau))
    assert moved(m, F, v_0, 0.0, t, 1e-4).speed == pytest.approx(exact, rel=2e-3)
    assert moved(m, F, v_0, 0.0, 5.0, 0.032).speed == pytest.approx(v_0, rel=1e-9)


def test_against_a_load_the_hand_is_as_fast_as_force_and_speed_allow():
    assert moved(1.0, 4.0, 0.35, 3.0, 5.0, 0.016).speed == pytest.approx(0.25 * 0.35, rel=1e-9)
    early, late = (moved(1.0, 4.0, 0.35, 6.0, seconds, 0.016).speed for seconds in (0.8, 1.6))
    assert late - early == pytest.approx(-(6.0 - 1.3 * 4.0) * 0.8, rel=1e-9)  # no more than 1.3 times the force


@pytest.mark.parametrize("force", [1.0, 100.0])
def test_no_step_or_effort_makes_it_swing(force: float):
    effort = Effort(0.05)
    speeds: list[float] = []
    for _ in range(200):
        effort.advance(0.1, force, 0.35, NO_END, 0.0)
        speeds.append(effort.speed)
    assert all(a <= b + 1e-12 for a, b in zip([0.0, *speeds], speeds, strict=False))


def test_it_ends_at_its_length_and_can_be_drawn_back_from_there():
    effort = Effort(1.0)
    for _ in range(100):
        effort.advance(DT, 4.0, 0.35, 0.1, 0.0)
    assert (effort.travelled, effort.speed) == (0.1, 0.0)
    for _ in range(20):
        effort.advance(DT, 0.0, 0.35, 0.1, 1.0)
    assert effort.travelled < 0.1


def test_a_gripper_that_stands_still_feels_the_effort_and_one_that_lets_go_leaves_the_hand_no_faster_than_a_free_one():
    scene = called(replace(CALM, effort=4.0, arm_force_max=6.0))
    y = scene.go(4.0)
    assert float(np.linalg.norm(y.f_G)) == pytest.approx(4.0, rel=0.03)
    assert y.f_G[2] > 0.9 * 4.0
    begin = len(scene.seen)
    scene.go(1.5, closure=0.0)
    free = [y for y in scene.seen[begin:] if y.activity is Activity.PULL]
    speeds = [float(np.linalg.norm(b.p_WH - a.p_WH)) / DT for a, b in itertools.pairwise(free)]
    assert 0.15 < max(speeds) < 1.15 * 0.35
