"""Rotations as plain floats: for three numbers numpy costs ten times the arithmetic."""

import math

import numpy as np

from cosim.ports import Floats

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Rows = tuple[float, float, float, float, float, float, float, float, float]
"""A matrix, row by row."""


class UnusableOrientation(ValueError):
    """A quaternion that is zero or not finite, so that it tells of no orientation."""

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


def turned(R: Rows, v: Triple) -> Triple:
    """Return R v."""
    a, b, c, d, e, f, g, h, i = R
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


def turned_back(R: Rows, v: Triple) -> Triple:
    """Return R^T v."""
    a, b, c, d, e, f, g, h, i = R
    x, y, z = v
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def cross(a: Triple, b: Triple) -> Triple:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return q_AC of q_AB and q_BC."""
    a, b, c, d = p
    s, x, y, z = q
    return (
        a * s - b * x - c * y - d * z,
        a * x + b * s + c * z - d * y,
        a * y - b * z + c * s + d * x,
        a * z + b * y - c * x + d * s,
    )


def seen_from(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return q_AC of q_BA and q_BC: the turn from the one to the other."""
    return product((p[0], -p[1], -p[2], -p[3]), q)


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


def norm(v: Triple) -> float:
    """Return the length of v."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


def rows(M: Floats) -> Rows:
    """Return a (3, 3) array's entries."""
    a, b, c, d, e, f, g, h, i = np.asarray(M, dtype=np.float64).reshape(9).tolist()
    return a, b, c, d, e, f, g, h, i


def triple(v: Floats) -> Triple:
    """Return a (3,) array's entries."""
    x, y, z = v.tolist()
    return x, y, z
