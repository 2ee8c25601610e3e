"""Orientations of a free-flyer and the turns between them, as plain floats."""

import math

import numpy as np

from handover.cosim.blocks.plain_rotation import Quaternion, Rows, Triple, inverse, product
from handover.cosim.blocks.ports import Floats


class UnusableOrientation(ValueError):
    """A quaternion that is zero or not finite, so that it tells of no orientation; nothing has changed."""

    is_refusal = True

    def __init__(self, block: str, name: str, q: Floats) -> None:
        super().__init__(f"{block}: {name} = {np.asarray(q).tolist()} must be finite and not zero")
        self.name = name


def unit_quaternion(q: Floats, block: str, name: str) -> Quaternion:
    """Return a quaternion, scalar first, divided by its norm.

    Raises:
        UnusableOrientation: it is zero or not finite.
    """
    s, x, y, z = q.tolist()
    n = s * s + x * x + y * y + z * z
    if not 1e-12 < n < math.inf:
        raise UnusableOrientation(block, name, q)
    if n != 1.0:
        f = 1.0 / math.sqrt(n)
        return s * f, x * f, y * f, z * f
    return s, x, y, z


def rows_of(q: Quaternion) -> Rows:
    """Return R_AB of the unit quaternion q_AB."""
    s, x, y, z = q
    x2, y2, z2 = x + x, y + y, z + z
    xx, yy, zz = x * x2, y * y2, z * z2
    xy, xz, yz = x * y2, x * z2, y * z2
    sx, sy, sz = s * x2, s * y2, s * z2
    return 1.0 - yy - zz, xy - sz, xz + sy, xy + sz, 1.0 - xx - zz, yz - sx, xz - sy, yz + sx, 1.0 - xx - yy


def seen_from(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return q_AC of q_BA and q_BC: the turn from the one to the other."""
    return product(inverse(p), q)


def rotation_vector(q: Quaternion) -> Triple:
    """Return axis times angle of a unit quaternion, by the shorter way round: the angle is at most pi."""
    s, x, y, z = q
    n = math.sqrt(x * x + y * y + z * z)
    if n < 1e-12:
        f = 2.0 if s >= 0.0 else -2.0
    elif s >= 0.0:
        f = 2.0 * math.atan2(n, s) / n
    else:
        f = -2.0 * math.atan2(n, -s) / n
    return f * x, f * y, f * z


def angle_between(p: Quaternion, q: Quaternion) -> float:
    """Return the angle of the turn between two orientations, at most pi, from the chord of their unit quaternions."""
    a, b, c, d = p
    s, x, y, z = q
    if a * s + b * x + c * y + d * z < 0.0:
        s, x, y, z = -s, -x, -y, -z
    a, b, c, d = a - s, b - x, c - y, d - z
    return 4.0 * math.asin(0.5 * math.sqrt(a * a + b * b + c * c + d * d))


def quaternion_about(phi: Triple) -> Quaternion:
    """Return the unit quaternion of a rotation vector."""
    x, y, z = phi
    angle = math.sqrt(x * x + y * y + z * z)
    if angle < 1e-12:
        return 1.0, x / 2.0, y / 2.0, z / 2.0
    f = math.sin(angle / 2.0) / angle
    return math.cos(angle / 2.0), f * x, f * y, f * z
