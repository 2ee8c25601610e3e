import numpy as np
import pytest
from scipy.optimize import NonlinearConstraint, minimize

from handover.controllers.helix.servo.constant_curvature import forward_kinematics, linearise
from handover.controllers.helix.servo.estimation import StateEstimate, optimise_state
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
    for _ in range(200):
        q_sys, X_meas = sagged_pose(rng)
        found = estimate(q_sys, X_meas, bound)
        assert found.converged
        assert np.linalg.norm(forward_kinematics(found.q_est, D_GRIPPER) - X_meas) == pytest.approx(bound, abs=1e-9)


def test_the_estimate_is_a_stationary_point():
    rng = np.random.default_rng(4)
    for _ in range(50):
        q_sys, X_meas = sagged_pose(rng)
        q = estimate(q_sys, X_meas).q_est
        X, J = linearise(q, D_GRIPPER)
        descent = A_POSE**2 * (q_sys - q)
        constraint = (X - X_meas) @ J
        cosine = descent @ constraint / np.linalg.norm(descent) / np.linalg.norm(constraint)
        assert cosine == pytest.approx(1.0, abs=1e-9)


def test_a_general_optimiser_finds_the_same_estimate():
    rng = np.random.default_rng(5)
    for _ in range(20):
        q_sys, X_meas = sagged_pose(rng)

        def cost(q: Floats, q_sys: Floats = q_sys) -> float:
            return float(np.sum((A_POSE * (q - q_sys)) ** 2))

        def slope(q: Floats, q_sys: Floats = q_sys) -> Floats:
            return 2 * A_POSE**2 * (q - q_sys)

        def miss(q: Floats, X_meas: Floats = X_meas) -> list[float]:
            return [100 * float(np.linalg.norm(forward_kinematics(q, D_GRIPPER) - X_meas))]

        def miss_slope(q: Floats, X_meas: Floats = X_meas) -> Floats:
            X, J = linearise(q, D_GRIPPER)
            return 100 * ((X - X_meas) @ J / np.linalg.norm(X - X_meas))[np.newaxis]

        bound = NonlinearConstraint(miss, -np.inf, 0.5, jac=miss_slope)
        general = minimize(
            cost, q_sys, jac=slope, method="SLSQP", constraints=bound, options={"ftol": 1e-12, "maxiter": 300}
        )
        found = estimate(q_sys, X_meas).q_est
        assert general.success
        assert cost(found) == pytest.approx(float(general.fun), rel=1e-9)
        np.testing.assert_allclose(found, general.x, atol=1e-5)


def test_an_arm_that_follows_its_command_is_estimated_as_commanded():
    q_sys, _ = sagged_pose(np.random.default_rng(6))
    X_meas = forward_kinematics(q_sys, D_GRIPPER) + 0.004 / np.sqrt(6)
    np.testing.assert_array_equal(estimate(q_sys, X_meas).q_est, q_sys)


def test_a_heavier_weight_keeps_a_state_nearer_to_the_command():
    q_sys, X_meas = sagged_pose(np.random.default_rng(7))
    heavy = np.array([1, 1, 1, 1, 1, 1, 30, 30, 30.0])
    found = optimise_state(q_sys, X_meas, q_sys, A=heavy, bound=0.005, d_gripper=D_GRIPPER)
    assert found.converged
    last = slice(6, 9)
    near, far = found.q_est[last] - q_sys[last], estimate(q_sys, X_meas).q_est[last] - q_sys[last]
    assert np.linalg.norm(near) < 0.1 * np.linalg.norm(far)


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


def test_a_gripper_that_points_away_at_first_is_followed():
    q_sys = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])
    X_meas = forward_kinematics(np.array([0.3, 0, 0.12, 0.9, 0.2, 0.24, 1.2, -0.3, 0.24]), D_GRIPPER)
    found = estimate(q_sys, X_meas)
    assert found.converged
    assert np.linalg.norm(forward_kinematics(found.q_est, D_GRIPPER) - X_meas) <= 0.005 + 1e-9
