import math

import numpy as np
import pytest

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.actuation import follow

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
