"""Poses of floating bodies in plain floats, beside what `handover.cosim.blocks.plain_rotation` has."""

import math

from handover.cosim.blocks.plain_rotation import Quaternion, Rows, Triple
from handover.cosim.blocks.ports import Floats

IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)


def quaternion(q: Floats) -> Quaternion:
    """Return a (4,) array's entries."""
    w, x, y, z = q.tolist()
    return w, x, y, z


def matrix_of(q: Quaternion) -> Rows:
    """Return R_AB of the unit quaternion q_AB."""
    w, x, y, z = q
    return (
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    )


def plus(a: Triple, b: Triple) -> Triple:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def along(a: Triple, s: float, b: Triple) -> Triple:
    """Return a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


def unit(q: Quaternion) -> Quaternion:
    """Return the quaternion with its norm brought to 1."""
    w, x, y, z = q
    n = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return w * n, x * n, y * n, z * n


def turn_by(a: Triple) -> Quaternion:
    """Return the quaternion of the rotation vector a, in rad."""
    angle = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    s = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), s * a[0], s * a[1], s * a[2]


def between(a: Quaternion, b: Quaternion, s: float) -> Quaternion:
    """Return the quaternion a share s of the way from a to b, on the shorter way."""
    if a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0.0:
        b = (-b[0], -b[1], -b[2], -b[3])
    r = 1.0 - s
    return unit((r * a[0] + s * b[0], r * a[1] + s * b[1], r * a[2] + s * b[2], r * a[3] + s * b[3]))
