"""A rigid body that floats: Newton's and Euler's laws in momenta, with a quaternion."""

import math

import numpy as np

from handover.cosim.blocks.plain_rotation import ZERO, Quaternion, Triple, rows, turned, turned_back
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.rotations import matrix_of

UNIT_TOLERANCE = 1e-6
"""How far the norm of a quaternion that is given may be from 1."""

_Rates = tuple[float, float, float, float, float, float, float, float, float, float]


class TurnsTooFast(ArithmeticError):
    """The body turns too far in a step to be followed."""

    def __init__(self, rate: float, h: float) -> None:
        super().__init__(f"a body turns by {rate * h:.3g} rad, {rate:.3g} rad/s, in a step of {h:g} s: too far for it")
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
        self, mass: float, I_B: Floats, p_BG: Triple, p: Triple, q: Quaternion, v: Triple = ZERO, w: Triple = ZERO
    ) -> None:
        self.mass = mass
        self.p_BG = p_BG
        self._inertia = rows(np.asarray(I_B, dtype=np.float64))
        self._inverse = rows(np.asarray(np.linalg.inv(I_B), dtype=np.float64))
        self.p, self.q, self.v = p, q, v
        R = matrix_of(q)
        self.spin: Triple = turned(R, turned(self._inertia, turned_back(R, w)))

    @property
    def w(self) -> Triple:
        """Angular velocity in world coordinates, in rad/s."""
        R = matrix_of(self.q)
        return turned(R, turned(self._inverse, turned_back(R, self.spin)))

    @property
    def energy(self) -> float:
        """Kinetic energy, in J."""
        v, w, L = self.v, self.w, self.spin
        return 0.5 * (self.mass * sum(a * a for a in v) + sum(a * b for a, b in zip(w, L, strict=True)))

    def advance(self, h: float, f_B: Triple, tau_B: Triple, f_G: Triple, tau_G: Triple) -> None:
        """Advance by h seconds with both wrenches held."""
        q, L, wrench = self.q, self.spin, (f_B, tau_B, f_G, tau_G)
        k1 = self._rates(q, L, wrench)
        k2 = self._rates(*_moved(q, L, 0.5 * h, k1), wrench)
        k3 = self._rates(*_moved(q, L, 0.5 * h, k2), wrench)
        k4 = self._rates(*_moved(q, L, h, k3), wrench)
        s = h / 6.0
        (ax1, ay1, az1, lx1, ly1, lz1, q01, q11, q21, q31) = k1
        (ax2, ay2, az2, lx2, ly2, lz2, q02, q12, q22, q32) = k2
        (ax3, ay3, az3, lx3, ly3, lz3, q03, q13, q23, q33) = k3
        (ax4, ay4, az4, lx4, ly4, lz4, q04, q14, q24, q34) = k4
        (px, py, pz), (vx, vy, vz) = self.p, self.v
        t = h * s
        self.p = (
            px + h * vx + t * (ax1 + ax2 + ax3),
            py + h * vy + t * (ay1 + ay2 + ay3),
            pz + h * vz + t * (az1 + az2 + az3),
        )
        self.v = (
            vx + s * (ax1 + 2.0 * (ax2 + ax3) + ax4),
            vy + s * (ay1 + 2.0 * (ay2 + ay3) + ay4),
            vz + s * (az1 + 2.0 * (az2 + az3) + az4),
        )
        self.spin = (
            L[0] + s * (lx1 + 2.0 * (lx2 + lx3) + lx4),
            L[1] + s * (ly1 + 2.0 * (ly2 + ly3) + ly4),
            L[2] + s * (lz1 + 2.0 * (lz2 + lz3) + lz4),
        )
        q0 = q[0] + s * (q01 + 2.0 * (q02 + q03) + q04)
        q1 = q[1] + s * (q11 + 2.0 * (q12 + q13) + q14)
        q2 = q[2] + s * (q21 + 2.0 * (q22 + q23) + q24)
        q3 = q[3] + s * (q31 + 2.0 * (q32 + q33) + q34)
        square = q0 * q0 + q1 * q1 + q2 * q2 + q3 * q3
        if not 0.99 < square < 1.01:
            raise TurnsTooFast(math.dist(self.w, ZERO), h)
        n = 1.0 / math.sqrt(square)
        self.q = (q0 * n, q1 * n, q2 * n, q3 * n)

    def _rates(self, q: Quaternion, L: Triple, wrench: tuple[Triple, Triple, Triple, Triple]) -> _Rates:
        """Return v', L' and q'; written out, because this is where a run spends its time."""
        (fx, fy, fz), (tx, ty, tz), (gx, gy, gz), (sx, sy, sz) = wrench
        a, b, c, d = q
        lx, ly, lz = L
        bb, cc, dd, bc, bd, cd, ab, ac, ad = b * b, c * c, d * d, b * c, b * d, c * d, a * b, a * c, a * d
        r00, r01, r02 = 1.0 - 2.0 * (cc + dd), 2.0 * (bc - ad), 2.0 * (bd + ac)
        r10, r11, r12 = 2.0 * (bc + ad), 1.0 - 2.0 * (bb + dd), 2.0 * (cd - ab)
        r20, r21, r22 = 2.0 * (bd - ac), 2.0 * (cd + ab), 1.0 - 2.0 * (bb + cc)
        ex, ey, ez = self.p_BG
        ax, ay, az = r00 * ex + r01 * ey + r02 * ez, r10 * ex + r11 * ey + r12 * ez, r20 * ex + r21 * ey + r22 * ez
        i00, i01, i02, i10, i11, i12, i20, i21, i22 = self._inverse
        mx, my, mz = r00 * lx + r10 * ly + r20 * lz, r01 * lx + r11 * ly + r21 * lz, r02 * lx + r12 * ly + r22 * lz
        wx = 0.5 * (i00 * mx + i01 * my + i02 * mz)
        wy = 0.5 * (i10 * mx + i11 * my + i12 * mz)
        wz = 0.5 * (i20 * mx + i21 * my + i22 * mz)
        s = 1.0 / self.mass
        return (
            s * (r00 * fx + r01 * fy + r02 * fz + gx),
            s * (r10 * fx + r11 * fy + r12 * fz + gy),
            s * (r20 * fx + r21 * fy + r22 * fz + gz),
            r00 * tx + r01 * ty + r02 * tz + ay * gz - az * gy + sx,
            r10 * tx + r11 * ty + r12 * tz + az * gx - ax * gz + sy,
            r20 * tx + r21 * ty + r22 * tz + ax * gy - ay * gx + sz,
            -b * wx - c * wy - d * wz,
            a * wx + c * wz - d * wy,
            a * wy + d * wx - b * wz,
            a * wz + b * wy - c * wx,
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
    told = f"its principal moments are {small:g}, {middle:g}, {large:g} kg m2"
    if not small > 0.0:
        faults.append(f"I_B must be positive definite; {told}")
    elif large > (small + middle) * (1.0 + 1e-9):
        faults.append(f"no body has this I_B: {told}, and the largest may not exceed the sum of the others")
    return faults


def unit_faults(name: str, q: Floats) -> list[str]:
    """Return what is wrong with a quaternion that should have norm 1."""
    norm = float(np.linalg.norm(q))
    if abs(norm - 1.0) <= UNIT_TOLERANCE:
        return []
    return [f"{name} {np.asarray(q).tolist()} must be a unit quaternion; its norm is {norm:g}"]


def _moved(q: Quaternion, L: Triple, h: float, k: _Rates) -> tuple[Quaternion, Triple]:
    return (
        (q[0] + h * k[6], q[1] + h * k[7], q[2] + h * k[8], q[3] + h * k[9]),
        (L[0] + h * k[3], L[1] + h * k[4], L[2] + h * k[5]),
    )
