"""Single rotations against SciPy, which is made for many."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.geometry import quaternion_of, rotation_by, rotation_of, skew
from handover.cosim.blocks.ports import Floats

RANDOM = np.random.default_rng(0)
HALF_TURNS = [np.eye(4)[k] * sign for k in range(4) for sign in (-1.0, 1.0)]
QUATERNIONS = [*RANDOM.normal(size=(200, 4)), *HALF_TURNS]
TURNS = [
    np.zeros(3),
    *(v * 10.0**e for v, e in zip(RANDOM.normal(size=(200, 3)), np.linspace(-9, 1, 200), strict=True)),
]


@pytest.mark.parametrize("q", QUATERNIONS)
def test_matrix_and_quaternion_of_each_other(q: Floats):
    there = Rotation.from_quat(q, scalar_first=True)
    np.testing.assert_allclose(rotation_of(q), there.as_matrix(), rtol=0.0, atol=1e-15)
    wanted = there.as_quat(canonical=True, scalar_first=True)
    np.testing.assert_allclose(quaternion_of(rotation_of(q)), wanted, rtol=0.0, atol=1e-15)


@pytest.mark.parametrize("r", TURNS)
def test_matrix_of_a_rotation_vector(r: Floats):
    np.testing.assert_allclose(rotation_by(r), Rotation.from_rotvec(r).as_matrix(), rtol=0.0, atol=1e-15)


def test_a_quaternion_of_length_0_is_refused():
    with pytest.raises(ValueError, match="length 0"):
        rotation_of(np.zeros(4))


def test_skew_is_the_matrix_of_a_cross_product():
    v, a = np.array([0.3, -0.5, 0.7]), np.array([-1.1, 0.2, 0.4])
    np.testing.assert_allclose(skew(v) @ a, np.cross(v, a), rtol=0.0, atol=1e-16)
