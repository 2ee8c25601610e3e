"""How the hand of the grasp scene is built, closes, and follows its wrist's command."""

import math

import numpy as np
import pytest

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.actuation import GEARS, PULLEYS, STIFFNESS, follow, resting_posture, tendon_excursion
from handover.plants.ir_grasp.hand import (
    FINGERS,
    JOINTS,
    PALM,
    SENSOR_PLACE,
    finger_points,
    palm_outline,
    sensor_rays,
)

BENT = np.array([0.3, 0.5, 0.2, 0.4, 0.1, 0.6, 0.2, 0.3])
ORIGIN = np.zeros(2)


def rotate(p: Floats, yaw: float) -> Floats:
    c, s = math.cos(yaw), math.sin(yaw)
    return p @ np.array([[c, s], [-s, c]])


def test_phalanges_have_their_lengths_and_begin_at_the_palm():
    for f, points in zip(FINGERS, finger_points(ORIGIN, 0.0, BENT), strict=True):
        np.testing.assert_allclose(np.linalg.norm(np.diff(points, axis=0), axis=1), f.lengths)
        np.testing.assert_allclose(points[0], f.base)


def test_thumb_is_on_the_right_and_bending_closes_the_hand():
    wide, closer = (np.array([p[-1] for p in finger_points(ORIGIN, 0.0, q)]) for q in (np.zeros(JOINTS), BENT))
    assert wide[0, 1] < -0.07
    assert min(wide[1:, 1]) > 0.07
    assert closer[0, 1] > wide[0, 1]
    assert all(closer[1:, 1] < wide[1:, 1])


def test_hand_moves_rigidly_with_the_wrist():
    p_WH, yaw = np.array([0.3, -0.2]), 0.7
    for here, there in zip(finger_points(ORIGIN, 0.0, BENT), finger_points(p_WH, yaw, BENT), strict=True):
        np.testing.assert_allclose(p_WH + rotate(here, yaw), there)
    np.testing.assert_allclose(p_WH + rotate(np.array(PALM), yaw), palm_outline(p_WH, yaw))
    origins, directions = sensor_rays(ORIGIN, 0.0, BENT)
    there, looking = sensor_rays(p_WH, yaw, BENT)
    np.testing.assert_allclose(p_WH + rotate(origins, yaw), there)
    np.testing.assert_allclose(rotate(directions, yaw), looking, atol=1e-15)


def test_sensors_lie_on_the_pads_and_look_square_to_them_inwards():
    origins, directions = sensor_rays(ORIGIN, 0.0, BENT)
    for f, points, o, d in zip(FINGERS, finger_points(ORIGIN, 0.0, BENT), origins, directions, strict=True):
        along = points[-1] - points[-2]
        assert np.linalg.norm(d) == pytest.approx(1.0)
        assert d @ along == pytest.approx(0.0, abs=1e-15)
        assert (o - points[-2]) @ d == pytest.approx(f.radii[-1])
        assert (o - points[-2]) @ along / f.lengths[-1] == pytest.approx(SENSOR_PLACE * f.lengths[-1])
    assert directions[0, 1] > 0.0
    assert max(directions[1:, 1]) < 0.0


@pytest.mark.parametrize("sigma", [0.0, 0.5])
def test_free_posture_balances_tendon_and_springs_up_to_the_joints_limits(sigma: float):
    q = resting_posture(sigma, 400.0, 0.094)
    T = sigma * 0.094 / (1.0 / 400.0 + float(np.sum(PULLEYS**2 / STIFFNESS)))
    np.testing.assert_allclose(q, PULLEYS * T / STIFFNESS, atol=1e-12)
    assert np.max(resting_posture(1.0, 2000.0, 0.3)) == 1.6


def test_tendon_taken_up_is_the_sum_over_the_joints():
    yaw, angles = 0.4, list[float]()
    for f, first in zip(FINGERS, (0, 2, 5), strict=True):
        q = BENT[first : first + len(f.lengths)]
        angles.extend(yaw + f.spread + f.flexion * np.cumsum(q, dtype=np.float64))
    assert tendon_excursion(angles, yaw) == pytest.approx(float(PULLEYS @ BENT), abs=1e-15)
    assert len(GEARS) == JOINTS


SPEED, ACCELERATION, LAG, DT = 0.3, 10.0, 0.02, 1e-3


def course(goal: tuple[float, float], steps: int, velocity: tuple[float, float] = (0.0, 0.0)) -> tuple[Floats, Floats]:
    x, y = 0.0, 0.0
    path, velocities = [(x, y)], [velocity]
    for _ in range(steps):
        velocity = follow((goal[0] - x, goal[1] - y), velocity, SPEED, ACCELERATION, LAG, DT)
        x, y = x + DT * velocity[0], y + DT * velocity[1]
        path.append((x, y))
        velocities.append(velocity)
    return np.array(path), np.array(velocities)


@pytest.mark.parametrize("goal", [(0.15, 0.0), (-0.03, 0.04), (1e-5, 0.0)])
def test_arrives_straight_within_its_limits_and_without_overshoot(goal: tuple[float, float]):
    path, v = course(goal, 1200)
    assert np.max(np.linalg.norm(v, axis=1)) <= SPEED * (1.0 + 1e-12)
    assert abs(goal[0]) < 0.1 or np.max(v[:, 0]) == pytest.approx(SPEED, rel=1e-9)
    assert np.max(np.linalg.norm(np.diff(v, axis=0), axis=1)) <= ACCELERATION * DT * (1.0 + 1e-9)
    np.testing.assert_allclose(path[-1], goal, atol=1e-9)
    away = np.linalg.norm(np.array(goal) - path, axis=1)
    assert np.all(np.diff(away) <= 1e-12)
    assert np.max(np.abs(path @ np.array([-goal[1], goal[0]]))) < 1e-12


def test_settles_with_its_time_constant():
    path, _ = course((0.001, 0.0), 300)
    left = 0.001 - path[:, 0]
    assert left[200] / left[180] == pytest.approx((1.0 - DT / LAG) ** 20, rel=1e-6)


def test_brakes_from_a_motion_the_other_way():
    path, v = course((0.02, 0.0), 800, (-0.3, 0.1))
    assert np.max(np.linalg.norm(np.diff(v, axis=0), axis=1)) <= ACCELERATION * DT * (1.0 + 1e-9)
    assert np.min(path[:, 0]) > -(0.3**2) / (2.0 * ACCELERATION) * 1.3
    np.testing.assert_allclose(path[-1], (0.02, 0.0), atol=1e-9)


def test_stays_where_it_is_to_be():
    assert follow((0.0, 0.0), (0.0, 0.0), SPEED, ACCELERATION, LAG, DT) == (0.0, 0.0)
    assert math.hypot(*follow((0.0, 0.0), (0.1, 0.0), SPEED, ACCELERATION, LAG, DT)) == pytest.approx(0.09)
