import numpy as np
import pytest

from handover.controllers.helix.servo.estimation import InvalidMeasurement, PositionFilter

HERE, THERE = np.array([0.1, -0.2, -0.6]), np.array([0.3, 0.1, -0.5])


@pytest.mark.parametrize(("Q", "R"), [(0.1, 0.01), (0.01, 0.1), (0.1, 0.1)])
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


def test_only_the_ratio_of_Q_and_R_acts_on_the_position():
    rng = np.random.default_rng(1)
    paper, millimetres = PositionFilter("ball", HERE, 2000.0, 0.01, 0.1), PositionFilter("ball", HERE, 2e-2, 1e-7, 1e-6)
    for X_new in rng.normal(THERE, 0.002, (20, 3)):
        for f in (paper, millimetres):
            f.predict()
            f.update(X_new)
    np.testing.assert_allclose(paper.position, millimetres.position, rtol=1e-12)


def test_the_first_measurement_is_taken_as_it_is():
    f = PositionFilter("ball", HERE, 2000.0, 0.1, 0.01)
    f.predict()
    f.update(THERE)
    np.testing.assert_allclose(f.position, THERE, atol=1e-5)


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


def test_a_measurement_that_is_not_finite_is_refused_and_changes_nothing():
    f = PositionFilter("ball", HERE, 1.0, 0.1, 0.1)
    with pytest.raises(InvalidMeasurement, match=r"of the ball is not finite; .* `seen`"):
        f.update(np.array([0.1, np.nan, 0.0]))
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
