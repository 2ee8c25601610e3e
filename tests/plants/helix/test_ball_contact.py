"""The ball's contacts, against the laws of mechanics in cases that can be solved by hand."""

import math
import subprocess
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.plants.partner_runs import DOWN, P_WO, STILL, beside, lift, take, taken
from support.processes import with_path

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.gripper_fingers import finger_joints
from handover.plants.helix.hand.ball_contact import CAPSULES, advance
from handover.plants.helix.hand.handover_partner import HandoverPartner
from handover.plants.helix.hand.held_ball import HeldBall, numbers_of
from handover.plants.helix.hand.partner_parameters import Holder, Params

G, M, R = 9.81, STILL.ball_mass, STILL.ball_radius
NO_GRIPPER = np.full((CAPSULES, 2, 3), 9.0)


def rolled(ball: Floats, seconds: float, h: float = 5e-5, **changes: Any) -> tuple[Floats, Floats]:
    """Return what becomes of a ball on a hand that is held hard, and the last means of the forces."""
    values: dict[str, Any] = {"palm_stiffness": 1e4, "dissipation": 0.0, "hold_stiffness": 1e4, "hold_damping": 200.0}
    numbers = tuple(numbers_of(replace(Params(), **values | changes)))
    ball, forces = np.array(ball), np.zeros((2, 3))
    sag = M * G / values["palm_stiffness"]
    hand, bottom = np.zeros((2, 3)), np.array([0.0, 0.0, sag - R])
    still = np.zeros_like(NO_GRIPPER)
    xi = np.zeros((CAPSULES + 2, 3))
    steps = round(seconds / h)
    moved = (numbers, ball, hand, xi, np.array(NO_GRIPPER), still, np.zeros(CAPSULES), bottom, np.zeros(3))
    advance(*moved, 0.0, h, steps, forces, np.zeros(2))
    return ball, forces


def test_a_ball_that_slides_is_slowed_by_friction_and_then_rolls_with_five_sevenths_of_its_speed():
    flat = {"cup_radius": 10.0, "cup_angle": 0.5, "palm_friction": 0.3, "palm_rolling_friction": 0.0}
    start = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.0, 0.0]])
    sliding = 2.0 / 7.0 * 0.3 / (0.3 * G)  # until it rolls
    early, _ = rolled(start, 0.5 * sliding, **flat)
    assert early[1, 0] == pytest.approx(0.3 - 0.3 * G * 0.5 * sliding, rel=0.02)
    late, _ = rolled(start, 0.2, **flat)
    assert late[1, 0] == pytest.approx(5.0 / 7.0 * 0.3, rel=0.02)
    assert late[2, 1] * R == pytest.approx(late[1, 0], rel=0.02)


def test_a_ball_rolls_in_the_cup_like_a_pendulum():
    cup = {"cup_radius": 0.5, "cup_angle": 0.5, "palm_friction": 1.0, "palm_rolling_friction": 0.0}
    rate = math.sqrt(5.0 / 7.0 * G / (0.5 - R))
    start = np.array([[0.02, 0.0, 0.02**2 / 2 / (0.5 - R)], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    quarter, _ = rolled(start, 0.5 * math.pi / rate, **cup)
    assert quarter[0, 0] == pytest.approx(0.0, abs=0.02 * 0.05)
    assert quarter[1, 0] == pytest.approx(-0.02 * rate, rel=0.05)


def test_soft_skin_keeps_a_ball_from_rolling_until_its_pressure_is_at_the_edge():
    flat = {"cup_radius": 10.0, "cup_angle": 0.5, "palm_friction": 1.0, "palm_rolling_friction": 0.2}
    start = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 4.0, 0.0]])  # it rolls
    slowed, _ = rolled(start, 0.02, **flat)
    deceleration = 5.0 / 7.0 * 0.2 * G  # I_contact w' = mu_r r m g, 7/5 m r^2 w' = mu_r r m g
    assert slowed[1, 0] == pytest.approx(0.1 - deceleration * 0.02, rel=0.1)
    rested, _ = rolled(start, 1.0, **flat)
    np.testing.assert_allclose(rested[1:], np.zeros((2, 3)), atol=1e-4)


