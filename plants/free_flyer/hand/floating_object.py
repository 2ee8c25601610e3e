"""A light object that floats freely or is held by stiff springs, stable at steps as long as a control period."""

import math
from collections.abc import Sequence

import numpy as np

from handover.cosim.blocks.geometry import skew
from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Matrix,
    Vector,
    add,
    add_cross,
    add_scaled,
    column,
    cross,
    dot,
    from_rotation_vector,
    inverse_rotate,
    norm,
    normalize,
    quaternion_multiply,
    rotate,
    rotation_matrix,
    scale,
    subtract,
)
from handover.plants.free_flyer.hand.attachment import Attachment, Frame, Palm
from handover.plants.free_flyer.rigid_body import RigidBody

Six = tuple[float, float, float, float, float, float]
Wrench = tuple[Vector, Vector]
Held = Sequence[tuple[Attachment, Frame]]
Scales = list[tuple[float, float]]

_TURN = 0.5
"""Radians by which a free object turns at most in a part of a step: a rod that is hit at its edge may spin fast."""
_MAX_TIGHTENINGS = 4
_TOLERANCE = 0.01
"""Relative; an attachment slides when its limit is exceeded by more."""
_MAX_SWEEPS, _AGREED = 50, 1e-6
"""How often palms are solved in turn at most, and the change of a force in newtons at which they agree."""


class FloatingObject:
    """A box in microgravity; held, it is advanced by the linearly implicit Euler rule, free by Runge-Kutta.

    With nu = (v, w) at the end of a step, in the frame of its beginning, M the masses, b_i what attachment i does to an
    object at rest there, and its frame F_i where it is at the end of the step:

        (M + h sum_i J_i^T (h K_i + C_i) J_i) nu = (m v, L) + h sum_i J_i^T b_i,  J_i = [1, -r_i x; 0, 1],

    which is stable for any stiffness, and momentum balances to the last bit: an attachment's force in the step is b_i -
    (h K_i + C_i) J_i nu. The matrix is the same as long as the same attachments hold the same places, so its inverse is
    kept. A palm adds one row, solved by the Sherman-Morrison formula, that only pushes; of more, each is solved with
    the others' forces held, in turn, until they agree (projected Gauss-Seidel). Where a limit is exceeded, force or
    torque of the attachment is scaled down to it.

    Args:
        mass: in kg.
        sides: of the box, m.
        body: advanced instead of a new one at rest in the world's origin.
    """

    def __init__(self, mass: float, sides: Vector, body: RigidBody | None = None) -> None:
        a, b, c = (x * x for x in sides)
        self._moments = (mass * (b + c) / 12.0, mass * (a + c) / 12.0, mass * (a + b) / 12.0)
        self.body = body or RigidBody(mass, np.diag(self._moments), ZERO, ZERO, (1.0, 0.0, 0.0, 0.0))
        self._inverses: dict[tuple[object, ...], list[list[float]]] = {}

    def advance(self, h: float, held: Held, palms: Sequence[Palm]) -> tuple[list[Wrench], list[Vector]]:
        """Advance by h seconds.

        Returns:
            Force at its point and torque of each attachment on the object, and each palm's force on it, in the world.
        """
        body = self.body
        if not held and not palms:
            if body.v == ZERO and body.spin == ZERO and normalize(body.q) == body.q:
                return [], []  # at rest it stays, to the last bit
            parts = max(1, math.ceil(norm(body.spin) * h / (min(self._moments) * _TURN)))
            for _ in range(parts):
                body.advance(h / parts, ZERO, ZERO, ZERO, ZERO)
            return [], []
        R = rotation_matrix(body.q)
        loads = [a.load(F, body.p, body.q, R) for a, F in held]
        momentum = scale(body.mass, inverse_rotate(R, body.v)), inverse_rotate(R, body.spin)
        nu, pushes, wrenches = self._balanced(h, held, loads, [(1.0, 1.0)] * len(held), palms, momentum)
        if _exceeds_limits(held, wrenches):
            nu, pushes, wrenches = self._slide(h, held, loads, palms, momentum, wrenches)
        else:
            self._move(h, R, nu)
        f_palms = [rotate(R, scale(push, palm.n)) for push, palm in zip(pushes, palms, strict=True)]
        return [(rotate(R, f), rotate(R, tau)) for f, tau in wrenches], f_palms

    def _slide(
        self,
        h: float,
        held: Held,
        loads: Sequence[Wrench],
        palms: Sequence[Palm],
        momentum: Wrench,
        wrenches: list[Wrench],
    ) -> tuple[Six, list[float], list[Wrench]]:
        """Move while attachments keep their limits, and let those give way; return what `_balanced` does."""
        scales = [(1.0, 1.0)] * len(held)
        before = [(1.0, 1.0, 0.0, 0.0)] * len(held)
        for _ in range(_MAX_TIGHTENINGS):
            tighter, before = _tightened([a for a, _ in held], wrenches, scales, before)
            if tighter == scales:
                break
            scales = tighter
            _, _, wrenches = self._balanced(h, held, loads, scales, palms, momentum)
        nu, pushes, wrenches = self._balanced(h, held, loads, scales, palms, momentum)
        body = self.body
        self._move(h, rotation_matrix(body.q), nu)
        for (a, F), (s, s_turn) in zip(held, scales, strict=True):
            a.give_way(F, body.p, body.q, s, s_turn)
        return nu, pushes, wrenches

    def _balanced(
        self,
        h: float,
        held: Held,
        loads: Sequence[Wrench],
        scales: Scales,
        palms: Sequence[Palm],
        momentum: Wrench,
    ) -> tuple[Six, list[float], list[Wrench]]:
        """Return nu, the palms' forces, and the attachments' wrenches in the object's frame."""
        linear, angular = momentum
        for (a, _), (f, tau), (s, s_turn) in zip(held, loads, scales, strict=True):
            impulse = scale(h * s, f)
            linear = add(linear, impulse)
            angular = add(angular, add_scaled(cross(a.r, impulse), h * s_turn, tau))
        rows = self._inverse(h, held, scales)
        nu, pushes = _pressed_by_all(h, rows, _applied(rows, (*linear, *angular)), palms)
        v, w = nu[:3], nu[3:]
        return nu, pushes, [_wrench(h, a, b, s, v, w) for (a, _), b, s in zip(held, loads, scales, strict=True)]

    def _inverse(self, h: float, held: Held, scales: Scales) -> list[list[float]]:
        key = (h, *[(a.r, a.stiffness.rates, s) for (a, _), s in zip(held, scales, strict=True)])
        if key not in self._inverses:
            if len(self._inverses) >= 8:
                self._inverses.clear()
            masses = np.diag([*[self.body.mass] * 3, *self._moments])
            for (a, _), (s, s_turn) in zip(held, scales, strict=True):
                J = np.hstack([np.eye(3), -skew(np.array(a.r))])
                masses += h * s * (a.stiffness.k * h + a.stiffness.c) * np.transpose(J) @ J
                masses[3:, 3:] += h * s_turn * (a.stiffness.k_turn * h + a.stiffness.c_turn) * np.eye(3)
            self._inverses[key] = np.linalg.inv(masses).tolist()
        return self._inverses[key]

    def _move(self, h: float, R: Matrix, nu: Six) -> None:
        body = self.body
        v, w = nu[:3], nu[3:]
        body.v = rotate(R, v)
        body.p = add_scaled(body.p, h, body.v)
        (I_x, I_y, I_z), (w_x, w_y, w_z) = self._moments, w
        body.spin = rotate(R, (I_x * w_x, I_y * w_y, I_z * w_z))
        body.q = normalize(quaternion_multiply(body.q, from_rotation_vector(scale(h, w))))


