"""Rigid-link kinematics of an anthropomorphic arm with three joints. [Gandarias2020] eqs. (1)-(8), corrected."""

import enum
import math
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.origins import assumed, read_off
from handover.cosim.blocks.ports import Floats, parameter
from handover.cosim.blocks.units import Metre

_KNOWN = assumed("the controller knows the arm's dimensions, which are not given")


class Elbow(enum.IntEnum):
    """Configuration of the arm, lambda of [Gandarias2020] eqs. (3) and (4)."""

    UP = 0
    DOWN = 1

    @property
    def sign(self) -> float:
        """Lambda: 1 with the elbow up, -1 with it down."""
        return 1.0 if self is Elbow.UP else -1.0


@dataclass(frozen=True, kw_only=True)
class ArmParameters:
    """What each unit that computes with rigid links declares of the arm."""

    elbow: Elbow = parameter(
        Elbow.UP,
        "which way the elbow points; down, it is below the ground on the paper's paths",
        origin=read_off("fig. 1(a) shows the elbow above the line from shoulder to tip"),
    )
    L_1: Metre = parameter(0.15, "height of the shoulder", minimum=0.0, maximum=10.0, origin=_KNOWN)
    L_2: Metre = parameter(0.225, "length of link 2", minimum=0.001, maximum=10.0, origin=_KNOWN)
    L_3: Metre = parameter(0.225, "length of link 3", minimum=0.001, maximum=10.0, origin=_KNOWN)


class Unreachable(ValueError):
    """The tip cannot be at a point; `p_WG` is the point, `fault` says why."""

    def __init__(self, p_WG: Floats, fault: str) -> None:
        super().__init__(f"{format_point(p_WG)}: {fault}")
        self.p_WG, self.fault = p_WG, fault


