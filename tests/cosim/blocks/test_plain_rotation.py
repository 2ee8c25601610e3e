"""Plain floats against numpy and SciPy."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

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
