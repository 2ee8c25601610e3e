"""Vectors, rotations and quaternions as plain floats: for three numbers numpy costs ten times the arithmetic.

Quaternions have their scalar part first; a matrix is its nine entries, row by row.
"""

import math

from handover.cosim.blocks.ports import Floats

Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Rows = tuple[float, float, float, float, float, float, float, float, float]

ZERO: Triple = (0.0, 0.0, 0.0)


def triple(v: Floats) -> Triple:
    """Return a (3,) array's entries."""
    x, y, z = v.tolist()
    return x, y, z


def rows(M: Floats) -> Rows:
    """Return a (3, 3) array's entries."""
    a, b, c, d, e, f, g, h, i = M.ravel().tolist()
    return a, b, c, d, e, f, g, h, i


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


def norm(v: Triple) -> float:
    """Return |v|."""
    return math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])


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


def inverse(q: Quaternion) -> Quaternion:
    """Return q_BA of the unit quaternion q_AB."""
    return q[0], -q[1], -q[2], -q[3]
