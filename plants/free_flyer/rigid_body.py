"""A rigid body that floats: Newton's and Euler's laws in momenta, with a quaternion."""

import math

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Matrix,
    Quaternion,
    Vector,
    add,
    add_scaled,
    dot,
    inverse_rotate,
    multiply,
    norm,
    normalize,
    quaternion_add_scaled,
    quaternion_dot,
    quaternion_runge_kutta_step,
    rotate,
    rotation_matrix,
    row_major,
    runge_kutta_step,
    weighted_sum,
)
from handover.cosim.blocks.ports import Floats

UNIT_TOLERANCE = 1e-6
"""How far the norm of a quaternion that is given may be from 1."""

Wrenches = tuple[Vector, Vector, Vector, Vector]
"""Force and torque in the body's frame, and in the world."""


class TurnsTooFast(ArithmeticError):
    """The body turns too far in a step to be followed."""

    def __init__(self, rate: float, h: float) -> None:
        text = f"a body turns by {rate * h:.3g} rad, {rate:.3g} rad/s, in a step of {h:g} s: too far to be followed"
        super().__init__(f"{text}; step it shorter, or let less torque act on it")
        self.rate, self.h = rate, h


class RigidBody:
    """Pose and momenta of a body under a wrench fixed in the body B and one fixed in the world W that acts at G.

    m v' = R f_B + f_G, L' = R tau_B + (R p_BG) x f_G + tau_G, q' = q (0, w) / 2 with w = I^-1 R^T L, R = R(q),
    integrated by the classical Runge-Kutta rule of order 4 and the quaternion brought back to norm 1 after each step.
    Momenta instead of velocities are integrated, so they stay what they are, to the last bit, without wrench.

    Args:
        mass: in kg.
        I_B: inertia about the centre of mass, (3, 3), in the body's frame, kg m^2.
        p_BG: where the wrench in world coordinates acts, seen from the centre of mass, in the body's frame, m.
        p: position of the centre of mass in the world, m.
        q: orientation, a unit quaternion.
        v: velocity of the centre of mass in the world, m/s.
        w: angular velocity in world coordinates, rad/s.

    Attributes:
        spin: angular momentum L about the centre of mass, in world coordinates, kg m^2/s.

    Raises:
        TurnsTooFast: by `advance`, where a step's turn is so large that the quaternion's norm leaves 1 by 0.005.
    """

    def __init__(
        self, mass: float, I_B: Floats, p_BG: Vector, p: Vector, q: Quaternion, v: Vector = ZERO, w: Vector = ZERO
    ) -> None:
        self.mass = mass
        self.p_BG = p_BG
        self._inertia = row_major(np.asarray(I_B, dtype=np.float64))
        self._inverse = row_major(np.asarray(np.linalg.inv(I_B), dtype=np.float64))
        self._constants = (1.0 / mass, self._inverse, p_BG)
        self.p, self.q, self.v = p, q, v
        R = rotation_matrix(q)
        self.spin: Vector = rotate(R, multiply(self._inertia, inverse_rotate(R, w)))

    @property
    def w(self) -> Vector:
        """Angular velocity in world coordinates, in rad/s."""
        return self.angular_velocity(rotation_matrix(self.q))

    def angular_velocity(self, R: Matrix) -> Vector:
        """Return w, where R, the matrix of q, is at hand."""
        return rotate(R, multiply(self._inverse, inverse_rotate(R, self.spin)))

    @property
    def energy(self) -> float:
        """Kinetic energy, in J."""
        return 0.5 * (self.mass * dot(self.v, self.v) + dot(self.w, self.spin))

    def advance(self, h: float, f_B: Vector, tau_B: Vector, f_G: Vector, tau_G: Vector) -> None:
        """Advance by h seconds with both wrenches held."""
        q, L, wrench, constants = self.q, self.spin, (f_B, tau_B, f_G, tau_G), self._constants
        a_1, dL_1, dq_1 = momentum_rates(*constants, q, L, wrench)
        q_2, L_2 = quaternion_add_scaled(q, 0.5 * h, dq_1), add_scaled(L, 0.5 * h, dL_1)
        a_2, dL_2, dq_2 = momentum_rates(*constants, q_2, L_2, wrench)
        q_3, L_3 = quaternion_add_scaled(q, 0.5 * h, dq_2), add_scaled(L, 0.5 * h, dL_2)
        a_3, dL_3, dq_3 = momentum_rates(*constants, q_3, L_3, wrench)
        q_4, L_4 = quaternion_add_scaled(q, h, dq_3), add_scaled(L, h, dL_3)
        a_4, dL_4, dq_4 = momentum_rates(*constants, q_4, L_4, wrench)
        self.p = weighted_sum(1.0, self.p, h, self.v, h * (h / 6.0), add(add(a_1, a_2), a_3))
        self.v = runge_kutta_step(self.v, h, a_1, a_2, a_3, a_4)
        self.spin = runge_kutta_step(L, h, dL_1, dL_2, dL_3, dL_4)
        q_5 = quaternion_runge_kutta_step(q, h, dq_1, dq_2, dq_3, dq_4)
        if not 0.99 < quaternion_dot(q_5, q_5) < 1.01:
            raise TurnsTooFast(norm(self.w), h)
        self.q = normalize(q_5)


