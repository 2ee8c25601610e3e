"""Fingers of the hand: their joints' limits, where they stop at a box, what they do to a free one."""

from dataclasses import replace

import numpy as np
import pytest
from support.plants.hand_scene import CALM, DT, called

from handover.cosim.blocks.plain_rotation import IDENTITY, Vector, from_rotation_vector, vector
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.box import Box
from handover.plants.free_flyer.hand.finger_contact import HandFingers
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
