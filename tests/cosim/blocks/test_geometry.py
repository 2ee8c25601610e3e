"""Single rotations against SciPy, which is made for many, vectors against NumPy, and pinholes against OpenCV."""

import math

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.wording import Wording

from handover.cosim.blocks import plain_rotation as plain
from handover.cosim.blocks.geometry import (
    InvalidCalibration,
    Pinhole,
    looking_at,
    quaternion_of,
    rotation_angle,
    rotation_by,
    rotation_of,
    skew,
)
from handover.cosim.blocks.ports import Floats

RANDOM = np.random.default_rng(0)
HALF_TURNS = [np.eye(4)[k] * sign for k in range(4) for sign in (-1.0, 1.0)]
QUATERNIONS = [*RANDOM.normal(size=(200, 4)), *HALF_TURNS]
TURNS = [
    np.zeros(3),
    *(v * 10.0**e for v, e in zip(RANDOM.normal(size=(200, 3)), np.linspace(-9, 1, 200), strict=True)),
]


def test_matrices_quaternions_and_rotation_vectors_of_each_other():
    for q in QUATERNIONS:
        there = Rotation.from_quat(q, scalar_first=True)
        np.testing.assert_allclose(rotation_of(q), there.as_matrix(), rtol=0.0, atol=1e-15)
        wanted = there.as_quat(canonical=True, scalar_first=True)
        np.testing.assert_allclose(quaternion_of(rotation_of(q)), wanted, rtol=0.0, atol=1e-15)
    for r in TURNS:
        turn = Rotation.from_rotvec(r)
        np.testing.assert_allclose(rotation_by(r), turn.as_matrix(), rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(rotation_angle(rotation_by(r)), turn.magnitude(), rtol=1e-12, atol=1e-15)
    with pytest.raises(ValueError, match="length 0"):
        rotation_of(np.zeros(4))


def same(found: float | tuple[float, ...] | Floats, expected: float | Floats) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)


def matrix(q: plain.Quaternion) -> Floats:
    return Rotation.from_quat(np.array(q), scalar_first=True).as_matrix()


def angle(R_p: Floats, R_q: Floats) -> float:
    return float(Rotation.from_matrix(np.transpose(R_p) @ R_q).magnitude())


def two_rotations(seed: int) -> tuple[plain.Quaternion, plain.Quaternion, Floats, Floats]:
    both = Rotation.random(2, rng=np.random.default_rng(seed))
    p, q = (plain.quaternion(x) for x in both.as_quat(scalar_first=True))
    R_p, R_q = both.as_matrix()
    return p, q, R_p, R_q


@pytest.mark.parametrize("seed", range(3))
def test_vectors_matrices_and_entries_of_quaternions_are_those_of_arrays(seed: int):
    rng = np.random.default_rng(seed)
    A, B, C, D, E = rng.normal(size=(5, 3))
    a, b, c, d, e = (plain.vector(x) for x in (A, B, C, D, E))
    r, s, t = rng.normal(size=3).tolist()
    same(plain.add(a, b), A + B)
    same(plain.subtract(a, b), A - B)
    same(plain.scale(s, a), s * A)
    same(plain.divide(a, s), A / s)
    same(plain.add_scaled(a, s, b), A + s * B)
    same(plain.lerp(a, b, s), A + s * (B - A))
    same(plain.weighted_sum(r, a, s, b, t, c), r * A + s * B + t * C)
    same(plain.dot(a, b), A @ B)
    same(plain.cross(a, b), np.asarray(np.cross(A, B), dtype=np.float64))
    same(skew(A) @ B, np.asarray(np.cross(A, B), dtype=np.float64))
    same(plain.add_cross(a, b, c), A + np.cross(B, C))
    same(plain.norm(a), float(np.linalg.norm(A)))
    same(plain.distance(a, b), float(np.linalg.norm(A - B)))
    same(plain.clip(a, (0.1, 0.2, 0.3)), np.clip(A, [-0.1, -0.2, -0.3], [0.1, 0.2, 0.3]))
    same(plain.runge_kutta_step(a, s, b, c, d, e), A + s * (B + 2.0 * C + 2.0 * D + E) / 6.0)
    M = rng.normal(size=(3, 3))
    m = plain.row_major(M)
    same(plain.multiply(m, a), M @ A)
    same(plain.rotate(m, a), M @ A)
    same(plain.inverse_rotate(m, a), np.transpose(M) @ A)
    for i in range(3):
        same(plain.column(m, i), M[:, i])
    P, Q, U, V, W = rng.normal(size=(5, 4))
    p, q, u, v, w = (plain.quaternion(x) for x in (P, Q, U, V, W))
    same(plain.quaternion_dot(p, q), P @ Q)
    same(plain.quaternion_add_scaled(p, 0.3, q), P + 0.3 * Q)
    same(plain.normalize(p), P / np.linalg.norm(P))
    same(plain.quaternion_runge_kutta_step(p, 0.3, q, u, v, w), P + 0.05 * (Q + 2.0 * U + 2.0 * V + W))


