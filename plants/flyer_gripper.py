"""The gripper of a free-flyer: two fingers that close along z of G around an object, and a palm behind them."""

from handover.cosim.blocks.plain_rotation import Rows, Triple, cross, inverse, product, turned, turned_back
from handover.plants.floating_attachment import Attachment, Frame, Palm, Stiffness
from handover.plants.floating_rotation import matrix_of, minus, plus
from handover.plants.flyer_hand_parameters import Params
from handover.plants.rigid_body import RigidBody

_NEAR = 0.02
"""Metres in front of the palm within which an object may come to touch it in a step."""


class FlyerGripper:
    """Follows the closure at a limited rate, and holds an object that is between its fingers when they get to it.

    The gripper opens towards -x of G. The object's centre line, its long axis y, is within reach of the fingers where
    its point nearest to G is at most capture_axial and capture_lateral away along x and z of G, and G at most
    capture_end beyond its end. An object that is held keeps the pose that it had when the fingers closed, drawn to the
    fingers' middle in x and z with the time constant centring_time, until the fingers have opened by release_angle or
    it slides out of their reach.
    """

    def __init__(self, params: Params) -> None:
        self._p = p = params
        self._half = 0.5 * float(p.object_size[1])
        self._thick = 0.5 * float(p.object_size[0])
        self.stiffness = Stiffness(
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

    def act(self, dt: float, closure: float, G: Frame, body: RigidBody) -> None:
        """Move the fingers for dt towards a closure from 0, open, to 1; take hold or let go."""
        p = self._p
        target = p.angle_open + min(max(closure, 0.0), 1.0) * (p.angle_empty - p.angle_open)
        before, most = self.angle, p.gripper_rate * dt
        after = before + min(max(target - before, -most), most)
        if self.grip is None:
            if after <= self._angle_object < before:
                self.grip = self._grasp(G, body)
        elif after > self._angle_object + p.release_angle or not self._reaches(G, body):
            self.grip = None
        if self.grip is not None:
            after = max(after, self._angle_object)
            x, y, z = self.grip.place
            left = max(0.0, 1.0 - dt / p.centring_time)
            self.grip.place = (left * x, y, left * z)
        self.angle = after

    def palm(self, G: Frame, body: RigidBody) -> Palm | None:
        """Return the palm for an object that is near it, none for one that is elsewhere or in the grip."""
        p = self._p
        if self.grip is not None or max(abs(a - b) for a, b in zip(body.p, G.p, strict=True)) > 2.0 * self._half:
            return None
        R = matrix_of(body.q)
        s, (x, y, z) = self._nearest(G, body, R)
        depth = x + self._thick - p.palm_depth
        if not -_NEAR < depth < 2.0 * self._thick or abs(y) > p.palm_width or abs(z) > p.palm_width:
            return None
        n_W = (-G.R[0], -G.R[3], -G.R[6])
        n = turned_back(R, n_W)
        t = self._thick
        r = (-t * n[0], s - t * n[1], -t * n[2])
        p_GP = (x + t, y, z)
        v = plus(G.v, cross(G.w, turned(G.R, p_GP)))
        speed = v[0] * n_W[0] + v[1] * n_W[1] + v[2] * n_W[2]
        return Palm(r, n, speed, depth, p.palm_stiffness, p.palm_damping)

    def touches(self, G: Frame, body: RigidBody) -> bool:
        """Return whether an object is in the palm."""
        palm = self.palm(G, body)
        return palm is not None and palm.depth > 0.0

    def crushes(self, G: Frame, body: RigidBody) -> bool:
        """Return whether an object is between fingers that are closed further than it is thick."""
        return self.angle < self._angle_object and self._reaches(G, body)

    def _reaches(self, G: Frame, body: RigidBody) -> bool:
        p, (_, (x, y, z)) = self._p, self._nearest(G, body, matrix_of(body.q))
        return abs(x) <= p.capture_axial and abs(y) <= p.capture_end and abs(z) <= p.capture_lateral

    def _grasp(self, G: Frame, body: RigidBody) -> Attachment | None:
        """Return a grip of the object as it is, none if it is out of the fingers' reach."""
        if not self._reaches(G, body):
            return None
        s, place = self._nearest(G, body, matrix_of(body.q))
        return Attachment(self.stiffness, (0.0, s, 0.0), place, product(inverse(G.q), body.q))

    def _nearest(self, G: Frame, body: RigidBody, R: Rows) -> tuple[float, Triple]:
        """Return where on the centre line the point nearest to G lies, seen from the centre, and the point in G."""
        axis = (R[1], R[4], R[7])
        d = minus(G.p, body.p)
        s = d[0] * axis[0] + d[1] * axis[1] + d[2] * axis[2]
        s = min(max(s, -self._half), self._half)
        return s, turned_back(G.R, (s * axis[0] - d[0], s * axis[1] - d[1], s * axis[2] - d[2]))