def momentum_rates(
    inverse_mass: float, inverse_inertia: Matrix, p_BG: Vector, q: Quaternion, L: Vector, wrench: Wrenches
) -> tuple[Vector, Vector, Quaternion]:
    """Return v', L' and q' of `RigidBody`.

    v' = (R f_B + f_G) / m, L' = R tau_B + (R p_BG) x f_G + tau_G, q' = q (0, w) / 2 with w = I^-1 R^T L. Written out
    by component, because it is called four times a step: with functions of vectors a step takes a tenth longer.

    Args:
        inverse_mass: 1 / m, 1/kg.
        inverse_inertia: I^-1 in the body's frame, 1/(kg m^2).
        p_BG: where f_G acts, seen from the centre of mass, in the body's frame, m.
        q: orientation, a unit quaternion to rounding of the integration.
        L: angular momentum in the world, kg m^2/s.
        wrench: f_B and tau_B in the body's frame, f_G and tau_G in the world, N and N m.
    """
    (fx, fy, fz), (tx, ty, tz), (gx, gy, gz), (sx, sy, sz) = wrench
    a, b, c, d = q
    lx, ly, lz = L
    bb, cc, dd, bc, bd, cd, ab, ac, ad = b * b, c * c, d * d, b * c, b * d, c * d, a * b, a * c, a * d
    r00, r01, r02 = 1.0 - 2.0 * (cc + dd), 2.0 * (bc - ad), 2.0 * (bd + ac)
    r10, r11, r12 = 2.0 * (bc + ad), 1.0 - 2.0 * (bb + dd), 2.0 * (cd - ab)
    r20, r21, r22 = 2.0 * (bd - ac), 2.0 * (cd + ab), 1.0 - 2.0 * (bb + cc)
    ex, ey, ez = p_BG
    ax, ay, az = r00 * ex + r01 * ey + r02 * ez, r10 * ex + r11 * ey + r12 * ez, r20 * ex + r21 * ey + r22 * ez
    i00, i01, i02, i10, i11, i12, i20, i21, i22 = inverse_inertia
    mx, my, mz = r00 * lx + r10 * ly + r20 * lz, r01 * lx + r11 * ly + r21 * lz, r02 * lx + r12 * ly + r22 * lz
    wx = 0.5 * (i00 * mx + i01 * my + i02 * mz)
    wy = 0.5 * (i10 * mx + i11 * my + i12 * mz)
    wz = 0.5 * (i20 * mx + i21 * my + i22 * mz)
    s = inverse_mass
    return (
        (
            s * (r00 * fx + r01 * fy + r02 * fz + gx),
            s * (r10 * fx + r11 * fy + r12 * fz + gy),
            s * (r20 * fx + r21 * fy + r22 * fz + gz),
        ),
        (
            r00 * tx + r01 * ty + r02 * tz + ay * gz - az * gy + sx,
            r10 * tx + r11 * ty + r12 * tz + az * gx - ax * gz + sy,
            r20 * tx + r21 * ty + r22 * tz + ax * gy - ay * gx + sz,
        ),
        (
            -b * wx - c * wy - d * wz,
            a * wx + c * wz - d * wy,
            a * wy + d * wx - b * wz,
            a * wz + b * wy - c * wx,
        ),
    )


def inertia_faults(mass: float, I_B: Floats) -> list[str]:
    """Return what is wrong with a mass in kg and an inertia about the centre of mass, (3, 3), in kg m^2."""
    faults: list[str] = []
    if not 0.0 < mass < math.inf:
        faults.append(f"mass {mass:g} kg must be positive and finite")
    if not np.all(np.isfinite(I_B)):
        return [*faults, f"I_B {np.asarray(I_B).tolist()} kg m2 must be finite"]
    if not np.allclose(I_B, np.transpose(I_B), rtol=0.0, atol=1e-9 * float(np.max(np.abs(I_B)))):
        return [*faults, f"I_B {np.asarray(I_B).tolist()} kg m2 must be symmetric"]
    small, middle, large = sorted(float(a) for a in np.linalg.eigvalsh(I_B))
    moments = f"its principal moments are {small:g}, {middle:g}, {large:g} kg m2"
    if not small > 0.0:
        faults.append(f"I_B must be positive definite; {moments}")
    elif large > (small + middle) * (1.0 + 1e-9):
        faults.append(f"no body has this I_B: {moments}, and the largest may not exceed the sum of the others")
    return faults


def unit_faults(name: str, q: Floats) -> list[str]:
    """Return what is wrong with a quaternion that should have norm 1."""
    length = float(np.linalg.norm(q))
    if abs(length - 1.0) <= UNIT_TOLERANCE:
        return []
    return [f"{name} {np.asarray(q).tolist()} must be a unit quaternion; its norm is {length:g}"]
