"""A free-flyer's way to a pose, within bounds of speed and acceleration."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from handover.controllers.free_flyer.rotations import quaternion_about, rotation_vector, rows_of, seen_from
from handover.cosim.blocks.plain_rotation import Quaternion, Triple, norm, product, turned

_PEAK_SPEED = 1.875  # of s(x) = 10 x^3 - 15 x^4 + 6 x^5, from 0 to 1 in unit time
_PEAK_ACCELERATION = 10.0 / math.sqrt(3.0)
_PEAK_BRAKING = 3.94  # of h(x) = x - 6 x^3 + 8 x^4 - 3 x^5, which begins with unit speed and ends where it began


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Largest speed and acceleration of the way's translation (m/s, m/s2) and rotation (rad/s, rad/s2)."""

    speed: float
    acceleration: float
    rate: float
    turning: float


class Reference(NamedTuple):
    """Where the base is to be: position, velocity, acceleration in W, attitude, rate, its derivative in W."""

    p: Triple
    v: Triple
    a: Triple
    q: Quaternion
    w: Triple
    dw: Triple


@dataclass(frozen=True, kw_only=True)
class Profile:
    """A straight line and a turn about one axis, both of minimum jerk, over the same time.

    p(t) = p_0 + s(t/T) d + h(t/T) T v_0 and q(t) = q_0 exp(s(t/T) phi), with v_0 the velocity at the beginning: the
    line bends while that is braked. T is the shortest with which every bound holds, but that on speed only as far as
    v_0 itself keeps it: there the two parts' peaks are added. phi is in q_0's axes, phi_W the same turn in W.
    """

    p_0: Triple
    d: Triple
    v_0: Triple
    q_0: Quaternion
    phi: Triple
    phi_W: Triple
    T: float

    def at(self, t: float) -> Reference:
        """Return the reference a time t after the beginning; at rest at the goal from T on."""
        T = self.T
        x = min(max(t / T, 0.0), 1.0) if T > 0.0 else 1.0
        y = 1.0 - x
        s = x * x * x * (10.0 + x * (-15.0 + 6.0 * x))
        p_x, p_y, p_z = self.p_0
        d_x, d_y, d_z = self.d
        if x == 1.0:
            still = (0.0, 0.0, 0.0)
            q = product(self.q_0, quaternion_about(self.phi))
            return Reference(p=(p_x + d_x, p_y + d_y, p_z + d_z), v=still, a=still, q=q, w=still, dw=still)
        ds, dds = 30.0 * x * x * y * y / T, 60.0 * x * y * (1.0 - x - x) / (T * T)
        h = T * x * (1.0 + x * x * (-6.0 + x * (8.0 - 3.0 * x)))
        dh, ddh = 1.0 + x * x * (-18.0 + x * (32.0 - 15.0 * x)), x * (-36.0 + x * (96.0 - 60.0 * x)) / T
        v_x, v_y, v_z = self.v_0
        f_x, f_y, f_z = self.phi
        a_x, a_y, a_z = self.phi_W
        return Reference(
            p=(p_x + s * d_x + h * v_x, p_y + s * d_y + h * v_y, p_z + s * d_z + h * v_z),
            v=(ds * d_x + dh * v_x, ds * d_y + dh * v_y, ds * d_z + dh * v_z),
            a=(dds * d_x + ddh * v_x, dds * d_y + ddh * v_y, dds * d_z + ddh * v_z),
            q=product(self.q_0, quaternion_about((s * f_x, s * f_y, s * f_z))),
            w=(ds * a_x, ds * a_y, ds * a_z),
            dw=(dds * a_x, dds * a_y, dds * a_z),
        )


def profile_between(p_0: Triple, v_0: Triple, q_0: Quaternion, p_1: Triple, q_1: Quaternion, bounds: Bounds) -> Profile:
    """Return the way from one pose, with a velocity, to rest at another."""
    d = (p_1[0] - p_0[0], p_1[1] - p_0[1], p_1[2] - p_0[2])
    phi = rotation_vector(seen_from(q_0, q_1))
    length, angle, speed = norm(d), norm(phi), norm(v_0)
    braking = _PEAK_BRAKING * speed
    return Profile(
        p_0=p_0,
        d=d,
        v_0=v_0,
        q_0=q_0,
        phi=phi,
        phi_W=turned(rows_of(q_0), phi),
        T=max(
            _PEAK_SPEED * length / max(bounds.speed - speed, bounds.speed / 2.0),
            (braking + math.sqrt(braking**2 + 4.0 * bounds.acceleration * _PEAK_ACCELERATION * length))
            / (2.0 * bounds.acceleration),
            _PEAK_SPEED * angle / bounds.rate,
            math.sqrt(_PEAK_ACCELERATION * angle / bounds.turning),
        ),
    )
