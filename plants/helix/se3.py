"""Vectors, unit quaternions and rigid motions as tuples of numbers, for kernels that are compiled.

A quaternion is (w, x, y, z), scalar first; q_AB turns coordinates in B into A. A tuple costs compiled code no memory,
where an array would be allocated for every result.
"""

import math
from typing import TypeAlias

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.compiled import compiled

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

_SMALL = 1e-4
"""Rad; below it the next terms of the series are beyond the precision of numbers."""


@compiled
def vector(rows: Floats, i: int) -> Vector:
    """Return row i of an array, (n, 3)."""
    return (rows[i, 0], rows[i, 1], rows[i, 2])


@compiled
def quaternion(rows: Floats, i: int) -> Quaternion:
    """Return row i of an array, (n, 4)."""
    return (rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3])


@compiled
def add(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@compiled
def subtract(a: Vector, b: Vector) -> Vector:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@compiled
def scale(s: float, a: Vector) -> Vector:
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


@compiled
def cross(a: Vector, b: Vector) -> Vector:
    """Return a x b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@compiled
def dot(a: Vector, b: Vector) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def conjugate(q: Quaternion) -> Quaternion:
    """Return q_BA of q_AB."""
    return (q[0], -q[1], -q[2], -q[3])


@compiled
def product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return q_AC of q_AB and q_BC."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
        p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
        p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0],
    )


@compiled
def rotate(q: Quaternion, a: Vector) -> Vector:
    """Return a_A of q_AB and a_B: a + w t + v x t with t = 2 v x a."""
    v = (q[1], q[2], q[3])
    t = scale(2.0, cross(v, a))
    return add(add(a, scale(q[0], t)), cross(v, t))


@compiled
def normalised(q: Quaternion) -> Quaternion:
    """Return q / |q|."""
    s = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return (s * q[0], s * q[1], s * q[2], s * q[3])


@compiled
def exponential(theta: Vector) -> Quaternion:
    """Return the quaternion of a rotation vector, in rad."""
    angle = math.sqrt(dot(theta, theta))
    s = 0.5 - angle * angle / 48.0 if angle < _SMALL else math.sin(0.5 * angle) / angle
    return (math.cos(0.5 * angle), s * theta[0], s * theta[1], s * theta[2])


@compiled
def half(q: Quaternion) -> Quaternion:
    """Return the rotation of half the angle, of less than pi/2; q and -q are one rotation."""
    s = 1.0 if q[0] >= 0.0 else -1.0
    return normalised((1.0 + s * q[0], s * q[1], s * q[2], s * q[3]))


@compiled
def logarithm(q: Quaternion, d: Vector) -> tuple[Vector, Vector]:
    """Return the logarithm of a rigid motion by rotation q and displacement d: (u, theta), in m and rad.

    With d = V(theta) u, V the left Jacobian of SO(3):
    u = d - theta x d / 2 + (1 - angle/2 cot(angle/2)) / angle^2 theta x (theta x d).
    """
    s = 1.0 if q[0] >= 0.0 else -1.0
    v = (s * q[1], s * q[2], s * q[3])
    sine = math.sqrt(dot(v, v))
    k = 2.0 + sine * sine / 3.0 if sine < _SMALL else 2.0 * math.atan2(sine, s * q[0]) / sine
    theta = scale(k, v)
    square = dot(theta, theta)
    c = 1.0 / 12.0 + square / 720.0 if sine < _SMALL else (1.0 - 0.5 * k * s * q[0]) / square
    once = cross(theta, d)
    return add(subtract(d, scale(0.5, once)), scale(c, cross(theta, once))), theta
