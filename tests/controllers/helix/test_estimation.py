from typing import Any, cast

import numpy as np
import pytest
from scipy.optimize import NonlinearConstraint, minimize
from support.wording import Wording

from handover.controllers.helix.servo.constant_curvature import forward_kinematics, linearise
from handover.controllers.helix.servo.estimation import (
    InvalidMeasurement,
    PositionFilter,
    StateEstimate,
    optimise_state,
)
from handover.cosim.blocks.ports import Floats

D_GRIPPER = 0.10
A_POSE = np.repeat([1.0, 1.05, 1.1], 3)


def sagged_pose(rng: np.random.Generator) -> tuple[Floats, Floats]:
    """A command within the limits, and the pose of an arm that follows it by a third to nine tenths."""
    bend = np.sqrt(rng.uniform(size=3)) * [np.pi / 4, np.pi / 2, np.pi / 2]
    phi = rng.uniform(-np.pi, np.pi, 3)
    l = rng.uniform([0.08, 0.16, 0.16], [0.14, 0.26, 0.26])
    q_sys = np.column_stack([bend * np.cos(phi), bend * np.sin(phi), l])
    q_true = q_sys * np.column_stack([*[rng.uniform(0.3, 0.9, 3)] * 2, rng.uniform(0.95, 1.1, 3)])
    q_true[:, :2] += rng.normal(0.0, 0.1, (3, 2))
    return q_sys.ravel(), forward_kinematics(q_true.ravel(), D_GRIPPER)


def estimate(q_sys: Floats, X_meas: Floats, bound: float = 0.005, q_start: Floats | None = None) -> StateEstimate:
    start = q_sys if q_start is None else q_start
    return optimise_state(q_sys, X_meas, start, A=A_POSE, bound=bound, d_gripper=D_GRIPPER)


@pytest.mark.parametrize("bound", [0.005, 0.0005])
def test_the_estimate_lies_on_the_bound_around_the_measured_pose(bound: float):
    rng = np.random.default_rng(3)
    points_away_at_first = forward_kinematics(np.array([0.3, 0, 0.12, 0.9, 0.2, 0.24, 1.2, -0.3, 0.24]), D_GRIPPER)
    hanging = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])
    for q_sys, X_meas in ((hanging, points_away_at_first), *(sagged_pose(rng) for _ in range(80))):
        found = estimate(q_sys, X_meas, bound)
        assert found.converged
        assert np.linalg.norm(forward_kinematics(found.q_est, D_GRIPPER) - X_meas) == pytest.approx(bound, abs=1e-9)


def test_a_general_optimiser_finds_the_same_estimate():
    rng = np.random.default_rng(5)
    for _ in range(20):
        q_sys, X_meas = sagged_pose(rng)

        def cost(q: Floats, q_sys: Floats = q_sys) -> tuple[float, Floats]:
            return float(np.sum((A_POSE * (q - q_sys)) ** 2)), 2 * A_POSE**2 * (q - q_sys)

        def miss(q: Floats, X_meas: Floats = X_meas) -> list[float]:
            return [100 * float(np.linalg.norm(forward_kinematics(q, D_GRIPPER) - X_meas))]

        def miss_slope(q: Floats, X_meas: Floats = X_meas) -> Floats:
            X, J = linearise(q, D_GRIPPER)
            return 100 * ((X - X_meas) @ J / np.linalg.norm(X - X_meas))[np.newaxis]

        bound = NonlinearConstraint(miss, -np.inf, 0.5, jac=miss_slope)
        most: dict[str, Any] = {"ftol": 1e-12, "maxiter": 300}
        general: Any = cast("Any", minimize)(cost, q_sys, jac=True, method="SLSQP", constraints=bound, options=most)
        found = estimate(q_sys, X_meas).q_est
        assert general.success
        assert cost(found)[0] == pytest.approx(float(general.fun), rel=1e-9)
        np.testing.assert_allclose(found, general.x, atol=1e-5)


