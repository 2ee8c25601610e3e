import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from handover.controllers.helix.servo.constant_curvature import (
    forward_kinematics,
    linearise,
    orientation,
    state_of,
    tendon_lengths,
)
from handover.cosim.blocks.ports import Floats

D_GRIPPER, D_TENDON = 0.10, 0.035
angles = st.floats(-np.pi / 2, np.pi / 2)
lengths = st.floats(0.08, 0.3)
states = st.lists(st.tuples(angles, angles, lengths), min_size=3, max_size=3).map(lambda s: np.array(s).ravel())


def segment_transform(Dx: float, Dy: float, l: float) -> tuple[Floats, Floats]:
    """Return rotation (3, 3) and translation (3,), in m, from a segment's end to its start, eqs. (4) and (5)."""
    D = np.hypot(Dx, Dy)
    A, S = 0.5 * np.sinc(D / (2 * np.pi)) ** 2, np.sinc(D / np.pi)
    R = [[1 - A * Dx**2, -A * Dx * Dy, S * Dx], [-A * Dx * Dy, 1 - A * Dy**2, S * Dy], [-S * Dx, -S * Dy, np.cos(D)]]
    return np.array(R), l * np.array([A * Dx, A * Dy, S])


@given(angles, angles, lengths)
def test_a_segment_turns_by_D_about_an_axis_across_its_own(Dx: float, Dy: float, l: float):
    R, _ = segment_transform(Dx, Dy, l)
    np.testing.assert_allclose(R @ np.transpose(R), np.eye(3), rtol=0, atol=1e-14)
    np.testing.assert_allclose(R, Rotation.from_rotvec([-Dy, Dx, 0.0]).as_matrix(), rtol=0, atol=1e-14)


@given(angles, angles, lengths)
def test_a_segment_ends_where_its_tangent_leads(Dx: float, Dy: float, l: float):
    nodes, weights = np.polynomial.legendre.leggauss(20)
    along = [segment_transform(Dx * s, Dy * s, l)[0][:, 2] for s in (nodes + 1) / 2]
    np.testing.assert_allclose(segment_transform(Dx, Dy, l)[1], l * (weights / 2) @ np.array(along), rtol=0, atol=1e-13)


@given(states)
def test_the_pose_is_the_product_of_the_segments_transforms(q: Floats):
    T_B = np.eye(4)
    for Dx, Dy, l in q.reshape(3, 3).tolist():
        R, t = segment_transform(Dx, Dy, l)
        np.matmul(T_B, np.vstack([np.column_stack([R, t]), [0, 0, 0, 1]]), out=T_B)
    X = np.concatenate([T_B[:3, 3], T_B[:3, 3] + D_GRIPPER * T_B[:3, 2]])
    np.testing.assert_allclose(forward_kinematics(q, D_GRIPPER), X, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(linearise(q, D_GRIPPER)[0], forward_kinematics(q, D_GRIPPER))


def test_the_calibrated_arm_hangs_straight():
    q = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])
    np.testing.assert_allclose(forward_kinematics(q, D_GRIPPER), [0, 0, 0.6, 0, 0, 0.7], atol=1e-15)
    np.testing.assert_allclose(tendon_lengths(q, D_TENDON), np.repeat([0.12, 0.24, 0.24], 3))


@given(states, st.sampled_from([0.0, 1e-9, 1e-5, 1e-3, 0.03, 0.2, 1.0]))
def test_the_jacobian_is_the_derivative(q: Floats, bend: float):
    q = q * np.tile([bend, bend, 1.0], 3)
    h = 1e-5
    columns = [
        (forward_kinematics(q + h * e, D_GRIPPER) - forward_kinematics(q - h * e, D_GRIPPER)) / (2 * h)
        for e in np.eye(9)
    ]
    np.testing.assert_allclose(linearise(q, D_GRIPPER)[1], np.column_stack(columns), rtol=0, atol=1e-9)


@given(st.floats(-np.pi, np.pi))
def test_series_and_closed_form_meet(phi: float):
    def at(D: float) -> tuple[Floats, Floats]:
        return linearise(np.tile([D * np.cos(phi), D * np.sin(phi), 0.24], 3), D_GRIPPER)

    below, above = at(0.05 - 1e-14), at(0.05 + 1e-14)
    np.testing.assert_allclose(below[0], above[0], rtol=0, atol=3e-13)
    np.testing.assert_allclose(below[1], above[1], rtol=0, atol=3e-13)


@given(states)
def test_the_jacobian_has_rank_5_since_the_gripper_keeps_its_length(q: Floats):
    X, J = linearise(q, D_GRIPPER)
    s = np.linalg.svd(J, compute_uv=False)
    assert s[5] < 1e-12 < s[4]
    stretch = (X[3:] - X[:3]) / D_GRIPPER
    np.testing.assert_allclose(np.concatenate([stretch, -stretch]) @ J, 0.0, rtol=0, atol=1e-13)


@pytest.mark.parametrize("bend", [(0.0, 0.0), (0.7, 0.0), (-0.4, 1.2), (0.9, -0.9)])
def test_a_tendon_is_as_long_as_its_curve_beside_the_axis(bend: tuple[float, float]):
    Dx, Dy = bend
    l = 0.24
    computed = tendon_lengths(np.array([Dx, Dy, l] * 3), D_TENDON).reshape(3, 3)
    for k in range(3):
        angle = 2 * np.pi * k / 3
        beside = D_TENDON * np.array([np.cos(angle), np.sin(angle), 0.0])
        curve = [R @ beside + t for R, t in (segment_transform(Dx * s, Dy * s, l * s) for s in np.linspace(0, 1, 2001))]
        length = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
        np.testing.assert_allclose(computed[:, k], length, atol=1e-7)


@given(states)
def test_tendon_lengths_are_those_of_one_state(q: Floats):
    np.testing.assert_allclose(state_of(tendon_lengths(q, D_TENDON), D_TENDON), q, rtol=0, atol=1e-13)


@given(states)
def test_the_arm_s_end_points_to_its_gripper(q: Floats):
    X, R = forward_kinematics(q, D_GRIPPER), orientation(q)
    np.testing.assert_allclose(R[:, 2], (X[3:] - X[:3]) / D_GRIPPER, rtol=0, atol=1e-12)
    np.testing.assert_allclose(R @ np.transpose(R), np.eye(3), rtol=0, atol=1e-13)
