"""What holds a floating object: springs with damping in all six directions, that slide at a limit, and a palm."""

from dataclasses import dataclass

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Quaternion,
    Rows,
    Triple,
    cross,
    inverse,
    product,
    turned,
    turned_back,
)
from handover.plants.free_flyer.rotations import IDENTITY, along, between, matrix_of, minus, plus


class Frame:
    """Pose and velocity of a thing that holds, all in world coordinates; R is the matrix of q."""

    def __init__(self, p: Triple, q: Quaternion, v: Triple = ZERO, w: Triple = ZERO) -> None:
        self.p, self.q, self.v, self.w = p, q, v, w
        self.R: Rows = matrix_of(q)


@dataclass(frozen=True)
class Stiffness:
    """Constants of an attachment: N/m, N s/m, N; N m/rad, N m s/rad, N m."""

    k: float
    c: float
    f_max: float
    k_turn: float
    c_turn: float
    tau_max: float


@dataclass(frozen=True)
class Palm:
    """A flat one-sided spring against which an object is pressed at a point r of it, both in the object's frame.

    Attributes:
        r: where the object touches.
        n: direction of the force on the object.
        speed: of the palm along n, m/s.
        depth: how deep the object would be in the palm if it stayed where it is, m.
        k: stiffness, N/m.
        c: damping, N s/m.
    """

    r: Triple
    n: Triple
    speed: float
    depth: float
    k: float
    c: float


class Attachment:
    """Holds the point r of an object O at the point `place` of a frame F, and O's orientation at `turn` seen from F.

    f = -k e + c (v_F - v), tau = -k_turn theta + c_turn (w_F - w), e the displacement of the point, theta the rotation
    vector (its sine, twice the half's). Beyond f_max or tau_max, the place or the turn gives way, as dry friction does.
    """

    def __init__(
        self, stiffness: Stiffness, r: Triple = ZERO, place: Triple = ZERO, turn: Quaternion = IDENTITY
    ) -> None:
        self.stiffness = stiffness
        self.r, self.place, self.turn = r, place, turn

    def load(self, F: Frame, p: Triple, q: Quaternion, R: Rows) -> tuple[Triple, Triple]:
        """Return force and torque on an object at p, q (R its matrix) that does not move, in its own frame."""
        s = self.stiffness
        arm = turned(F.R, self.place)
        ex, ey, ez = minus(plus(p, turned(R, self.r)), plus(F.p, arm))
        vx, vy, vz = plus(F.v, cross(F.w, arm))
        k, c = s.k, s.c
        f = turned_back(R, (c * vx - k * ex, c * vy - k * ey, c * vz - k * ez))
        w, x, y, z = product(inverse(product(F.q, self.turn)), q)
        k_turn = -2.0 * s.k_turn if w >= 0.0 else 2.0 * s.k_turn
        tx, ty, tz = turned_back(R, F.w)
        c_turn = s.c_turn
        return f, (k_turn * x + c_turn * tx, k_turn * y + c_turn * ty, k_turn * z + c_turn * tz)

    def give_way(self, F: Frame, p: Triple, q: Quaternion, force_share: float, torque_share: float) -> None:
        """Move place and turn towards where the object is, so that these shares of the displacements are left."""
        if force_share < 1.0:
            there = turned_back(F.R, minus(plus(p, turned(matrix_of(q), self.r)), F.p))
            self.place = along(self.place, 1.0 - force_share, minus(there, self.place))
        if torque_share < 1.0:
            self.turn = between(self.turn, product(inverse(F.q), q), 1.0 - torque_share)