def test_an_arm_that_follows_its_command_is_estimated_as_commanded_and_else_as_the_weights_say():
    q_sys, X_meas = sagged_pose(np.random.default_rng(7))
    near = forward_kinematics(q_sys, D_GRIPPER) + 0.004 / np.sqrt(6)
    np.testing.assert_array_equal(estimate(q_sys, near).q_est, q_sys)
    heavy = np.array([1, 1, 1, 1, 1, 1, 30, 30, 30.0])
    found = optimise_state(q_sys, X_meas, q_sys, A=heavy, bound=0.005, d_gripper=D_GRIPPER)
    assert found.converged
    held, free = (q[6:] - q_sys[6:] for q in (found.q_est, estimate(q_sys, X_meas).q_est))
    assert np.linalg.norm(held) < 0.1 * np.linalg.norm(free)


def test_a_warm_start_comes_to_the_same_estimate_in_fewer_steps():
    rng = np.random.default_rng(8)
    cold_steps = warm_steps = 0
    for _ in range(30):
        q_sys, X_meas = sagged_pose(rng)
        cold = estimate(q_sys, X_meas)
        warm = estimate(q_sys, X_meas, q_start=cold.q_est + rng.normal(0.0, 0.01, 9))
        np.testing.assert_allclose(warm.q_est, cold.q_est, atol=1e-5)
        cold_steps, warm_steps = cold_steps + cold.iterations, warm_steps + warm.iterations
    assert warm_steps < cold_steps


HERE, THERE = np.array([0.1, -0.2, -0.6]), np.array([0.3, 0.1, -0.5])


@pytest.mark.parametrize(("Q", "R"), [(0.1, 0.01), (0.01, 0.1)])
def test_the_gain_settles_at_the_riccati_solution(Q: float, R: float):
    f = PositionFilter("ball", HERE, 2000.0, Q, R)
    for _ in range(200):
        f.predict()
        f.update(HERE)
    f.predict()
    f.update(THERE)
    r = Q / R
    gain = (np.sqrt(r * r + 4 * r) - r) / 2
    np.testing.assert_allclose(f.position - HERE, gain * (THERE - HERE), rtol=1e-12)
    np.testing.assert_allclose(f.covariance, gain * R * np.eye(3), rtol=1e-12)


def test_a_prediction_keeps_the_position_and_adds_Q():
    f = PositionFilter("ball", HERE, 1.0, 0.25, 0.1)
    f.predict()
    f.predict()
    np.testing.assert_array_equal(f.position, HERE)
    np.testing.assert_array_equal(f.covariance, 1.5 * np.eye(3))
    assert not f.seen


def test_covariances_add_as_information():
    f = PositionFilter("ball", HERE, 2.0, 0.1, 0.3)
    A = np.array([[1.0, 0.2, 0.0], [0.0, 0.5, 0.3], [0.1, 0.0, 2.0]])
    R = A @ np.transpose(A)
    f.update(THERE, R)
    P = np.linalg.inv(np.eye(3) / 2.0 + np.linalg.inv(R))
    np.testing.assert_allclose(f.covariance, P, atol=1e-14)
    np.testing.assert_allclose(f.position, P @ (HERE / 2.0 + np.linalg.solve(R, THERE)), atol=1e-14)


def test_a_measurement_that_is_not_finite_is_refused_and_changes_nothing(wording: Wording):
    f = PositionFilter("ball", HERE, 1.0, 0.1, 0.1)
    with pytest.raises(InvalidMeasurement) as caught:
        f.update(np.array([0.1, np.nan, 0.0]))
    wording.check(caught.value)
    np.testing.assert_array_equal(f.position, HERE)
    np.testing.assert_array_equal(f.covariance, np.eye(3))
    assert not f.seen


def test_a_filter_goes_on_from_another_ones_state():
    f, g = PositionFilter("ball", HERE, 2000.0, 0.01, 0.1), PositionFilter("ball", THERE, 2000.0, 0.01, 0.1)
    f.predict()
    f.update(THERE)
    g.set_state(f.get_state())
    for each in (f, g):
        each.predict()
        each.update(HERE)
    assert g.seen
    np.testing.assert_array_equal(f.position, g.position)
    np.testing.assert_array_equal(f.covariance, g.covariance)
