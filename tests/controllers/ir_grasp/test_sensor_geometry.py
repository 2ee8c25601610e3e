"""The reflex's model of its hand against the hand of the scene, and equation (11)."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handover.controllers.ir_grasp.parameters import Params
from handover.controllers.ir_grasp.sensor_geometry import Calibration, nominal_jacobian, sensor_poses, surface_points
from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.actuation import PULLEYS, STIFFNESS, resting_posture
from handover.plants.ir_grasp.hand import sensor_rays
from handover.plants.ir_grasp.parameters import Params as SceneParams

SCENE = SceneParams()


def rays(sigma: float, p_WH: tuple[float, float] = (0.0, 0.0), yaw: float = 0.0):
    return sensor_rays(np.array(p_WH), yaw, resting_posture(sigma, SCENE.tendon_stiffness, SCENE.tendon_travel))


@pytest.mark.parametrize("sigma", [0.0, 0.1, 0.35, 0.6])
def test_sensors_are_where_the_free_hand_has_them(sigma: float):
    p, n, _ = sensor_poses(sigma)
    origins, directions = rays(sigma)
    assert np.max(np.abs(p - origins)) < 1.0e-3
    assert np.max(np.abs(n - directions)) < 0.02


@pytest.mark.parametrize("sigma", [0.03, 0.12, 0.33])
def test_the_jacobian_is_that_of_walls_that_are_met_squarely(sigma: float):
    d0 = 0.03
    origins, directions = rays(sigma)
    walls = np.sum((origins + d0 * directions) * directions, axis=1)  # n . x = wall

    def distances(ahead: float, left: float, yaw: float, closing: float) -> Floats:
        o, n = rays(sigma + closing, (ahead, left), yaw)
        return (walls - np.sum(o * directions, axis=1)) / np.sum(n * directions, axis=1)

    h = 1e-4
    steps = h * np.eye(4)
    J = np.column_stack([(distances(*step) - distances(*(-step))) / (2.0 * h) for step in steps])
    assert np.max(np.abs(nominal_jacobian(sigma) - J)) < 0.02


def test_a_surface_point_lies_at_its_distance_along_the_beam():
    points = surface_points(0.1, np.array([0.01, 0.02, 0.03]))
    p, n, _ = sensor_poses(0.1)
    assert np.linalg.norm(points - p, axis=1) == pytest.approx([0.01, 0.02, 0.03])
    assert np.sum((points - p) * n, axis=1) == pytest.approx([0.01, 0.02, 0.03])


def test_the_free_hands_tension_is_that_of_the_tendons_law():
    compliance = float(np.sum(PULLEYS**2 / STIFFNESS)) + 1.0 / SCENE.tendon_stiffness
    assert Params().free_tension == pytest.approx(SCENE.tendon_travel / compliance, rel=1e-3)


CURVE = Calibration(0.062, -0.0030, 0.022, -0.00043)


def test_the_distance_is_equation_11():
    assert CURVE.distance(0.0) == pytest.approx(0.084)
    assert CURVE.distance(1000.0) == pytest.approx(0.062 * math.exp(-3.0) + 0.022 * math.exp(-0.43))
    assert CURVE.distance(4095.0) < 0.004 < 0.065 < CURVE.distance(0.0)


@given(st.floats(0.0, 4095.0))
def test_ticks_are_the_inverse_of_the_distance_and_distances_beyond_the_curve_are_at_its_ends(x: float):
    assert CURVE.ticks(CURVE.distance(x)) == pytest.approx(x, abs=1e-6)
    assert (CURVE.ticks(1.0), CURVE.ticks(0.0)) == pytest.approx((0.0, 4095.0))


def test_a_curve_that_does_not_fall_is_refused():
    assert CURVE.faults() == []
    assert [fault[:2] for fault in Calibration(-0.062, 0.003, 0.022, -0.00043).faults()] == ["a ", "b "]
