"""The robot's gripper: two fingers that close along z of G around an object, and a palm behind them."""

from dataclasses import replace

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Matrix,
    Vector,
    add,
    add_scaled,
    column,
    cross,
    dot,
    inverse_rotate,
    norm,
    relative_quaternion,
    rotate,
    rotation_matrix,
    scale,
)
from handover.plants.free_flyer.hand.attachment import Attachment, Frame, Palm, Stiffness
from handover.plants.free_flyer.hand.floating_object import nearest_on_centre_line
from handover.plants.free_flyer.hand.parameters import ContactParams
from handover.plants.free_flyer.rigid_body import RigidBody

_LEAST_GRIP = 1e-3
"""Part of its force that a grip has until it lets go, lest what slides in it be divided by nothing (assumed)."""
_NEAR = 0.02
"""Metres in front of the palm within which an object may come to touch it in a step (assumed)."""


class FlyerGripper:
    """Follows the closure at a limited rate, and holds an object that is between its fingers when they get to it.

    The gripper opens towards -x of G. The object's centre line, its long axis y, is within reach of the fingers where
    its point nearest to G is at most capture_axial and capture_lateral away along x and z of G, and G at most
    capture_end beyond its end. An object that is held keeps the pose that it had when the fingers closed, drawn to the
    fingers' middle in x and z with the time constant centring_time, until the fingers have opened by release_angle or
    it slides out of their reach. Where `grip_fades`, the force and torque at which it slides fall linearly to nothing
    on the way there, as of fingers that are springs.

    Args:
        params: of the gripper; object_size are the sides of what is held.
        middle: of what is held, a bar along y of the object, seen from the object's centre, m.
    """

    def __init__(self, params: ContactParams, middle: Vector = ZERO) -> None:
        self._p = p = params
        self._middle = middle
        self._half = 0.5 * float(p.object_size[1])
        self._thick = 0.5 * float(p.object_size[0])
        self._far = self._half + norm((p.palm_depth + self._thick + _NEAR, p.palm_width, p.palm_width))
        self._firm = Stiffness(
            p.grip_stiffness,
            p.grip_damping,
            p.grip_force_max,
            p.grip_turn_stiffness,
            p.grip_turn_damping,
            p.grip_torque_max,
        )
        self._angle_object = p.angle_object
        self.angle = p.angle_0
        self.grip: Attachment | None = None

    @property
    def stiffness(self) -> Stiffness:
        """The grip's, as far as the fingers are closed."""
        p, firm = self._p, self._firm
        opened = self.angle - self._angle_object
        if not p.grip_fades or opened <= 0.0:
            return firm
        share = _LEAST_GRIP if opened >= p.release_angle else max(1.0 - opened / p.release_angle, _LEAST_GRIP)
        return replace(firm, f_max=share * firm.f_max, tau_max=share * firm.tau_max)

    def act(self, dt: float, closure: float, G: Frame, body: RigidBody) -> None:
        """Move the fingers for dt towards a closure from 0, open, to 1; take hold or let go."""
        p = self._p
        target = p.angle_open + min(max(closure, 0.0), 1.0) * (p.angle_empty - p.angle_open)
        before, max_turn = self.angle, p.gripper_rate * dt
        after = before + min(max(target - before, -max_turn), max_turn)
        if self.grip is None:
            if after <= self._angle_object <= before:
                self.grip = self._grasp(G, body)
        elif after > self._angle_object + p.release_angle or not self._is_around(G, body):
            self.grip = None
        if self.grip is not None:
            after = max(after, self._angle_object)
            x, y, z = self.grip.place
            left = max(0.0, 1.0 - dt / p.centring_time)
            self.grip.place = (left * x, y, left * z)
        self.angle = after
        if self.grip is not None and p.grip_fades:
            self.grip.stiffness = self.stiffness

    def palm(self, G: Frame, body: RigidBody) -> Palm | None:
        """Return the palm for an object that is near it, none for one that is elsewhere or in the grip."""
        p = self._p
        if self.grip is not None:
            return None
        R = rotation_matrix(body.q)
        middle = add(body.p, rotate(R, self._middle))
        if max(abs(a - b) for a, b in zip(middle, G.p, strict=True)) > self._far:
            return None
        r, (x, y, z) = self._nearest(G, body, R)
        depth = x + self._thick - p.palm_depth
        if not -_NEAR < depth < 2.0 * self._thick or abs(y) > p.palm_width or abs(z) > p.palm_width:
            return None
        n_W = scale(-1.0, column(G.R, 0))
        n = inverse_rotate(R, n_W)
        r = add_scaled(r, -self._thick, n)
        p_GP = (x + self._thick, y, z)
        v = add(G.v, cross(G.w, rotate(G.R, p_GP)))
        return Palm(r, n, dot(v, n_W), depth, p.palm_stiffness, p.palm_damping)

    def touches(self, G: Frame, body: RigidBody) -> bool:
        """Return whether an object is in the palm."""
        palm = self.palm(G, body)
        return palm is not None and palm.depth > 0.0

    def crushes(self, G: Frame, body: RigidBody) -> bool:
        """Return whether an object is between fingers that are closed further than it is thick."""
        return self.angle < self._angle_object and self._is_around(G, body)

    def _is_around(self, G: Frame, body: RigidBody) -> bool:
        """Return whether the fingers get an object if they close."""
        p, (_, (x, y, z)) = self._p, self._nearest(G, body, rotation_matrix(body.q))
        return abs(x) <= p.capture_axial and abs(y) <= p.capture_end and abs(z) <= p.capture_lateral

    def _grasp(self, G: Frame, body: RigidBody) -> Attachment | None:
        """Return a grip of the object as it is, none if it is out of the fingers' reach."""
        if not self._is_around(G, body):
            return None
        r, place = self._nearest(G, body, rotation_matrix(body.q))
        return Attachment(self.stiffness, r, place, relative_quaternion(G.q, body.q))

    def _nearest(self, G: Frame, body: RigidBody, R: Matrix) -> tuple[Vector, Vector]:
        return nearest_on_centre_line(self._middle, self._half, G.p, G.R, body, R)
