"""A light object that floats, alone or held by stiff springs, in steps as long as the robot's control period."""

from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.plain_rotation import ZERO, Rows, Triple, cross, norm, product, turned, turned_back
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.attachment import Attachment, Frame, Palm
from handover.plants.free_flyer.rigid_body import RigidBody
from handover.plants.free_flyer.rotations import along, matrix_of, turn_by, unit

Six = tuple[float, float, float, float, float, float]
Wrench = tuple[Triple, Triple]
Held = Sequence[tuple[Attachment, Frame]]
Scales = list[tuple[float, float]]

_TIGHTENINGS = 4
_TOLERANCE = 0.01
"""Relative; an attachment slides when its limit is exceeded by more."""


class FloatingObject:
    """A box in microgravity; held, it goes by the linearly implicit Euler rule, free by Runge and Kutta's.

    With nu = (v, w) at the end of a step, in the frame of its beginning, M the masses, b_i what attachment i does to an
    object at rest there, and its frame F_i where it is at the end of the step:

        (M + h sum_i J_i^T (h K_i + C_i) J_i) nu = (m v, L) + h sum_i J_i^T b_i,  J_i = [1, -r_i x; 0, 1],

    which is stable for any stiffness, and momentum balances to the last bit: an attachment's force in the step is
    b_i - (h K_i + C_i) J_i nu. The matrix is the same as long as the same attachments hold the same places, so its
    inverse is kept. A palm adds one row, solved by the Sherman-Morrison formula, that only pushes. Where a limit is
    exceeded, force or torque of the attachment is scaled down until it keeps it.

    Args:
        mass: in kg.
        sides: of the box, m.
        p: position of its centre in the world.
        q: orientation.
    """

    def __init__(self, mass: float, sides: Triple, body: RigidBody | None = None) -> None:
        a, b, c = (x * x for x in sides)
        self._moments = (mass * (b + c) / 12.0, mass * (a + c) / 12.0, mass * (a + b) / 12.0)
        self.body = body or RigidBody(mass, np.diag(self._moments), ZERO, ZERO, (1.0, 0.0, 0.0, 0.0))
        self._kept: dict[tuple[object, ...], list[list[float]]] = {}

    def advance(self, h: float, held: Held, palm: Palm | None) -> tuple[list[Wrench], Triple]:
        """Advance by h seconds.

        Returns:
            Force at its point and torque of each attachment on the object, and the palm's force on it, in the world.
        """
        body = self.body
        if not held and palm is None:
            body.advance(h, ZERO, ZERO, ZERO, ZERO)
            return [], ZERO
        R = matrix_of(body.q)
        loads = [a.load(F, body.p, body.q, R) for a, F in held]
        (vx, vy, vz), (lx, ly, lz), m = turned_back(R, body.v), turned_back(R, body.spin), body.mass
        momentum = (m * vx, m * vy, m * vz, lx, ly, lz)
        nu, push, wrenches = self._balanced(h, held, loads, [(1.0, 1.0)] * len(held), palm, momentum)
        if _too_much(held, wrenches):
            nu, push, wrenches = self._slide(h, held, loads, palm, momentum, wrenches)
        else:
            self._move(h, R, nu)
        f_palm = ZERO if palm is None else turned(R, along(ZERO, push, palm.n))
        return [(turned(R, f), turned(R, tau)) for f, tau in wrenches], f_palm

    def _slide(
        self,
        h: float,
        held: Held,
        loads: Sequence[Wrench],
        palm: Palm | None,
        momentum: Six,
        wrenches: list[Wrench],
    ) -> tuple[Six, float, list[Wrench]]:
        """Move while attachments keep their limits, and let those give way; return what `_balanced` does."""
        scales = [(1.0, 1.0)] * len(held)
        before = [(1.0, 1.0, 0.0, 0.0)] * len(held)
        for _ in range(_TIGHTENINGS):
            tighter, before = _tightened([a for a, _ in held], wrenches, scales, before)
            if tighter == scales:
                break
            scales = tighter
            _, _, wrenches = self._balanced(h, held, loads, scales, palm, momentum)
        nu, push, wrenches = self._balanced(h, held, loads, scales, palm, momentum)
        body = self.body
        self._move(h, matrix_of(body.q), nu)
        for (a, F), (s, s_turn) in zip(held, scales, strict=True):
            a.give_way(F, body.p, body.q, s, s_turn)
        return nu, push, wrenches

    def _balanced(
        self,
        h: float,
        held: Held,
        loads: Sequence[Wrench],
        scales: Scales,
        palm: Palm | None,
        momentum: Six,
    ) -> tuple[Six, float, list[Wrench]]:
        """Return nu, the palm's force, and the attachments' wrenches in the object's frame."""
        y0, y1, y2, y3, y4, y5 = momentum
        for (a, _), (f, tau), (s, s_turn) in zip(held, loads, scales, strict=True):
            hs, ht = h * s, h * s_turn
            fx, fy, fz = hs * f[0], hs * f[1], hs * f[2]
            rx, ry, rz = a.r
            y0, y1, y2 = y0 + fx, y1 + fy, y2 + fz
            y3 += ry * fz - rz * fy + ht * tau[0]
            y4 += rz * fx - rx * fz + ht * tau[1]
            y5 += rx * fy - ry * fx + ht * tau[2]
        rows = self._inverse(h, held, scales)
        nu, push = _applied(rows, (y0, y1, y2, y3, y4, y5)), 0.0
        if palm is not None:
            nu, push = _pressed(h, rows, nu, palm)
        return nu, push, [_wrench(h, a, b, s, nu) for (a, _), b, s in zip(held, loads, scales, strict=True)]

    def _inverse(self, h: float, held: Held, scales: Scales) -> list[list[float]]:
        key = (h, *[(a.r, id(a.stiffness), s) for (a, _), s in zip(held, scales, strict=True)])
        if key not in self._kept:
            if len(self._kept) >= 8:
                self._kept.clear()
            masses = np.diag([*[self.body.mass] * 3, *self._moments])
            for (a, _), (s, s_turn) in zip(held, scales, strict=True):
                J = np.hstack([np.eye(3), -_crossing(a.r)])
                masses += h * s * (a.stiffness.k * h + a.stiffness.c) * np.transpose(J) @ J
                masses[3:, 3:] += h * s_turn * (a.stiffness.k_turn * h + a.stiffness.c_turn) * np.eye(3)
            self._kept[key] = np.linalg.inv(masses).tolist()
        return self._kept[key]

    def _move(self, h: float, R: Rows, nu: Six) -> None:
        body = self.body
        w = nu[3:]
        body.v = turned(R, nu[:3])
        body.p = (body.p[0] + h * body.v[0], body.p[1] + h * body.v[1], body.p[2] + h * body.v[2])
        i, j, k = self._moments
        body.spin = turned(R, (i * w[0], j * w[1], k * w[2]))
        body.q = unit(product(body.q, turn_by((h * w[0], h * w[1], h * w[2]))))


