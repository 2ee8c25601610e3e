"""Rotations of floating bodies in plain floats.

A vector of three is a tuple here: at this size Python's own arithmetic takes a tenth of the time that arrays take.
Quaternions have their scalar part first; a rotation matrix is its nine entries, row by row.
"""

import math

Triple = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]
Nine = tuple[float, float, float, float, float, float, float, float, float]

IDENTITY: Quadruple = (1.0, 0.0, 0.0, 0.0)
ZERO: Triple = (0.0, 0.0, 0.0)


def triple(array: "list[float]") -> Triple:
    """Return a list of three as a tuple."""
    x, y, z = array
    return x, y, z


def quadruple(array: "list[float]") -> Quadruple:
    """Return a list of four as a tuple."""
    w, x, y, z = array
    return w, x, y, z


def matrix_of(q: Quadruple) -> Nine:
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


def turned(R: Nine, a: Triple) -> Triple:
    """Return R a."""
    a0, a1, a2 = a
    return R[0] * a0 + R[1] * a1 + R[2] * a2, R[3] * a0 + R[4] * a1 + R[5] * a2, R[6] * a0 + R[7] * a1 + R[8] * a2


def turned_back(R: Nine, a: Triple) -> Triple:
    """Return R^T a."""
    a0, a1, a2 = a
    return R[0] * a0 + R[3] * a1 + R[6] * a2, R[1] * a0 + R[4] * a1 + R[7] * a2, R[2] * a0 + R[5] * a1 + R[8] * a2


def cross(a: Triple, b: Triple) -> Triple:
    """Return a x b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def plus(a: Triple, b: Triple) -> Triple:
    """Return a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def along(a: Triple, s: float, b: Triple) -> Triple:
    """Return a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


def length(a: Triple) -> float:
    """Return |a|."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def product(a: Quadruple, b: Quadruple) -> Quadruple:
    """Return q_AC = q_AB q_BC."""
    aw, ax, ay, az = a
    bw, bx, by, bz = b
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


def inverse(q: Quadruple) -> Quadruple:
    """Return q_BA of the unit quaternion q_AB."""
    return q[0], -q[1], -q[2], -q[3]


def unit(q: Quadruple) -> Quadruple:
    """Return the quaternion with its norm brought to 1."""
    w, x, y, z = q
    n = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return w * n, x * n, y * n, z * n


def turn_by(a: Triple) -> Quadruple:
    """Return the quaternion of the rotation vector a, in rad."""
    angle = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    s = 0.5 - angle * angle / 48.0 if angle < 1e-4 else math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), s * a[0], s * a[1], s * a[2]


def between(a: Quadruple, b: Quadruple, s: float) -> Quadruple:
    """Return the quaternion a share s of the way from a to b, on the shorter way."""
    if a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] < 0.0:
        b = (-b[0], -b[1], -b[2], -b[3])
    r = 1.0 - s
    return unit((r * a[0] + s * b[0], r * a[1] + s * b[1], r * a[2] + s * b[2], r * a[3] + s * b[3]))