def test_a_dropped_ball_bounces_to_no_more_than_its_height():
    start = np.array([[0.0, 0.0, 0.05], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    hard = {"hold_stiffness": 1e4, "hand_mass": 5.0}
    elastic, damped = (
        max(rolled(start, 0.01 * i, dissipation=d, **hard)[0][0, 2] for i in range(11, 40)) for d in (0.0, 1.0)
    )
    assert 0.045 < elastic <= 0.0502
    assert damped < 0.6 * elastic


def test_what_pushes_gripper_and_hand_pushes_the_ball_back():
    """Momentum of the ball during a grasp: of its weight, and of minus the forces that are reported."""
    ball, impulse = HeldBall(STILL), np.zeros(3)
    ball.lie(P_WO, np.zeros(3))
    for i in range(100):
        p_WG, grip = beside(0.008, 0.003, 0.002), min(1.0, i * 0.02)
        contact = ball.move(p_WG, DOWN.as_matrix(), grip, P_WO, STILL.hold_force, 0.02)
        impulse -= 0.02 * (contact.f_G + contact.f_H + np.array([0.0, 0.0, M * G]))
        np.testing.assert_allclose(impulse, M * ball.v_WO, atol=1e-9)


def test_a_ball_that_lies_in_the_hand_stays_where_it_is():
    ball = HeldBall(STILL)
    ball.lie(P_WO, np.zeros(3))
    *_, contact = [ball.move(np.zeros(3), DOWN.as_matrix(), 0.0, P_WO, STILL.hold_force, 0.02) for _ in range(50)]
    np.testing.assert_allclose(ball.p_WO, P_WO, atol=1e-9)
    np.testing.assert_allclose(contact.f_H, [0.0, 0.0, -M * G], atol=1e-6)
    assert contact.by_hand == pytest.approx(M * G + STILL.hold_force)
    assert contact.by_gripper == 0.0


def test_a_closed_gripper_holds_a_ball_by_friction_alone_and_one_too_heavy_slips_through():
    y = lift(taken())
    assert y.holder is Holder.GRIPPER
    np.testing.assert_allclose(y.f_G, [0.0, 0.0, -M * G], atol=0.01)
    np.testing.assert_allclose(y.p_WO, beside(0.0, 0.0, 0.198), atol=0.004)
    assert lift(taken(ball_mass=0.5, force_max=20.0)).holder is Holder.FREE


def test_fingers_centre_a_ball_beside_their_axis():
    aside = np.array([0.01, 0.0, 0.0])
    y = take(HandoverPartner(STILL), P_WO + aside)[-1]
    assert y.holder is Holder.GRIPPER
    assert np.linalg.norm((y.p_WO - P_WO - aside)[:2]) < 0.003


def test_the_result_does_not_depend_on_how_the_time_is_cut():
    ends = [take(HandoverPartner(STILL), beside(0.004, 0.0, 0.0), dt=dt)[-1].p_WO for dt in (0.02, 0.01)]
    np.testing.assert_allclose(ends[0], ends[1], atol=3e-4)


@pytest.mark.parametrize(
    "changes",
    [
        {"ball_mass": 0.001, "palm_stiffness": 1e4},
        {"ball_mass": 0.001, "finger_stiffness": 1e4},
        {"hand_mass": 0.05, "hold_damping": 200.0},
    ],
)
def test_a_light_ball_on_stiff_skin_and_a_light_hand_do_not_fly_off(changes: dict[str, Any]):
    ball = HeldBall(replace(STILL, **changes))
    ball.lie(P_WO, np.zeros(3))
    for i in range(200):
        place = P_WO + 1e-3 * np.array([math.sin(0.5 * i), 0.0, math.sin(0.3 * i)])  # the hand trembles
        contact = ball.move(beside(0.004, 0.0, 0.0), DOWN.as_matrix(), min(1.0, i * 0.01), place, 1.0, 0.01)
        assert np.linalg.norm(ball.p_WO - place) < 0.02
        assert np.linalg.norm(contact.f_H) < 5.0


def test_fingers_are_where_they_are_painted_and_mirror_nothing():
    joints = finger_joints(np.array([1.0, 2.0, 3.0]), DOWN.as_matrix(), 0.5)
    assert joints.shape == (3, 3, 3)
    seen = (joints - [1.0, 2.0, 3.0]) @ DOWN.as_matrix()  # in G
    np.testing.assert_allclose(np.hypot(seen[..., 0], seen[..., 1]), np.tile([0.012, 0.0365, 0.038], (3, 1)))
    np.testing.assert_allclose(seen[..., 2], np.tile([-0.048, -0.022, 0.011], (3, 1)))
    np.testing.assert_allclose(np.degrees(np.arctan2(seen[:, 2, 1], seen[:, 2, 0])) % 360.0, [60.0, 180.0, 300.0])


@pytest.mark.slow
def test_plain_python_gives_the_same_grasp():
    script = (
        "from support.plants.partner_runs import *\ny = take(HandoverPartner(STILL), beside(0.004, 0.0, 0.0))[-1]\n"
    )
    call, env = [sys.executable, "-c", f"{script}print(*y.p_WO, *y.f_G)"], with_path() | {"HANDOVER_COMPILE": "0"}
    done = subprocess.run(call, env=env, capture_output=True, text=True, check=True)
    y = take(HandoverPartner(STILL), beside(0.004, 0.0, 0.0))[-1]
    np.testing.assert_allclose([float(x) for x in done.stdout.split()], [*y.p_WO, *y.f_G], atol=1e-6)