def _pressed(h: float, rows: list[list[float]], nu: Six, palm: Palm) -> tuple[Six, float]:
    """Return nu as it becomes by a palm, and the palm's force, which only pushes."""
    J = (*palm.n, *cross(palm.r, palm.n))
    column = _applied(rows, J)
    g = palm.k * h + palm.c
    push = palm.k * palm.depth + palm.c * palm.speed - g * _dot(J, nu)
    push /= 1.0 + h * g * _dot(J, column)
    if push <= 0.0:
        return nu, 0.0
    a, b, c, d, e, f = (x + h * push * y for x, y in zip(nu, column, strict=True))
    return (a, b, c, d, e, f), push


def _dot(a: Six, b: Six) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _wrench(h: float, a: Attachment, load: Wrench, scale: tuple[float, float], nu: Six) -> Wrench:
    """Return force and torque of an attachment on an object that moves with nu, in the object's frame."""
    (fx, fy, fz), (tx, ty, tz) = load
    (s, s_turn), (rx, ry, rz), (vx, vy, vz, wx, wy, wz) = scale, a.r, nu
    g = a.stiffness.k * h + a.stiffness.c
    g_turn = a.stiffness.k_turn * h + a.stiffness.c_turn
    return (
        s * (fx - g * (vx + wy * rz - wz * ry)),
        s * (fy - g * (vy + wz * rx - wx * rz)),
        s * (fz - g * (vz + wx * ry - wy * rx)),
    ), (s_turn * (tx - g_turn * wx), s_turn * (ty - g_turn * wy), s_turn * (tz - g_turn * wz))


def _too_much(held: Held, wrenches: Sequence[Wrench]) -> bool:
    """Return whether a limit is exceeded."""
    for (a, _), ((fx, fy, fz), (tx, ty, tz)) in zip(held, wrenches, strict=True):
        s = a.stiffness
        if fx * fx + fy * fy + fz * fz > s.f_max * s.f_max or tx * tx + ty * ty + tz * tz > s.tau_max * s.tau_max:
            return True
    return False


def _tightened(
    attachments: Sequence[Attachment],
    wrenches: Sequence[Wrench],
    scales: Scales,
    before: list[tuple[float, float, float, float]],
) -> tuple[list[tuple[float, float]], list[tuple[float, float, float, float]]]:
    """Return scales that bring forces and torques to their limits, and the values that the next call needs."""
    tighter: list[tuple[float, float]] = []
    seen: list[tuple[float, float, float, float]] = []
    for a, (f, tau), (s, s_turn), (s_0, s_turn_0, f_0, tau_0) in zip(
        attachments, wrenches, scales, before, strict=True
    ):
        F, T = norm(f), norm(tau)
        tighter.append(
            (_scale(s, F, s_0, f_0, a.stiffness.f_max), _scale(s_turn, T, s_turn_0, tau_0, a.stiffness.tau_max))
        )
        seen.append((s, s_turn, F, T))
    return tighter, seen


def _scale(s: float, f: float, s_0: float, f_0: float, f_max: float) -> float:
    """Return the scale at which a force f (at scale s; f_0 at s_0) keeps its limit.

    1 / f is a linear function of 1 / s where the force works against springs and masses, so the secant goes by these.
    """
    if abs(f - f_max) <= _TOLERANCE * f_max or (s == 1.0 and f < f_max):
        return s
    guess = s * f_max / f
    if s != s_0 and f_0 > 0.0 and f != f_0:
        inverse = 1.0 / s + (1.0 / f_max - 1.0 / f) * (1.0 / s - 1.0 / s_0) / (1.0 / f - 1.0 / f_0)
        guess = 1.0 / inverse if inverse > 1.0 else guess
    return min(1.0, guess)


def _applied(rows: list[list[float]], y: Sequence[float]) -> Six:
    y0, y1, y2, y3, y4, y5 = y
    a, b, c, d, e, f = [r[0] * y0 + r[1] * y1 + r[2] * y2 + r[3] * y3 + r[4] * y4 + r[5] * y5 for r in rows]
    return a, b, c, d, e, f


def _crossing(a: Triple) -> Floats:
    x, y, z = a
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