@pytest.mark.parametrize("seed", range(3))
def test_quaternions_multiply_and_are_interpolated_as_rotations_the_shorter_way(seed: int):
    p, q, R_p, R_q = two_rotations(seed)
    same(plain.rotation_matrix(q), R_q.ravel())
    same(matrix(plain.quaternion_multiply(p, q)), R_p @ R_q)
    same(matrix(plain.quaternion_inverse(p)), np.transpose(R_p))
    assert plain.relative_quaternion(p, q) == plain.quaternion_multiply(plain.quaternion_inverse(p), q)
    for end in (q, plain.quaternion(-np.array(q))):
        same(plain.angle_between(p, end), angle(R_p, R_q))
        same(matrix(plain.nlerp(p, end, 0.0)), R_p)
        same(matrix(plain.nlerp(p, end, 1.0)), R_q)
        half = plain.nlerp(p, end, 0.5)
        same(plain.quaternion_dot(half, half), 1.0)
        same(plain.angle_between(p, half), 0.5 * angle(R_p, R_q))
    phi = np.array([2e-4, -3e-4, 1e-4])
    perturbed = Rotation.from_matrix(np.transpose(R_q) @ matrix(plain.perturb(q, plain.vector(0.5 * phi))))
    np.testing.assert_allclose(perturbed.as_rotvec(), phi, atol=1e-10)  # a small rotation in the own frame


@pytest.mark.parametrize("size", [0.0, 1e-9, 9.99e-5, 1.01e-4, 0.3, 3.1, 4.0])
def test_rotation_vectors_go_there_and_back_the_shorter_way_round(size: float):
    direction = np.array([0.36, -0.48, 0.8])
    q = plain.from_rotation_vector(plain.vector(size * direction))
    same(q, Rotation.from_rotvec(size * direction).as_quat(scalar_first=True))
    shorter = (size if size < math.pi else size - 2.0 * math.pi) * direction
    same(plain.rotation_vector(q), shorter)
    same(plain.rotation_vector(plain.quaternion(-np.array(q))), shorter)


P_WC = np.array([-0.95, 0.25, -0.6])
CALIBRATION = {
    "p_WC": P_WC,
    "q_WC": quaternion_of(looking_at(P_WC, np.array([0.0, 0.0, -0.6]))),
    "intrinsics": np.array([907.0, 905.0, 638.0, 361.0]),
    "distortion": np.array([0.11, -0.19, 0.0006, -0.0008, 0.05]),
}


def test_projection_is_opencv_s_its_slope_that_of_central_differences_and_rays_go_back():
    c, h = Pinhole("left", **CALIBRATION), 1e-6
    points = np.random.default_rng(0).uniform([-0.3, -0.4, -0.9], [0.4, 0.4, -0.3], (200, 3))
    fx, fy, cx, cy = CALIBRATION["intrinsics"]
    turn, _ = cv2.Rodrigues(c.R_CW)
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    expected, _ = cv2.projectPoints(points, turn, -c.R_CW @ P_WC, K, CALIBRATION["distortion"])
    np.testing.assert_allclose(c.project(points), expected.reshape(-1, 2), atol=1e-9)
    pixels, slope = c.project_with_slope(points)
    np.testing.assert_array_equal(pixels, c.project(points))
    for i in range(3):
        d = h * np.eye(3)[i]
        np.testing.assert_allclose(slope[:, :, i], (c.project(points + d) - c.project(points - d)) / (2 * h), atol=1e-5)
    towards = points - P_WC
    np.testing.assert_allclose(c.rays(pixels), towards / np.linalg.norm(towards, axis=1, keepdims=True), atol=1e-12)
    assert np.isnan(c.project(np.array([-1.5, 0.25, -0.6]))).all()  # behind the camera


@pytest.mark.parametrize(
    ("quantity", "value"),
    [
        ("q_WC", [1.0, 0.1, 0.0, 0.0]),
        ("intrinsics", [907.0, -1.0, 638.0, 361.0]),
        ("intrinsics", [0.0, 907.0, 638.0, 361.0]),
        ("distortion", [np.nan, 0, 0, 0, 0]),
    ],
)
def test_meaningless_calibration_is_refused(quantity: str, value: list[float], wording: Wording):
    with pytest.raises(InvalidCalibration) as refused:
        Pinhole("left", **{**CALIBRATION, quantity: np.array(value)})
    assert refused.value.quantity == quantity
    wording.check(refused.value)
