"""Vectors, rotations and quaternions as tuples of floats: for three numbers numpy costs ten times the arithmetic.

Coordinates are spelled out here, so that the formulas that call these functions read as they do on paper. They are
functions and not a class with operators, because such an operator costs three to five times a call.
Each sums from left to right as its formula reads: add_cross(a, b, c) and add(a, cross(b, c)) differ in the last bit.

Quaternions have their scalar part first; a matrix is its nine entries, row by row.
"""

import math

from handover.cosim.blocks.ports import Floats

Vector = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]
Matrix = tuple[float, float, float, float, float, float, float, float, float]

ZERO: Vector = (0.0, 0.0, 0.0)
IDENTITY: Quaternion = (1.0, 0.0, 0.0, 0.0)

_SERIES_BELOW = 1e-4  # rad; the series is exact to 1e-19 there


def vector(v: Floats) -> Vector:
    """Return a (3,) array's entries."""
    x, y, z = v.tolist()
    return x, y, z


def quaternion(q: Floats) -> Quaternion:
    """Return a (4,) array's entries."""
    w, x, y, z = q.tolist()
    return w, x, y, z


def row_major(M: Floats) -> Matrix:
    """Return a (3, 3) array's entries, row by row."""
    a, b, c, d, e, f, g, h, i = M.ravel().tolist()
    return a, b, c, d, e, f, g, h, i


def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    return a_x + b_x, a_y + b_y, a_z + b_z


def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    return a_x - b_x, a_y - b_y, a_z - b_z


def scale(s: float, a: Vector) -> Vector:
    """Return s a."""
    x, y, z = a
    return s * x, s * y, s * z


def divide(a: Vector, s: float) -> Vector:
    """Return a / s."""
    x, y, z = a
    return x / s, y / s, z / s


def add_scaled(a: Vector, s: float, b: Vector) -> Vector:
    """Return a + s b."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    return a_x + s * b_x, a_y + s * b_y, a_z + s * b_z


def lerp(a: Vector, b: Vector, s: float) -> Vector:
    """Return a + s (b - a), linear interpolation from a (s = 0) to b (s = 1)."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    return a_x + s * (b_x - a_x), a_y + s * (b_y - a_y), a_z + s * (b_z - a_z)


def weighted_sum(r: float, a: Vector, s: float, b: Vector, t: float, c: Vector) -> Vector:
    """Return r a + s b + t c."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    c_x, c_y, c_z = c
    return r * a_x + s * b_x + t * c_x, r * a_y + s * b_y + t * c_y, r * a_z + s * b_z + t * c_z


def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    return a_x * b_x + a_y * b_y + a_z * b_z


def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    return a_y * b_z - a_z * b_y, a_z * b_x - a_x * b_z, a_x * b_y - a_y * b_x


def add_cross(a: Vector, b: Vector, c: Vector) -> Vector:
    """Return a + b x c."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    c_x, c_y, c_z = c
    return a_x + b_y * c_z - b_z * c_y, a_y + b_z * c_x - b_x * c_z, a_z + b_x * c_y - b_y * c_x


def norm(v: Vector) -> float:
    """Return |v|."""
    x, y, z = v
    return math.sqrt(x * x + y * y + z * z)


def distance(a: Vector, b: Vector) -> float:
    """Return |a - b|."""
    a_x, a_y, a_z = a
    b_x, b_y, b_z = b
    x, y, z = a_x - b_x, a_y - b_y, a_z - b_z
    return math.sqrt(x * x + y * y + z * z)


def clip(v: Vector, limit: Vector) -> Vector:
    """Return v with each component limited in magnitude to that of `limit`."""
    x, y, z = v
    a, b, c = limit
    return min(max(x, -a), a), min(max(y, -b), b), min(max(z, -c), c)


def column(M: Matrix, i: int) -> Vector:
    """Return column i of a matrix; of R_AB, axis i of B in A."""
    return M[i], M[i + 3], M[i + 6]


def multiply(M: Matrix, v: Vector) -> Vector:
    """Return M v."""
    a, b, c, d, e, f, g, h, i = M
    x, y, z = v
    return a * x + b * y + c * z, d * x + e * y + f * z, g * x + h * y + i * z


rotate = multiply
"""Return R v of a rotation matrix: a name for what is meant where `multiply` is done, at no second call."""


def inverse_rotate(R: Matrix, v: Vector) -> Vector:
    """Return R^-1 v = R^T v of a rotation matrix."""
    a, b, c, d, e, f, g, h, i = R
    x, y, z = v
    return a * x + d * y + g * z, b * x + e * y + h * z, c * x + f * y + i * z


def rotation_matrix(q: Quaternion) -> Matrix:
    """Return R_AB of the unit quaternion q_AB."""
    w, x, y, z = q
    xx, yy, zz, xy, xz, yz, wx, wy, wz = x * x, y * y, z * z, x * y, x * z, y * z, w * x, w * y, w * z
    return (
        1.0 - 2.0 * (yy + zz),
        2.0 * (xy - wz),
        2.0 * (xz + wy),
        2.0 * (xy + wz),
        1.0 - 2.0 * (xx + zz),
        2.0 * (yz - wx),
        2.0 * (xz - wy),
        2.0 * (yz + wx),
        1.0 - 2.0 * (xx + yy),
    )


