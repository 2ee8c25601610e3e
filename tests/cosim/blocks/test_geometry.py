"""Single rotations against SciPy, which is made for many, vectors against NumPy, and pinholes against OpenCV."""

import math

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.geometry import (
    InvalidCalibration,
    Pinhole,
    looking_at,
    quaternion_of,
    rotation_by,
    rotation_of,
    skew,
)
from handover.cosim.blocks.plain_rotation import (
    Quaternion,
    add,
    add_cross,
    add_scaled,
    angle_between,
    clip,
    column,
    cross,
    distance,
    divide,
    dot,
    from_rotation_vector,
    inverse_rotate,
    lerp,
    multiply,
    nlerp,
    norm,
    normalize,
    perturb,
    quaternion,
    quaternion_add_scaled,
    quaternion_dot,
    quaternion_inverse,
    quaternion_multiply,
    quaternion_runge_kutta_step,
    relative_quaternion,
    rotate,
    rotation_matrix,
    rotation_vector,
    row_major,
    runge_kutta_step,
    scale,
    subtract,
    vector,
    weighted_sum,
)
from handover.cosim.blocks.ports import Floats

RANDOM = np.random.default_rng(0)
HALF_TURNS = [np.eye(4)[k] * sign for k in range(4) for sign in (-1.0, 1.0)]
QUATERNIONS = [*RANDOM.normal(size=(200, 4)), *HALF_TURNS]
TURNS = [
    np.zeros(3),
    *(v * 10.0**e for v, e in zip(RANDOM.normal(size=(200, 3)), np.linspace(-9, 1, 200), strict=True)),
]


def test_matrix_and_quaternion_of_each_other():
    for q in QUATERNIONS:
        there = Rotation.from_quat(q, scalar_first=True)
        np.testing.assert_allclose(rotation_of(q), there.as_matrix(), rtol=0.0, atol=1e-15)
        wanted = there.as_quat(canonical=True, scalar_first=True)
        np.testing.assert_allclose(quaternion_of(rotation_of(q)), wanted, rtol=0.0, atol=1e-15)


def test_matrix_of_a_rotation_vector():
    for r in TURNS:
        np.testing.assert_allclose(rotation_by(r), Rotation.from_rotvec(r).as_matrix(), rtol=0.0, atol=1e-15)


def test_a_quaternion_of_length_0_is_refused():
    with pytest.raises(ValueError, match="length 0"):
        rotation_of(np.zeros(4))


def test_skew_is_the_matrix_of_a_cross_product():
    v, a = np.array([0.3, -0.5, 0.7]), np.array([-1.1, 0.2, 0.4])
    np.testing.assert_allclose(skew(v) @ a, np.cross(v, a), rtol=0.0, atol=1e-16)


def same(found: float | tuple[float, ...] | Floats, expected: float | Floats) -> None:
    np.testing.assert_allclose(found, expected, rtol=1e-13, atol=1e-14)


def matrix(q: Quaternion) -> Floats:
    return Rotation.from_quat(np.array(q), scalar_first=True).as_matrix()


def angle(R_p: Floats, R_q: Floats) -> float:
    return float(Rotation.from_matrix(np.transpose(R_p) @ R_q).magnitude())


def two_rotations(seed: int) -> tuple[Quaternion, Quaternion, Floats, Floats]:
    both = Rotation.random(2, rng=np.random.default_rng(seed))
    p, q = (quaternion(x) for x in both.as_quat(scalar_first=True))
    R_p, R_q = both.as_matrix()
    return p, q, R_p, R_q


@pytest.mark.parametrize("seed", range(5))
def test_vectors_are_added_and_multiplied_as_arrays_are(seed: int):
    rng = np.random.default_rng(seed)
    A, B, C, D, E = rng.normal(size=(5, 3))
    a, b, c, d, e = (vector(x) for x in (A, B, C, D, E))
    r, s, t = rng.normal(size=3).tolist()
    same(add(a, b), A + B)
    same(subtract(a, b), A - B)
    same(scale(s, a), s * A)
    same(divide(a, s), A / s)
    same(add_scaled(a, s, b), A + s * B)
    same(lerp(a, b, s), A + s * (B - A))
    same(weighted_sum(r, a, s, b, t, c), r * A + s * B + t * C)
    same(dot(a, b), A @ B)
    same(cross(a, b), np.asarray(np.cross(A, B), dtype=np.float64))
    same(add_cross(a, b, c), A + np.cross(B, C))
    same(norm(a), float(np.linalg.norm(A)))
    same(distance(a, b), float(np.linalg.norm(A - B)))
    same(clip(a, (0.1, 0.2, 0.3)), np.clip(A, [-0.1, -0.2, -0.3], [0.1, 0.2, 0.3]))
    same(runge_kutta_step(a, s, b, c, d, e), A + s * (B + 2.0 * C + 2.0 * D + E) / 6.0)


@pytest.mark.parametrize("seed", range(5))
def test_matrices_are_applied_as_arrays_are(seed: int):
    rng = np.random.default_rng(seed)
    M, a = rng.normal(size=(3, 3)), rng.normal(size=3)
    same(multiply(row_major(M), vector(a)), M @ a)
    same(rotate(row_major(M), vector(a)), M @ a)
    same(inverse_rotate(row_major(M), vector(a)), np.transpose(M) @ a)
    for i in range(3):
        same(column(row_major(M), i), M[:, i])


