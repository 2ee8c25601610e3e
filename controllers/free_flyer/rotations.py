"""Orientations of a free-flyer: measured quaternions, and rotations as its controllers round them.

`rotation_matrix` and `from_rotation_vector` differ from those of `handover.cosim.blocks.plain_rotation` in the last bit
only. The controllers keep their own, because a loop with noise never forgets a bit, and the published runs were made
with them.
"""

import math

import numpy as np

from handover.cosim.blocks.plain_rotation import Matrix, Quaternion, Vector
from handover.cosim.blocks.ports import Floats


class InvalidOrientation(ValueError):
    """A quaternion that is zero or not finite, which is no orientation; nothing has changed."""

    is_refusal = True

    def __init__(self, block: str, name: str, q: Floats) -> None:
        super().__init__(f"{block}: {name} = {np.asarray(q).tolist()} must be finite and not zero")
        self.name = name


def unit_quaternion(q: Floats, block: str, name: str) -> Quaternion:
    """Return a quaternion, scalar first, divided by its norm.

    Raises:
        InvalidOrientation: it is zero or not finite.
    """
    w, x, y, z = q.tolist()
    n = w * w + x * x + y * y + z * z
    if not 1e-12 < n < math.inf:
        raise InvalidOrientation(block, name, q)
    if n != 1.0:
        f = 1.0 / math.sqrt(n)
        return w * f, x * f, y * f, z * f
    return w, x, y, z


def rotation_matrix(q: Quaternion) -> Matrix:
    """Return R_AB of the unit quaternion q_AB."""
    w, x, y, z = q
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    wx, wy, wz = w * x2, w * y2, w * z2
    return 1.0 - yy - zz, xy - wz, xz + wy, xy + wz, 1.0 - xx - zz, yz - wx, xz - wy, yz + wx, 1.0 - xx - yy


def from_rotation_vector(phi: Vector) -> Quaternion:
    """Return the unit quaternion of a rotation vector, in rad."""
    x, y, z = phi
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        return 1.0, x / 2.0, y / 2.0, z / 2.0
    f = math.sin(angle / 2.0) / angle
    return math.cos(angle / 2.0), f * x, f * y, f * z
