import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handover.controllers.vsl.kinematics import Elbow, Unreachable, VslKinematics

ARM = VslKinematics(0.15, 0.225, 0.225, Elbow.UP)
UNEQUAL = VslKinematics(0.1, 0.3, 0.2, Elbow.DOWN)

turns = st.floats(-3.1, 3.1)


@given(turns, st.floats(-1.0, 1.0), st.floats(0.05, 3.0), st.sampled_from([ARM, UNEQUAL]))
def test_inverse_undoes_forward(theta_1: float, theta_2: float, bend: float, arm: VslKinematics):
    q = np.array([theta_1, theta_2, -arm.elbow.sign * bend])
    p_WG = arm.forward(q)
    np.testing.assert_allclose(arm.forward(arm.inverse(p_WG)), p_WG, atol=1e-9)
    if arm.L_2 * math.cos(theta_2) + arm.L_3 * math.cos(theta_2 + q[2]) > 1e-3:  # the tip in front of J1, not behind
        found = arm.inverse(p_WG)
        np.testing.assert_allclose(np.cos(found - q), 1.0, atol=1e-9)


@given(turns, turns, turns, st.sampled_from([ARM, UNEQUAL]))
def test_jacobian_is_the_derivative_of_forward(theta_1: float, theta_2: float, theta_3: float, arm: VslKinematics):
    q, h = np.array([theta_1, theta_2, theta_3]), 1e-6
    columns = [(arm.forward(q + h * e) - arm.forward(q - h * e)) / (2.0 * h) for e in np.eye(3)]
    np.testing.assert_allclose(arm.jacobian(q), np.column_stack(columns), atol=1e-9)


def test_the_printed_jacobian_differs_only_off_the_plane_xz():
    def printed(q: list[float]) -> "np.ndarray[tuple[int, ...], np.dtype[np.float64]]":
        J, s1 = ARM.jacobian(np.array(q)), math.sin(q[0])
        J[1, 1] = s1 * (0.225 * math.sin(q[1]) + 0.225 * math.sin(q[1] + q[2]))
        J[1, 2] = -0.225 * s1 * math.cos(q[1] + q[2])
        return J

    np.testing.assert_array_equal(printed([0.0, 0.5, -1.0]), ARM.jacobian(np.array([0.0, 0.5, -1.0])))
    off = np.abs(printed([0.7, 0.8, -1.0]) - ARM.jacobian(np.array([0.7, 0.8, -1.0])))
    assert sorted(zip(*np.nonzero(off > 1e-3), strict=True)) == [(1, 1), (1, 2)]


def test_joint_velocities_move_the_tip():
    q, v = np.array([0.4, 0.6, -1.2]), np.array([0.05, -0.02, 0.1])
    qd, h = ARM.joint_velocities(q, v), 1e-6
    np.testing.assert_allclose((ARM.forward(q + h * qd) - ARM.forward(q - h * qd)) / (2 * h), v, atol=1e-9)


def test_elbow_is_where_it_is_commanded_to_be():
    p_WG = np.array([0.3, 0.1, 0.2])
    for elbow in Elbow:
        q = VslKinematics(0.15, 0.225, 0.225, elbow).inverse(p_WG)
        elbow_height = 0.15 + 0.225 * math.sin(q[1])
        middle = (0.15 + p_WG[2]) / 2.0
        assert bool(elbow_height > middle) is (elbow is Elbow.UP)
        assert bool(q[2] < 0.0) is (elbow is Elbow.UP)


def test_known_poses():
    np.testing.assert_allclose(ARM.forward(np.zeros(3)), [0.45, 0.0, 0.15])
    np.testing.assert_allclose(ARM.inverse(np.array([0.0, 0.225, 0.375])), [math.pi / 2, math.pi / 2, -math.pi / 2])
    np.testing.assert_allclose(ARM.inverse(np.array([0.45, 0.0, 0.15])), np.zeros(3), atol=1e-6)


@pytest.mark.parametrize(("p_WG", "text"), [([0.4, 0.3, 0.15], "0.5 m"), ([0.05, 0.0, 0.1], "0.05 m")])
def test_points_out_of_reach_are_reported_with_what_is_in_reach(p_WG: list[float], text: str):
    with pytest.raises(Unreachable, match=r"0\.1 \.\. 0\.5 m|0 \.\. 0\.45 m") as caught:
        (ARM if p_WG[1] else UNEQUAL).inverse(np.array(p_WG))
    assert text in str(caught.value)
    np.testing.assert_array_equal(caught.value.p_WG, p_WG)


def test_the_shoulder_itself_is_not_said_to_be_out_of_reach():
    with pytest.raises(Unreachable, match="singular: it is the shoulder itself, where the elbow is folded"):
        ARM.inverse(np.array([0.0, 0.0, 0.15]))
    with pytest.raises(Unreachable, match="out of reach: it is 0 m from the shoulder"):
        UNEQUAL.inverse(np.array([0.0, 0.0, 0.1]))


@pytest.mark.parametrize(
    ("p_WG", "text"),
    [
        ([0.4495, 0.0, 0.15], "stretched"),
        ([0.0005, 0.0, 0.4], "axis of joint 1"),
        ([0.1005, 0.0, 0.1], "folded"),
        ([0.3, 0.0, 0.15], None),
    ],
)
def test_singular_points_are_reported(p_WG: list[float], text: str | None):
    arm = UNEQUAL if text == "folded" else ARM
    fault = arm.singularity(np.array(p_WG), 0.001)
    assert (fault is None) if text is None else (fault is not None and text in fault)
