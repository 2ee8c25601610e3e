"""The house's vectors and quaternions compiled for the kernels of arm and hand, and rigid motions besides.

What `handover.cosim.blocks.plain_rotation` has is compiled from there, so a kernel whose machine code is kept names
that module among its sources. A tuple costs compiled code no memory, where an array would be allocated for every
result.
"""

import math

from handover.cosim.blocks import plain_rotation
from handover.cosim.blocks.plain_rotation import Quaternion, Vector
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.compiled import compiled

_SMALL = 1e-4
"""Rad; below it the next terms of the series are beyond the precision of numbers."""

SOURCES = (__name__, plain_rotation.__name__)
"""Modules of all functions here, for `compiled_once`."""

add = compiled(plain_rotation.add)
subtract = compiled(plain_rotation.subtract)
scale = compiled(plain_rotation.scale)
dot = compiled(plain_rotation.dot)
cross = compiled(plain_rotation.cross)
norm = compiled(plain_rotation.norm)
quaternion_multiply = compiled(plain_rotation.quaternion_multiply)
quaternion_inverse = compiled(plain_rotation.quaternion_inverse)
normalize = compiled(plain_rotation.normalize)
from_rotation_vector = compiled(plain_rotation.from_rotation_vector)


@compiled
def vector(rows: Floats, i: int) -> Vector:
    """Return row i of an array, (n, 3)."""
    return (rows[i, 0], rows[i, 1], rows[i, 2])


@compiled
def quaternion(rows: Floats, i: int) -> Quaternion:
    """Return row i of an array, (n, 4)."""
    return (rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3])


@compiled
def rotate(q: Quaternion, a: Vector) -> Vector:
    """Return a_A of q_AB and a_B: a + w t + v x t with t = 2 v x a."""
    v = (q[1], q[2], q[3])
    t = scale(2.0, cross(v, a))
    return add(add(a, scale(q[0], t)), cross(v, t))


@compiled
def half(q: Quaternion) -> Quaternion:
    """Return the rotation of half the angle, of less than pi/2; q and -q are one rotation."""
    s = 1.0 if q[0] >= 0.0 else -1.0
    return normalize((1.0 + s * q[0], s * q[1], s * q[2], s * q[3]))


@compiled
def logarithm(q: Quaternion, d: Vector) -> tuple[Vector, Vector]:
    """Return the logarithm of a rigid motion by rotation q and displacement d: (u, theta), in m and rad.

    With d = V(theta) u, V the left Jacobian of SO(3):
    u = d - theta x d / 2 + (1 - angle/2 cot(angle/2)) / angle^2 theta x (theta x d).
    """
    s = 1.0 if q[0] >= 0.0 else -1.0
    v = (s * q[1], s * q[2], s * q[3])
    sine = norm(v)
    k = 2.0 + sine * sine / 3.0 if sine < _SMALL else 2.0 * math.atan2(sine, s * q[0]) / sine
    theta = scale(k, v)
    square = dot(theta, theta)
    c = 1.0 / 12.0 + square / 720.0 if sine < _SMALL else (1.0 - 0.5 * k * s * q[0]) / square
    once = cross(theta, d)
    return add(subtract(d, scale(0.5, once)), scale(c, cross(theta, once))), theta
