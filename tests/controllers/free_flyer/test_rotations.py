"""The controllers' own rotations against those of `handover.cosim.blocks.plain_rotation`: the same but for rounding."""

import numpy as np
import pytest

from handover.controllers.free_flyer.rotations import (
    InvalidOrientation,
    from_rotation_vector,
    rotation_matrix,
    unit_quaternion,
)
from handover.cosim.blocks import plain_rotation
from handover.cosim.blocks.plain_rotation import vector


@pytest.mark.parametrize("angle", [0.0, 1e-13, 1e-9, 5e-5, 0.3, 3.1])
def test_quaternion_and_matrix_are_those_of_the_rotation_vector(angle: float):
    phi = vector(angle * np.array([0.36, -0.48, 0.8]))
    q = plain_rotation.from_rotation_vector(phi)
    np.testing.assert_allclose(from_rotation_vector(phi), q, rtol=1e-15, atol=1e-26)
    np.testing.assert_allclose(rotation_matrix(q), plain_rotation.rotation_matrix(q), rtol=0.0, atol=1e-15)


def test_quaternion_of_another_length_becomes_unit():
    assert unit_quaternion(np.array([0.0, 0.0, -2.0, 0.0]), "block", "q") == (0.0, 0.0, -1.0, 0.0)
    for q in (np.zeros(4), np.array([np.nan, 0.0, 0.0, 1.0])):
        with pytest.raises(InvalidOrientation):
            unit_quaternion(q, "block", "q")