def quaternion_multiply(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return q_AC of q_AB and q_BC."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def quaternion_inverse(q: Quaternion) -> Quaternion:
    """Return q_BA of the unit quaternion q_AB."""
    w, x, y, z = q
    return w, -x, -y, -z


def relative_quaternion(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return q_BC of the unit quaternions q_AB and q_AC: the rotation from the one orientation to the other."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w + b * x + c * y + d * z,
        a * x - b * w - c * z + d * y,
        a * y + b * z - c * w - d * x,
        a * z - b * y + c * x - d * w,
    )


def quaternion_dot(p: Quaternion, q: Quaternion) -> float:
    """Return the sum of the products of entries."""
    a, b, c, d = p
    w, x, y, z = q
    return a * w + b * x + c * y + d * z


def quaternion_add_scaled(p: Quaternion, s: float, q: Quaternion) -> Quaternion:
    """Return p + s q, entry by entry."""
    a, b, c, d = p
    w, x, y, z = q
    return a + s * w, b + s * x, c + s * y, d + s * z


def normalize(q: Quaternion) -> Quaternion:
    """Return q / |q|."""
    w, x, y, z = q
    n = 1.0 / math.sqrt(w * w + x * x + y * y + z * z)
    return w * n, x * n, y * n, z * n


def nlerp(p: Quaternion, q: Quaternion, s: float) -> Quaternion:
    """Return normalised linear interpolation from p (s = 0) to q (s = 1) by the shorter way, a unit quaternion."""
    a, b, c, d = p
    w, x, y, z = q
    if a * w + b * x + c * y + d * z < 0.0:
        w, x, y, z = -w, -x, -y, -z
    r = 1.0 - s
    return normalize((r * a + s * w, r * b + s * x, r * c + s * y, r * d + s * z))


def perturb(q: Quaternion, h: Vector) -> Quaternion:
    """Return q (1, h) / |(1, h)|: q rotated in its own frame by the small rotation vector 2 h, in rad."""
    a, i, j, k = q
    x, y, z = h
    n = 1.0 / math.sqrt(1.0 + x * x + y * y + z * z)
    return (
        n * (a - i * x - j * y - k * z),
        n * (i + a * x + j * z - k * y),
        n * (j + a * y + k * x - i * z),
        n * (k + a * z + i * y - j * x),
    )


def from_rotation_vector(phi: Vector) -> Quaternion:
    """Return the unit quaternion of a rotation vector, in rad."""
    x, y, z = phi
    angle = math.sqrt(x * x + y * y + z * z)
    half = 0.5 * angle
    s = 0.5 - angle * angle / 48.0 if angle < _SERIES_BELOW else math.sin(half) / angle
    return math.cos(half), s * x, s * y, s * z


def rotation_vector(q: Quaternion) -> Vector:
    """Return axis times angle of a unit quaternion, by the shorter way round: the angle is at most pi."""
    w, x, y, z = q
    n = math.sqrt(x * x + y * y + z * z)
    if n < 1e-12:
        f = 2.0 if w >= 0.0 else -2.0
    elif w >= 0.0:
        f = 2.0 * math.atan2(n, w) / n
    else:
        f = -2.0 * math.atan2(n, -w) / n
    return f * x, f * y, f * z


def angle_between(p: Quaternion, q: Quaternion) -> float:
    """Return the angle of the rotation from one orientation to another, at most pi, from their quaternions' chord."""
    a, b, c, d = p
    w, x, y, z = q
    if a * w + b * x + c * y + d * z < 0.0:
        w, x, y, z = -w, -x, -y, -z
    a, b, c, d = a - w, b - x, c - y, d - z
    return 4.0 * math.asin(0.5 * math.sqrt(a * a + b * b + c * c + d * d))


def runge_kutta_step(y: Vector, h: float, k_1: Vector, k_2: Vector, k_3: Vector, k_4: Vector) -> Vector:
    """Return y + h/6 (k_1 + 2 (k_2 + k_3) + k_4), the classical rule of order 4 from its four rates."""
    s = h / 6.0
    y_x, y_y, y_z = y
    a_x, a_y, a_z = k_1
    b_x, b_y, b_z = k_2
    c_x, c_y, c_z = k_3
    d_x, d_y, d_z = k_4
    return (
        y_x + s * (a_x + 2.0 * (b_x + c_x) + d_x),
        y_y + s * (a_y + 2.0 * (b_y + c_y) + d_y),
        y_z + s * (a_z + 2.0 * (b_z + c_z) + d_z),
    )


def quaternion_runge_kutta_step(
    q: Quaternion, h: float, k_1: Quaternion, k_2: Quaternion, k_3: Quaternion, k_4: Quaternion
) -> Quaternion:
    """Return q + h/6 (k_1 + 2 (k_2 + k_3) + k_4), whose norm is not quite 1."""
    s = h / 6.0
    w, x, y, z = q
    a_w, a_x, a_y, a_z = k_1
    b_w, b_x, b_y, b_z = k_2
    c_w, c_x, c_y, c_z = k_3
    d_w, d_x, d_y, d_z = k_4
    return (
        w + s * (a_w + 2.0 * (b_w + c_w) + d_w),
        x + s * (a_x + 2.0 * (b_x + c_x) + d_x),
        y + s * (a_y + 2.0 * (b_y + c_y) + d_y),
        z + s * (a_z + 2.0 * (b_z + c_z) + d_z),
    )
