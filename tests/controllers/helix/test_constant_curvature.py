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
    return Rotation.from_rotvec([-Dy, Dx, 0.0]).as_matrix(), l * np.array([A * Dx, A * Dy, S])


@given(states)
def test_the_pose_is_the_product_of_the_segments_transforms(q: Floats):
    p, R = np.zeros(3), np.eye(3)
    for Dx, Dy, l in q.reshape(3, 3).tolist():
        R_segment, t = segment_transform(Dx, Dy, l)
        p, R = p + R @ t, R @ R_segment
    X = np.concatenate([p, p + D_GRIPPER * R[:, 2]])
    np.testing.assert_allclose(forward_kinematics(q, D_GRIPPER), X, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(linearise(q, D_GRIPPER)[0], forward_kinematics(q, D_GRIPPER))
    np.testing.assert_allclose(orientation(q), R, rtol=0, atol=1e-12)


@given(states, st.sampled_from([0.0, 1e-9, 1e-5, 1e-3, 0.03, 0.2, 1.0]))
def test_the_jacobian_is_the_derivative(q: Floats, bend: float):
    q, h = q * np.tile([bend, bend, 1.0], 3), 1e-5 * np.eye(9)
    columns = [(forward_kinematics(q + e, D_GRIPPER) - forward_kinematics(q - e, D_GRIPPER)) / 2e-5 for e in h]
    np.testing.assert_allclose(linearise(q, D_GRIPPER)[1], np.column_stack(columns), rtol=0, atol=1e-9)


@pytest.mark.parametrize("bend", [(0.0, 0.0), (0.7, 0.0), (-0.4, 1.2)])
def test_a_tendon_is_as_long_as_its_curve_beside_the_axis(bend: tuple[float, float]):
    Dx, Dy = bend
    l = 0.24
    computed = tendon_lengths(np.array([Dx, Dy, l] * 3), D_TENDON).reshape(3, 3)
    for k in range(3):
        angle = 2 * np.pi * k / 3
        beside = D_TENDON * np.array([np.cos(angle), np.sin(angle), 0.0])
        curve = [R @ beside + t for R, t in (segment_transform(Dx * s, Dy * s, l * s) for s in np.linspace(0, 1, 601))]
        length = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
        np.testing.assert_allclose(computed[:, k], length, atol=1e-7)


@given(states)
def test_tendon_lengths_are_those_of_one_state(q: Floats):
    np.testing.assert_allclose(state_of(tendon_lengths(q, D_TENDON), D_TENDON), q, rtol=0, atol=1e-13)
