import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.wording import Wording

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


def test_joint_velocities_move_the_tip():
    q, v = np.array([0.4, 0.6, -1.2]), np.array([0.05, -0.02, 0.1])
    qd, h = ARM.joint_velocities(q, v), 1e-6
    np.testing.assert_allclose((ARM.forward(q + h * qd) - ARM.forward(q - h * qd)) / (2 * h), v, atol=1e-9)


def test_elbow_is_where_it_is_commanded_to_be():
    p_WG = np.array([0.3, 0.1, 0.2])
    for elbow in Elbow:
        q = VslKinematics(0.15, 0.225, 0.225, elbow).inverse(p_WG)
        assert bool(0.15 + 0.225 * math.sin(q[1]) > (0.15 + p_WG[2]) / 2.0) is (elbow is Elbow.UP)
        assert bool(q[2] < 0.0) is (elbow is Elbow.UP)


def test_known_poses():
    np.testing.assert_allclose(ARM.forward(np.zeros(3)), [0.45, 0.0, 0.15])
    np.testing.assert_allclose(ARM.inverse(np.array([0.0, 0.225, 0.375])), [math.pi / 2, math.pi / 2, -math.pi / 2])
    np.testing.assert_allclose(ARM.inverse(np.array([0.45, 0.0, 0.15])), np.zeros(3), atol=1e-6)


def test_points_out_of_reach_or_singular_are_reported_with_what_is_in_reach(wording: Wording):
    for arm, p_WG in (
        (ARM, [0.4, 0.3, 0.15]),
        (UNEQUAL, [0.05, 0.0, 0.1]),
        (ARM, [0.0, 0.0, 0.15]),
        (UNEQUAL, [0.0, 0.0, 0.1]),
    ):
        with pytest.raises(Unreachable) as caught:
            arm.inverse(np.array(p_WG))
        np.testing.assert_array_equal(caught.value.p_WG, p_WG)
        wording.check(caught.value)
    for arm, p_WG in ((ARM, [0.4495, 0.0, 0.15]), (ARM, [0.0005, 0.0, 0.4]), (UNEQUAL, [0.1005, 0.0, 0.1])):
        wording.check(arm.singularity(np.array(p_WG), 0.001))
    assert ARM.singularity(np.array([0.3, 0.0, 0.15]), 0.001) is None