def _pressed_by_all(h: float, rows: list[list[float]], nu: Six, palms: Sequence[Palm]) -> tuple[Six, list[float]]:
    """Return nu as it becomes by palms, and each palm's force."""
    pushes = [0.0] * len(palms)
    for _ in range(_MAX_SWEEPS if len(palms) > 1 else 1):
        change = 0.0
        for i, palm in enumerate(palms):
            nu, push = _pressed(h, rows, nu, palm, pushes[i])
            change, pushes[i] = max(change, abs(push - pushes[i])), push
        if change <= _AGREED:
            break
    return nu, pushes


def _pressed(h: float, rows: list[list[float]], nu: Six, palm: Palm, before: float) -> tuple[Six, float]:
    """Return nu as it becomes by a palm whose force `before` is part of it, and the palm's force, which only pushes."""
    J = (*palm.n, *cross(palm.r, palm.n))
    column = _applied(rows, J)
    g = palm.k * h + palm.c
    yielding = _dot(J, column)
    push = palm.k * palm.depth + palm.c * palm.speed - g * (_dot(J, nu) - h * before * yielding)
    push = min(max(push / (1.0 + h * g * yielding), 0.0), palm.f_max)
    if push == before:
        return nu, before
    a, b, c, d, e, f = (x + h * (push - before) * y for x, y in zip(nu, column, strict=True))
    return (a, b, c, d, e, f), push


def _dot(a: Six, b: Six) -> float:
    return sum(x * y for x, y in zip(a, b, strict=True))


def _wrench(h: float, a: Attachment, load: Wrench, shares: tuple[float, float], v: Vector, w: Vector) -> Wrench:
    """Return force and torque of an attachment on an object that moves with v and w, in the object's frame."""
    (f, tau), (s, s_turn) = load, shares
    g = a.stiffness.k * h + a.stiffness.c
    g_turn = a.stiffness.k_turn * h + a.stiffness.c_turn
    f = add_scaled(f, -g, add_cross(v, w, a.r))
    tau = add_scaled(tau, -g_turn, w)
    return scale(s, f), scale(s_turn, tau)


def _exceeds_limits(held: Held, wrenches: Sequence[Wrench]) -> bool:
    """Return whether a limit is exceeded."""
    for (a, _), (f, tau) in zip(held, wrenches, strict=True):
        s = a.stiffness
        if dot(f, f) > s.f_max * s.f_max or dot(tau, tau) > s.tau_max * s.tau_max:
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
    a, b, c, d, e, f = [a * y0 + b * y1 + c * y2 + d * y3 + e * y4 + f * y5 for a, b, c, d, e, f in rows]
    return a, b, c, d, e, f


def nearest_on_centre_line(
    middle: Vector, half: float, p: Vector, R_F: Matrix, body: RigidBody, R: Matrix
) -> tuple[Vector, Vector]:
    """Return the point of a bar's centre line that is nearest to p, seen from the object's centre in O, and in F.

    The bar is along y of O, and reaches `half` to both sides of its middle.
    """
    axis = column(R, 1)
    d = subtract(p, add(body.p, rotate(R, middle)))
    s = min(max(dot(d, axis), -half), half)
    return add_scaled(middle, s, (0.0, 1.0, 0.0)), inverse_rotate(R_F, subtract(scale(s, axis), d))
