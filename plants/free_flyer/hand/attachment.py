"""What holds a floating object: springs with damping in all six directions that slide at a limit, and a flat palm."""

import math
from dataclasses import dataclass

from handover.cosim.blocks.plain_rotation import (
    IDENTITY,
    ZERO,
    Matrix,
    Quaternion,
    Vector,
    add,
    add_scaled,
    cross,
    inverse_rotate,
    lerp,
    nlerp,
    quaternion_multiply,
    relative_quaternion,
    rotate,
    rotation_matrix,
    scale,
    subtract,
)


class Frame:
    """Pose and velocity of a thing that holds, all in world coordinates; R is the matrix of q."""

    __slots__ = ("R", "p", "q", "v", "w")
    R: Matrix

    def __init__(self, p: Vector, q: Quaternion, v: Vector = ZERO, w: Vector = ZERO) -> None:
        self.p, self.q, self.v, self.w = p, q, v, w

    def __getattr__(self, name: str) -> Matrix:
        """Compute R when it is first asked for: many a frame goes by without."""
        if name != "R":
            raise AttributeError(name)
        R = rotation_matrix(self.q)
        object.__setattr__(self, "R", R)
        return R


@dataclass(frozen=True)
class Stiffness:
    """Constants of an attachment: N/m, N s/m, N; N m/rad, N m s/rad, N m."""

    k: float
    c: float
    f_max: float
    k_turn: float
    c_turn: float
    tau_max: float

    @property
    def rates(self) -> tuple[float, float, float, float]:
        """Stiffnesses and dampings, without the limits."""
        return self.k, self.c, self.k_turn, self.c_turn


@dataclass(frozen=True)
class Palm:
    """A one-sided spring against which an object is pressed at a point r of it, both in the object's frame.

    Attributes:
        r: where the object touches.
        n: direction of the force on the object.
        speed: of the palm along n, m/s.
        depth: how deep the object would be in the palm if it stayed where it is, m.
        k: stiffness, N/m.
        c: damping, N s/m.
        f_max: largest force, N.
    """

    r: Vector
    n: Vector
    speed: float
    depth: float
    k: float
    c: float
    f_max: float = math.inf


class Attachment:
    """Holds the point r of an object O at the point `place` of a frame F, and O's orientation at `turn` seen from F.

    f = -k e + c (v_F - v), tau = -k_turn theta + c_turn (w_F - w), e the displacement of the point, theta =
    2 sin(a/2) n for a rotation by the angle a about n. Beyond f_max or tau_max, the place or
    the turn gives way, as dry friction does.
    """

    def __init__(
        self, stiffness: Stiffness, r: Vector = ZERO, place: Vector = ZERO, turn: Quaternion = IDENTITY
    ) -> None:
        self.stiffness = stiffness
        self.r, self.place, self.turn = r, place, turn

    def load(self, F: Frame, p: Vector, q: Quaternion, R: Matrix) -> tuple[Vector, Vector]:
        """Return force and torque on an object at p, q (R its matrix) that does not move, in its own frame."""
        s = self.stiffness
        arm = rotate(F.R, self.place)
        e = subtract(add(p, rotate(R, self.r)), add(F.p, arm))
        v_F = add(F.v, cross(F.w, arm))
        f = inverse_rotate(R, add_scaled(scale(s.c, v_F), -s.k, e))
        w, x, y, z = relative_quaternion(quaternion_multiply(F.q, self.turn), q)
        theta = scale(2.0 if w >= 0.0 else -2.0, (x, y, z))
        tau = add_scaled(scale(-s.k_turn, theta), s.c_turn, inverse_rotate(R, F.w))
        return f, tau

    def give_way(self, F: Frame, p: Vector, q: Quaternion, force_share: float, torque_share: float) -> None:
        """Move place and turn towards where the object is, so that these shares of the displacements are left."""
        if force_share < 1.0:
            there = inverse_rotate(F.R, subtract(add(p, rotate(rotation_matrix(q), self.r)), F.p))
            self.place = lerp(self.place, there, 1.0 - force_share)
        if torque_share < 1.0:
            self.turn = nlerp(self.turn, relative_quaternion(F.q, q), 1.0 - torque_share)