@dataclass(frozen=True)
class VslKinematics:
    """Forward and inverse kinematics and Jacobian of rigid links; W has its origin at the foot of J1's axis.

    Angles q = [theta_1, theta_2, theta_3], shape (3,), rad: theta_1 about z, theta_2 from the horizontal upwards,
    theta_3 from link 2 to link 3 upwards. The elbow is up where theta_3 is negative.

    Two printed equations are corrected: eq. (4) by theta_3 = -lambda (pi - arccos(.)), and eq. (8) by J_22 = -s1 (L2 s2
    + L3 s23), J_23 = -L3 s1 s23. Both misprints of eq. (8) vanish at theta_1 = 0. Eq. (2) is read as atan2(Y, X).

    Attributes:
        L_1: height of the shoulder above the foot, m.
        L_2, L_3: lengths of the links, m.
        elbow: which of the two solutions `inverse` gives.
    """

    L_1: float
    L_2: float
    L_3: float
    elbow: Elbow

    @property
    def reach(self) -> tuple[float, float]:
        """Least and greatest distance of the tip from the shoulder, m."""
        return abs(self.L_2 - self.L_3), self.L_2 + self.L_3

    def forward(self, q: Floats) -> Floats:
        """Return the tip's position p_WG, shape (3,), m: the last column of eq. (1)."""
        theta_1, theta_2, theta_3 = q.tolist()
        r_1 = self.L_2 * math.cos(theta_2) + self.L_3 * math.cos(theta_2 + theta_3)
        r_2 = self.L_2 * math.sin(theta_2) + self.L_3 * math.sin(theta_2 + theta_3)
        return np.array([r_1 * math.cos(theta_1), r_1 * math.sin(theta_1), self.L_1 + r_2])

    def bent(self, q: Floats, inclinations: Floats, shares: Floats) -> Floats:
        """Return the tip's position p_WG, shape (3,), m, of links that bend in the arm's plane, by their ends.

        A link begins at the angle phi_0 of its joint, joint 3 on the end of link 2, and ends at phi_1; from its first
        to its last point it leads at phi_0 + s (phi_1 - phi_0). s is 1/2 of a cantilever under a moment at its end, 2/3
        under a weight there, and 1 where the joint alone yields behind its encoder.

        Args:
            q: angles by the encoders, shape (3,), rad.
            inclinations: of the ends of links 2 and 3, shape (2,), rad.
            shares: s of links 2 and 3, shape (2,).
        """
        theta_1, theta_2, theta_3 = q.tolist()
        (end_2, end_3), (s_2, s_3) = inclinations.tolist(), shares.tolist()
        phi_2, begin_3 = theta_2 + s_2 * (end_2 - theta_2), end_2 + theta_3
        phi_3 = begin_3 + s_3 * (end_3 - begin_3)
        r_1 = self.L_2 * math.cos(phi_2) + self.L_3 * math.cos(phi_3)
        r_2 = self.L_2 * math.sin(phi_2) + self.L_3 * math.sin(phi_3)
        return np.array([r_1 * math.cos(theta_1), r_1 * math.sin(theta_1), self.L_1 + r_2])

    def inverse(self, p_WG: Floats) -> Floats:
        """Return the angles q, shape (3,), that put the tip at p_WG, shape (3,): eqs. (2)-(7).

        On J1's axis, where any theta_1 would do, theta_1 is 0.

        Raises:
            Unreachable: the point is nearer to the shoulder, or farther, than the links can reach, or it is the
                shoulder, where any theta_2 would do.
        """
        X, Y, Z = p_WG.tolist()
        r_1 = math.hypot(X, Y)
        r_2 = Z - self.L_1
        r_3 = math.hypot(r_1, r_2)
        least, greatest = self.reach
        if not least - 1e-12 <= r_3 <= greatest + 1e-12:
            text = f"it is {r_3:.4g} m from the shoulder, and the links reach {least:.4g} .. {greatest:.4g} m"
            raise Unreachable(p_WG, f"out of reach: {text}")
        if r_3 == 0.0:
            raise Unreachable(p_WG, "singular: it is the shoulder itself, where the elbow is folded")
        at_shoulder = (r_3**2 + self.L_2**2 - self.L_3**2) / (2.0 * r_3 * self.L_2)
        at_elbow = (self.L_2**2 + self.L_3**2 - r_3**2) / (2.0 * self.L_2 * self.L_3)
        sign = self.elbow.sign
        theta_2 = math.atan2(r_2, r_1) + sign * math.acos(_cosine(at_shoulder))
        theta_3 = -sign * (math.pi - math.acos(_cosine(at_elbow)))
        return np.array([math.atan2(Y, X), theta_2, theta_3])

    def jacobian(self, q: Floats) -> Floats:
        """Return J(q), shape (3, 3), of eq. (8): v_WG = J(q) q', m."""
        theta_1, theta_2, theta_3 = q.tolist()
        c1, s1 = math.cos(theta_1), math.sin(theta_1)
        a, b = self.L_2 * math.cos(theta_2), self.L_3 * math.cos(theta_2 + theta_3)
        c, d = self.L_2 * math.sin(theta_2), self.L_3 * math.sin(theta_2 + theta_3)
        return np.array(
            [
                [-s1 * (a + b), -c1 * (c + d), -c1 * d],
                [c1 * (a + b), -s1 * (c + d), -s1 * d],
                [0.0, a + b, b],
            ]
        )

    def joint_velocities(self, q: Floats, v_WG: Floats) -> Floats:
        """Return q' = J(q)^-1 v_WG, shape (3,), rad/s, that moves the tip at v_WG, shape (3,), m/s.

        Raises:
            numpy.linalg.LinAlgError: J is singular.
        """
        return np.asarray(np.linalg.solve(self.jacobian(q), v_WG), dtype=np.float64)

    def joint_path(self, points: Floats, velocities: Floats, theta_1: float) -> tuple[list[Floats], list[Floats]]:
        """Return the angles at n + 1 points of a path, rad, and the joint velocities at the first n, rad/s.

        Joint 1 goes on past half a turn instead of all the way back.

        Args:
            points: shape (n + 1, 3), m.
            velocities: of the tip there, shape (n + 1, 3), m/s.
            theta_1: angle of joint 1 before, rad.

        Raises:
            Unreachable: as `inverse`.
            numpy.linalg.LinAlgError: as `joint_velocities`.
        """
        q = [self.inverse(x) for x in points]
        for angles, unwrapped in zip(q, np.unwrap([theta_1, *(a[0] for a in q)])[1:], strict=True):
            angles[0] = unwrapped
        return q, [self.joint_velocities(a, v) for a, v in zip(q[:-1], velocities[:-1], strict=True)]

    def singularity(self, p_WG: Floats, margin: float) -> str | None:
        """Return which singularity of J, where det J = -L2 L3 s3 (L2 c2 + L3 c23) is 0, is nearer than margin, or None.

        Args:
            p_WG: a point, shape (3,), m.
            margin: distance from where the elbow is stretched or folded, or from J1's axis, in m.
        """
        X, Y, Z = p_WG.tolist()
        r_1 = math.hypot(X, Y)
        r_3 = math.hypot(r_1, Z - self.L_1)
        least, greatest = self.reach
        if r_3 > greatest - margin:
            return f"the elbow is stretched: {r_3:.4g} m from the shoulder, of L_2 + L_3 = {greatest:.4g} m"
        if r_3 < least + margin:
            return f"the elbow is folded: {r_3:.4g} m from the shoulder, where |L_2 - L_3| = {least:.4g} m"
        if r_1 < margin:
            return f"it is on the axis of joint 1, {r_1:.4g} m from it"
        return None

    def fault(self, p_WG: Floats, margin: float) -> str | None:
        """Return why the tip cannot be at a point of a path, or a singularity is too near, or None.

        Args:
            p_WG: the point, shape (3,), m.
            margin: see `singularity`.
        """
        if not np.all(np.isfinite(p_WG)):
            return "it is not finite"
        try:
            self.inverse(p_WG)
        except Unreachable as e:
            least, greatest = self.reach
            r_3 = math.dist(p_WG, (0.0, 0.0, self.L_1))
            by = f", {1000.0 * (r_3 - greatest):.4g} mm too far" if r_3 > greatest else ""
            by = f", {1000.0 * (least - r_3):.4g} mm too near" if r_3 < least else by
            return e.fault + by
        fault = self.singularity(p_WG, margin)
        return fault and f"singular: {fault}"


def _cosine(x: float) -> float:
    """Clip what rounding adds at the limits of reach."""
    return min(1.0, max(-1.0, x))


def format_point(p_WG: Floats) -> str:
    """Return a point, shape (3,), m, as text for a message."""
    return "(" + ", ".join(f"{x:.4g}" for x in p_WG.tolist()) + ") m"
