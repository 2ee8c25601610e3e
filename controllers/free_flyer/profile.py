"""A free-flyer's trajectory to a pose, of minimum jerk within bounds of speed and acceleration."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Quaternion,
    Vector,
    add,
    add_scaled,
    from_rotation_vector,
    norm,
    quaternion_multiply,
    relative_quaternion,
    rotate,
    rotation_matrix,
    rotation_vector,
    scale,
    subtract,
)

_PEAK_SPEED = 1.875  # of s(x) = 10 x^3 - 15 x^4 + 6 x^5, from 0 to 1 in unit time
_PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)
_PEAK_BRAKING = 3.94  # of h(x) = x - 6 x^3 + 8 x^4 - 3 x^5, which begins with unit speed and ends where it began


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Largest speed and acceleration of the trajectory's translation (m/s, m/s2) and rotation (rad/s, rad/s2)."""

    speed: float
    acceleration: float
    rate: float
    turning: float


class Reference(NamedTuple):
    """Where the base is to be: position, velocity, acceleration in W, attitude, rate, its derivative in W."""

    p: Vector
    v: Vector
    a: Vector
    q: Quaternion
    w: Vector
    dw: Vector


@dataclass(frozen=True, kw_only=True)
class Profile:
    """A straight line and a turn about one axis, both of minimum jerk, over the same time.

    p(t) = p_0 + s(t/T) d + h(t/T) T v_0 and q(t) = q_0 exp(s(t/T) phi), with v_0 the velocity at the beginning: the
    line bends while that is braked. T is the shortest with which every bound holds, but that on speed only as far as
    v_0 itself keeps it: there the two parts' peaks are added. phi is in q_0's axes, phi_W the same turn in W.
    """

    p_0: Vector
    d: Vector
    v_0: Vector
    q_0: Quaternion
    phi: Vector
    phi_W: Vector
    T: float

    def at(self, t: float) -> Reference:
        """Return the reference a time t after the beginning; at rest at the goal from T on."""
        T = self.T
        x = min(max(t / T, 0.0), 1.0) if T > 0.0 else 1.0
        y = 1.0 - x
        s = x * x * x * (10.0 + x * (-15.0 + 6.0 * x))
        if x == 1.0:
            q = quaternion_multiply(self.q_0, from_rotation_vector(self.phi))
            return Reference(p=add(self.p_0, self.d), v=ZERO, a=ZERO, q=q, w=ZERO, dw=ZERO)
        ds, dds = 30.0 * x * x * y * y / T, 60.0 * x * y * (1.0 - x - x) / (T * T)
        h = T * x * (1.0 + x * x * (-6.0 + x * (8.0 - 3.0 * x)))
        dh, ddh = 1.0 + x * x * (-18.0 + x * (32.0 - 15.0 * x)), x * (-36.0 + x * (96.0 - 60.0 * x)) / T
        d, v_0, phi_W = self.d, self.v_0, self.phi_W
        return Reference(
            p=add_scaled(add_scaled(self.p_0, s, d), h, v_0),
            v=add_scaled(scale(ds, d), dh, v_0),
            a=add_scaled(scale(dds, d), ddh, v_0),
            q=quaternion_multiply(self.q_0, from_rotation_vector(scale(s, self.phi))),
            w=scale(ds, phi_W),
            dw=scale(dds, phi_W),
        )


def profile_between(p_0: Vector, v_0: Vector, q_0: Quaternion, p_1: Vector, q_1: Quaternion, bounds: Bounds) -> Profile:
    """Return the trajectory from one pose, with a velocity, to rest at another."""
    d = subtract(p_1, p_0)
    phi = rotation_vector(relative_quaternion(q_0, q_1))
    length, angle, speed = norm(d), norm(phi), norm(v_0)
    braking = _PEAK_BRAKING * speed
    return Profile(
        p_0=p_0,
        d=d,
        v_0=v_0,
        q_0=q_0,
        phi=phi,
        phi_W=rotate(rotation_matrix(q_0), phi),
        T=max(
            _PEAK_SPEED * length / max(bounds.speed - speed, bounds.speed / 2.0),
            (braking + math.sqrt(braking**2 + 4.0 * bounds.acceleration * _PEAK_ACCELERATION * length))
            / (2.0 * bounds.acceleration),
            _PEAK_SPEED * angle / bounds.rate,
            math.sqrt(_PEAK_ACCELERATION * angle / bounds.turning),
        ),
    )
