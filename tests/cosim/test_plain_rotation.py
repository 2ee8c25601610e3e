"""Plain floats against numpy and SciPy."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.plain_rotation import (
    Quaternion,
    cross,
    inverse,
    norm,
    product,
    rows,
    triple,
    turned,
    turned_back,
)
from handover.cosim.blocks.ports import Floats


def scalars(q: Floats) -> Quaternion:
    s, x, y, z = q.tolist()
    return s, x, y, z


@pytest.mark.parametrize("seed", range(5))
def test_vectors_are_turned_and_crossed_as_arrays_are(seed: int):
    rng = np.random.default_rng(seed)
    M, a, b = rng.normal(size=(3, 3)), rng.normal(size=3), rng.normal(size=3)
    np.testing.assert_allclose(turned(rows(M), triple(a)), M @ a, rtol=1e-13)
    np.testing.assert_allclose(turned_back(rows(M), triple(a)), np.transpose(M) @ a, rtol=1e-13)
    np.testing.assert_allclose(cross(triple(a), triple(b)), np.cross(a, b), rtol=1e-13)
    assert norm(triple(a)) == pytest.approx(np.linalg.norm(a), rel=1e-15)


@pytest.mark.parametrize("seed", range(5))
def test_quaternions_multiply_as_rotations_do(seed: int):
    both = Rotation.random(2, rng=np.random.default_rng(seed))
    p, q = (scalars(x) for x in both.as_quat(scalar_first=True))
    R_p, R_q = both.as_matrix()
    made = Rotation.from_quat(np.array(product(p, q)), scalar_first=True)
    np.testing.assert_allclose(made.as_matrix(), R_p @ R_q, atol=1e-14)
    back = Rotation.from_quat(np.array(inverse(p)), scalar_first=True)
    np.testing.assert_allclose(back.as_matrix(), np.transpose(R_p), atol=1e-14)