@pytest.mark.parametrize("seed", range(5))
def test_quaternions_multiply_as_rotations_do(seed: int):
    p, q, R_p, R_q = two_rotations(seed)
    same(rotation_matrix(q), R_q.ravel())
    same(matrix(quaternion_multiply(p, q)), R_p @ R_q)
    same(matrix(quaternion_inverse(p)), np.transpose(R_p))
    assert relative_quaternion(p, q) == quaternion_multiply(quaternion_inverse(p), q)
    same(angle_between(p, q), angle(R_p, R_q))
    same(angle_between(p, quaternion(-np.array(q))), angle(R_p, R_q))


@pytest.mark.parametrize("seed", range(5))
def test_quaternions_are_added_entry_by_entry(seed: int):
    rng = np.random.default_rng(seed)
    A, B, C, D, E = rng.normal(size=(5, 4))
    a, b, c, d, e = (quaternion(x) for x in (A, B, C, D, E))
    same(quaternion_dot(a, b), A @ B)
    same(quaternion_add_scaled(a, 0.3, b), A + 0.3 * B)
    same(normalize(a), A / np.linalg.norm(A))
    same(quaternion_runge_kutta_step(a, 0.3, b, c, d, e), A + 0.05 * (B + 2.0 * C + 2.0 * D + E))


@pytest.mark.parametrize("size", [0.0, 1e-9, 9.99e-5, 1.01e-4, 0.3, 3.1])
def test_rotation_vectors_go_there_and_back(size: float):
    phi = size * np.array([0.36, -0.48, 0.8])
    q = from_rotation_vector(vector(phi))
    same(q, Rotation.from_rotvec(phi).as_quat(scalar_first=True))
    same(rotation_vector(q), phi)
    same(rotation_vector(quaternion(-np.array(q))), phi)


def test_rotation_vector_takes_the_shorter_way_round():
    same(rotation_vector(from_rotation_vector((0.0, 4.0, 0.0))), np.array([0.0, 4.0 - 2.0 * math.pi, 0.0]))


def test_nlerp_goes_the_shorter_way_and_meets_its_ends():
    p, q, R_p, R_q = two_rotations(7)
    for end in (q, quaternion(-np.array(q))):
        same(matrix(nlerp(p, end, 0.0)), R_p)
        same(matrix(nlerp(p, end, 1.0)), R_q)
        half = nlerp(p, end, 0.5)
        same(quaternion_dot(half, half), 1.0)
        same(angle_between(p, half), 0.5 * angle(R_p, R_q))


def test_perturb_is_a_small_rotation_in_the_own_frame():
    q, _, R_q, _ = two_rotations(3)
    phi = np.array([2e-4, -3e-4, 1e-4])
    rotate = Rotation.from_matrix(np.transpose(R_q) @ matrix(perturb(q, vector(0.5 * phi))))
    np.testing.assert_allclose(rotate.as_rotvec(), phi, atol=1e-10)


P_WC = np.array([-0.95, 0.25, -0.6])
Q_WC = quaternion_of(looking_at(P_WC, np.array([0.0, 0.0, -0.6])))
INTRINSICS = np.array([907.0, 905.0, 638.0, 361.0])
DISTORTION = np.array([0.11, -0.19, 0.0006, -0.0008, 0.05])


def camera() -> Pinhole:
    return Pinhole("left", P_WC, Q_WC, INTRINSICS, DISTORTION)


def points() -> Floats:
    return np.random.default_rng(0).uniform([-0.3, -0.4, -0.9], [0.4, 0.4, -0.3], (200, 3))


def test_projection_is_opencv_s():
    c = camera()
    fx, fy, cx, cy = INTRINSICS
    turn, _ = cv2.Rodrigues(c.R_CW)
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    expected, _ = cv2.projectPoints(points(), turn, -c.R_CW @ P_WC, K, DISTORTION)
    np.testing.assert_allclose(c.project(points()), expected.reshape(-1, 2), atol=1e-9)


def test_slope_is_that_of_central_differences():
    c, h = camera(), 1e-6
    pixels, slope = c.project_with_slope(points())
    np.testing.assert_array_equal(pixels, c.project(points()))
    for i in range(3):
        d = h * np.eye(3)[i]
        expected = (c.project(points() + d) - c.project(points() - d)) / (2 * h)
        np.testing.assert_allclose(slope[:, :, i], expected, atol=1e-5)


def test_rays_go_back_to_the_points():
    c = camera()
    towards = points() - P_WC
    expected = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    np.testing.assert_allclose(c.rays(c.project(points())), expected, atol=1e-12)


def test_what_is_behind_the_camera_has_no_picture():
    assert np.isnan(camera().project(np.array([-1.5, 0.25, -0.6]))).all()


@pytest.mark.parametrize(
    ("quantity", "value"),
    [
        ("q_WC", np.array([1.0, 0.1, 0.0, 0.0])),
        ("intrinsics", np.array([907.0, -1.0, 638.0, 361.0])),
        ("intrinsics", np.array([0.0, 907.0, 638.0, 361.0])),
        ("distortion", np.array([np.nan, 0, 0, 0, 0])),
    ],
)
def test_meaningless_calibration_is_refused(quantity: str, value: Floats):
    given = {"p_WC": P_WC, "q_WC": Q_WC, "intrinsics": INTRINSICS, "distortion": DISTORTION} | {quantity: value}
    with pytest.raises(InvalidCalibration, match=f"'left': {quantity}") as refused:
        Pinhole("left", **given)
    assert refused.value.quantity == quantity
