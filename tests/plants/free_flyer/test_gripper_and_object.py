"""What the gripper's fingers and palm do with the object: take, carry, slide along, lose and push it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.plants.hand_scene import CALM, DT, IDLE, PLACE, Scene, called, off
from support.restored_states import assert_continues

from handover.cosim.blocks.plain_rotation import IDENTITY, ZERO, quaternion, vector
from handover.plants.free_flyer.hand.attachment import Frame
from handover.plants.free_flyer.hand.finger_contact import HandFingers
from handover.plants.free_flyer.hand.gripper_contact import GripperSolids
from handover.plants.free_flyer.hand.hand_and_object import Activity, HandAndObject, Holder, Inputs


def test_gripper_follows_its_command_at_its_rate_and_distinguishes_empty_from_full():
    scene = Scene(replace(IDLE, angle_0=0.60), np.array([0.5, 0.0, 0.0]))
    assert scene.go(0.48, closure=0.0).gripper_angle == pytest.approx(0.60 + 0.6 * 0.48)
    assert scene.go(1.0).gripper_angle == pytest.approx(1.20)
    assert scene.go(0.32, closure=1.0).gripper_angle == pytest.approx(1.2 - 0.6 * 0.32)
    assert scene.go(2.0).gripper_angle == pytest.approx(0.60)
    assert scene.go(2.0, closure=0.5).gripper_angle == pytest.approx(0.90)
    assert {y.holder for y in scene.seen} == {Holder.FREE}
    held = Scene(IDLE).go(2.0, closure=1.0)
    assert held.gripper_angle == pytest.approx(0.60 + 0.60 * 0.017 / 0.055)
    assert held.holder is Holder.GRIPPER


def test_gripper_that_starts_at_the_object_takes_it_by_closing():
    for closure, holder in ((0.0, Holder.FREE), (1.0, Holder.GRIPPER)):
        scene = Scene(replace(IDLE, angle_0=IDLE.angle_object))
        assert scene.go(1.0, closure=closure).holder is holder
    assert scene.y.gripper_angle == IDLE.angle_object


def test_object_comes_free_when_the_fingers_are_open_enough_and_not_when_they_close_before():
    scene = Scene(IDLE)
    closed = scene.go(2.0, closure=1.0).gripper_angle
    scene.go(0.2, closure=0.0)
    assert scene.go(1.0, closure=1.0).holder is Holder.GRIPPER
    assert scene.y.gripper_angle == closed
    while scene.go(DT, closure=0.0).holder is Holder.GRIPPER:
        assert scene.y.gripper_angle <= closed + 0.2 + 1e-9
    assert scene.y.gripper_angle > closed + 0.2


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


def test_a_gripped_object_is_carried_in_position_and_attitude():
    scene = Scene(IDLE)
    scene.go(2.0, closure=1.0)
    turn = np.array([0.0, 0.0, 0.3])
    for i in range(1, 251):  # a turn about G, and a way along y
        q = Rotation.from_rotvec(turn * i * DT).as_quat(scalar_first=True)
        scene.go(DT, q_WG=q, w_WG=turn, v_WG=np.array([0.0, 0.05, 0.0]))
    R = Rotation.from_quat(scene.u.q_WG, scalar_first=True)
    np.testing.assert_allclose(scene.y.p_WO, scene.u.p_WG + R.apply([0.0, 0.07, 0.0]), atol=5e-4)
    assert abs(scene.y.q_WO @ scene.u.q_WG) > math.cos(0.5 * 2e-3)
    inwards = -0.1 * 0.3**2 * R.apply([0.0, 0.07, 0.0])  # the force that keeps the centre on its circle
    np.testing.assert_allclose(scene.y.f_G, -inwards, atol=2e-5)


def test_an_object_held_beside_the_fingers_middle_resists_with_force_and_torque_and_is_drawn_there():
    scene, a = Scene(replace(IDLE, centring_time=100.0), off(0.02, z=0.01)), np.array([0.3, 0.0, 0.4])
    scene.go(1.0, closure=1.0)
    for i in range(1, 126):
        scene.go(DT, v_WG=DT * i * a)
    np.testing.assert_allclose(scene.y.f_G, -0.1 * a, rtol=1e-3, atol=1e-5)  # its inertia, acting at its centre
    p_GO = scene.y.p_WO - scene.u.p_WG
    np.testing.assert_allclose(scene.y.tau_G, np.cross(p_GO, -0.1 * a), atol=2e-5)
    assert np.linalg.norm(p_GO[[0, 2]]) > 0.015
    centred = Scene(IDLE, off(0.02, z=0.01))
    np.testing.assert_allclose(centred.go(10.0, closure=1.0).p_WO[[0, 2]], [0.02, 0.01], atol=1e-6)
    assert max(float(np.linalg.norm(y.f_G)) for y in centred.seen) < 0.5


def test_grip_slides_at_its_limit_and_loses_what_slides_too_far():
    upwards = np.array([0.0, 0.0, 1.0])
    scene = called(
        replace(CALM, grip_force_max=1.0, grip_torque_max=50.0, arm_force_max=100.0, pull_direction=upwards),
        Activity.WITHDRAW,
    )
    pull = [y.f_G[2] for y in scene.seen if y.holder is Holder.BOTH]
    assert max(pull) == pytest.approx(1.0, rel=0.02)
    assert max(np.linalg.norm(y.f_G) for y in scene.seen) < 1.05
    slipped = next(y for y in scene.seen if y.activity is Activity.PULL and y.holder is Holder.HAND)
    assert slipped.p_WO[2] > 0.02  # the fingers reach 2 cm along z


def test_arm_gives_in_at_the_force_that_a_person_cares_to_exert():
    scene = called(replace(CALM, arm_force_max=1.5, wrist_torque_max=50.0, pull_direction=np.array([0.0, 0.0, 1.0])))
    assert scene.go(3.0).holder is Holder.BOTH
    assert max(float(np.linalg.norm(y.f_H)) for y in scene.seen) == pytest.approx(1.5, rel=0.03)
    np.testing.assert_allclose(scene.y.f_H, [0.0, 0.0, -1.5], atol=0.05)
    np.testing.assert_allclose(scene.y.f_G, -scene.y.f_H, atol=1e-3)


def test_torque_on_the_gripper_balances_the_hand_at_the_other_end():
    scene = called(replace(CALM, pull_distance=0.005, patience=100.0, wrist_torque_max=50.0))
    y = scene.go(8.0)
    wrist = y.tau_G + np.cross(y.p_WH - scene.u.p_WG, -y.f_G)  # of the grip's force, about the hand
    turned = Rotation.from_quat(y.q_WO, scalar_first=True).as_rotvec()
    np.testing.assert_allclose(wrist, -2.5 * turned, atol=2e-3)  # hand's course is not turned
    assert np.linalg.norm(y.tau_G) > 0.01


def test_palm_pushes_an_object_away_but_never_holds_it():
    for width, z, pushed in ((IDLE.palm_width, 0.0, True), (0.4, 0.3, True), (0.25, 0.3, False)):
        scene = Scene(replace(IDLE, palm_width=width), off(0.05, z=z))
        scene.go(0.8, v_WG=np.array([-0.1, 0.0, 0.0]))  # the robot drives its palm into the object's end
        assert (scene.y.v_WO[0] < -0.02) == pushed
        assert (max(y.f_G[0] for y in scene.seen) > 0.0) == pushed
        assert min(y.f_G[0] for y in scene.seen) == 0.0
        assert -DT * sum(y.f_G[0] for y in scene.seen) == pytest.approx(0.1 * scene.y.v_WO[0], rel=1e-9)


def test_a_grip_that_fades_slides_at_less_the_farther_it_has_opened():
    """Half open it holds half of its 5 N: a pull of the robot that takes more slides, and less does not."""
    for fades, force in ((False, 5.0), (True, 2.5)):
        scene = Scene(replace(IDLE, grip_fades=fades))
        closed = scene.go(2.0, closure=1.0).gripper_angle
        opened = (IDLE.angle_open - closed - 0.1) / (IDLE.angle_open - IDLE.angle_empty)
        assert scene.go(1.0, closure=opened).gripper_angle == pytest.approx(closed + 0.1)
        y = scene.go(DT, v_WG=np.array([0.0, 1.0, 0.0]))  # 0.1 kg to 1 m/s in a step takes more than 5 N
        assert y.holder is Holder.GRIPPER
        assert np.linalg.norm(y.f_G) == pytest.approx(force, rel=0.05)


def test_a_fading_grip_is_restored_with_what_it_holds():
    def inputs(n: int) -> Inputs:
        v = np.array([0.0, 0.0, 0.5 if n >= 135 else 0.0])
        return Inputs(p_WG=PLACE + max(0, n - 135) * DT * v, v_WG=v, closure=float(n < 125))

    fading = HandAndObject(replace(IDLE, grip_fades=True))
    held = [fading.step(n * DT, DT, inputs(n)) for n in range(137)][-1]
    assert held.holder is Holder.GRIPPER
    assert np.linalg.norm(held.f_G) > 0.1
    assert_continues(lambda: HandAndObject(replace(IDLE, grip_fades=True)), inputs, [125, 135], 12)


def test_fingers_press_on_the_corner_of_a_wide_palm():
    wide = replace(IDLE, palm_width=0.5)
    inwards = np.column_stack([[0.0, -1.0, -1.0], [0.0, -1.0, 1.0], [-math.sqrt(2.0), 0.0, 0.0]]) / math.sqrt(2.0)
    q = quaternion(Rotation.from_matrix(inwards).as_quat(scalar_first=True))
    for beyond, meets in ((0.06, True), (0.12, False)):  # along the diagonal, of fingers that point to its middle
        p = (wide.palm_depth + 0.036 - 0.005, 0.5 + beyond / math.sqrt(2.0), 0.5 + beyond / math.sqrt(2.0))
        bones = HandFingers(vector(wide.object_size), wide.finger_rate).bones()
        f, _ = GripperSolids(wide).press(bones, Frame(p, q), Frame(ZERO, IDENTITY), wide.angle_open)
        assert (f[0] > 0.5) is meets
