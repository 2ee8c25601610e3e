from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handover.controllers.helix.servo.constant_curvature import forward_kinematics
from handover.controllers.helix.servo.jacobian_control import ControlStep, Limits, blend, control_step, keep_limits
from handover.cosim.blocks.ports import Floats

D_GRIPPER = 0.10
LIMITS = Limits(
    LB=np.array([0.0, 0.08, 0.0, 0.16, 0.0, 0.16]),
    UB=np.array([np.pi / 4, 0.14, np.pi / 2, 0.26, np.pi / 2, 0.26]),
)
K = np.array([0.2, 0.2, 2, 0.1, 0.1, 1, 0.1, 0.1, 1])
Q_CALIB = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])
angles = st.floats(-4.0, 4.0)
states = st.lists(st.tuples(angles, angles, st.floats(-0.1, 0.5)), min_size=3, max_size=3).map(
    lambda s: np.array(s).ravel()
)


def within(q: Floats) -> bool:
    segments = q.reshape(3, 3)
    d = np.hypot(segments[:, 0], segments[:, 1])
    q_DL = np.column_stack([d, segments[:, 2]]).ravel()
    return bool(np.all(q_DL >= LIMITS.LB) and np.all(q_DL <= LIMITS.UB))


def go(q_sys: Floats, q_est: Floats, X_goal: Floats, X_meas: Floats, N_max_iter: int = 20) -> ControlStep:
    most: dict[str, Any] = {"epsilon_control": 0.005, "N_max_iter": N_max_iter}
    return control_step(q_sys, q_est, X_goal, X_meas, K=K, limits=LIMITS, d_gripper=D_GRIPPER, **most)


@given(states)
def test_limits_are_kept_exactly_and_signs_stay(q: Floats):
    cropped, K_inv = keep_limits(q, 1 / K, LIMITS)
    assert within(cropped)
    rotations = np.arange(9) % 3 != 2
    assert np.all((cropped * q)[rotations] >= 0.0)
    assert np.all(np.abs(cropped[rotations]) <= np.abs(q[rotations]))
    touched = ~np.isclose(K_inv * K, 1.0)
    np.testing.assert_array_equal(cropped[~touched], q[~touched])
    np.testing.assert_allclose(K_inv[touched], 0.01 / K[touched])
    again, K_inv = keep_limits(cropped, 1 / K, LIMITS)
    np.testing.assert_array_equal([again, K_inv], [cropped, 1 / K])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_component_of_greater_magnitude_is_cropped_and_two_that_exceed_the_bound_are_scaled_alike(sign: float):
    q = Q_CALIB + np.array([0, 0, 0, sign * 1.8, -0.5, 0, 0.3, sign * 1.7, 0])
    cropped, K_inv = keep_limits(q, 1 / K, LIMITS)
    assert cropped[3] == pytest.approx(sign * np.sqrt((np.pi / 2) ** 2 - 0.25))
    assert cropped[7] == pytest.approx(sign * np.sqrt((np.pi / 2) ** 2 - 0.09))
    assert (cropped[4], cropped[6]) == (-0.5, 0.3)
    np.testing.assert_allclose(K_inv * K, [1, 1, 1, 0.01, 1, 1, 1, 0.01, 1])
    cropped, K_inv = keep_limits(Q_CALIB + np.array([1.2, sign * 0.9, 0, 0, 0, 0, 0, 0, 0]), 1 / K, LIMITS)
    np.testing.assert_allclose(cropped[:2], np.pi / 4 * np.array([0.8, sign * 0.6]))
    np.testing.assert_allclose(K_inv * K, [0.01, 0.01, 1, 1, 1, 1, 1, 1, 1])


def test_the_blend_keeps_the_grippers_length():
    X_meas = forward_kinematics(Q_CALIB, D_GRIPPER)
    X_goal = forward_kinematics(np.array([0.5, 0, 0.12, 0.9, 0, 0.24, 0.5, 0, 0.24]), D_GRIPPER)
    X = blend(X_goal, X_meas, 0.4, D_GRIPPER)
    np.testing.assert_allclose(X[:3], 0.4 * X_goal[:3] + 0.6 * X_meas[:3])
    assert np.linalg.norm(X[3:] - X[:3]) == pytest.approx(D_GRIPPER, abs=1e-15)
    np.testing.assert_array_equal(blend(X_goal, X_meas, 1.0, D_GRIPPER)[:3], X_goal[:3])


@pytest.mark.parametrize("alpha", [0.4, 1.0])
def test_targets_are_reached_from_hanging_poses_within_the_limits(alpha: float):
    rng, reached = np.random.default_rng(1), 0
    for _ in range(100):
        q, _ = keep_limits(Q_CALIB + rng.normal(size=9) * np.tile([0.1, 0.1, 0.005], 3), 1 / K, LIMITS)
        bend, phi = 0.7 * np.sqrt(rng.uniform(size=3)) * LIMITS.UB[::2], rng.uniform(-np.pi, np.pi, 3)
        l = rng.uniform(LIMITS.LB[1::2], LIMITS.UB[1::2])
        X_target = forward_kinematics(np.column_stack([bend * np.cos(phi), bend * np.sin(phi), l]).ravel(), D_GRIPPER)
        X = forward_kinematics(q, D_GRIPPER)
        X_goal = blend(X_target, X, alpha, D_GRIPPER)
        got = go(q, q, X_goal, X)
        assert within(got.q_sys)
        missed = float(np.linalg.norm(forward_kinematics(got.q_est, D_GRIPPER) - X_goal))
        assert got.error == pytest.approx(missed, abs=1e-15)
        assert got.converged == (missed < 0.005)
        reached += got.converged
    assert reached >= 95


def test_estimate_and_command_move_alike():
    bent = np.array([0.1, 0, 0, 0.2, 0, 0, 0, 0, 0])
    q_sys, q_est = Q_CALIB + 2.5 * bent, Q_CALIB + 1.5 * bent
    X = forward_kinematics(q_est, D_GRIPPER)
    got = go(q_sys, q_est, X + np.array([0.02, 0.01, -0.01, 0.02, 0.01, -0.01]), X)
    np.testing.assert_allclose(got.q_est - q_est, got.q_sys - q_sys, atol=1e-14)
    assert np.abs(got.q_sys - q_sys).max() > 0.01


def test_out_of_reach_the_best_iterate_comes_back_and_says_so():
    X = forward_kinematics(Q_CALIB, D_GRIPPER)
    X_goal = X + np.array([0.8, 0, 0, 0.8, 0, 0])
    *shorter, got = (go(Q_CALIB, Q_CALIB, X_goal, X, n) for n in range(1, 21))
    assert not got.converged
    assert within(got.q_sys)
    assert got.error == pytest.approx(min(g.error for g in [*shorter, got]))
    assert got.error < np.linalg.norm(X_goal - X)
