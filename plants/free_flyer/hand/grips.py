"""How the free-flyer's object is held: a person's hand at the end of a compliant arm, and the robot's gripper.

The hand follows its course, the object that it holds, or keeps off a palm that it presses. The gripper has two fingers
that close along z of G around an object, and a palm behind them.
"""

import math
from dataclasses import replace

from handover.cosim.blocks.plain_rotation import (
    IDENTITY,
    ZERO,
    Matrix,
    Quaternion,
    Vector,
    add,
    add_scaled,
    column,
    cross,
    distance,
    divide,
    dot,
    inverse_rotate,
    nlerp,
    quaternion_inverse,
    quaternion_multiply,
    relative_quaternion,
    rotate,
    rotation_matrix,
    scale,
    subtract,
    vector,
)
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.plants.free_flyer.hand.attachment import Attachment, Frame, Palm, Stiffness
from handover.plants.free_flyer.hand.parameters import Params
from handover.plants.free_flyer.rigid_body import RigidBody
from handover.plants.hand_motion import HandTremor

_SLACK = 0.1
"""Metres beyond its reach at which an arm loses what the hand holds."""
_LEAST_GRIP = 1e-3
"""Part of its force that a grip has until it lets go, lest what slides in it be divided by nothing."""
_BEYOND_END = 0.01
"""Metres beyond an object's end at which a hand still gets it."""
_NEAR = 0.02
"""Metres in front of the palm within which an object may come to touch it in a step."""


class FlyerHand:
    """The hand H. Its course, where the arm wants it, is the person's plus tremor.

    What the hand holds, it holds fast: the compliance is the arm's, between course and object (`Attachment`). The arm
    yields at arm_force_max, and recovers with the time constant recovery_time. Fingers that close get the object if its
    middle line is at most finger_reach away, and 1 cm beyond its end; else they close on nothing. The palm of an open
    hand, palm_back behind its middle, pushes an object that is in its way by the arm's stiffness and damping. A fist on
    the palm of a gripper is kept off it, by the depth that its course has in the palm, and presses with the arm's
    stiffness and damping times depth and speed, at most arm_force_max.
    """

    def __init__(self, params: Params, p: Vector, q: Quaternion) -> None:
        self._p = params
        self._half, self._thick = 0.5 * float(params.object_size[1]), 0.5 * float(params.object_size[0])
        self._arm = Stiffness(
            params.arm_stiffness,
            params.arm_damping,
            params.arm_force_max,
            params.wrist_stiffness,
            params.wrist_damping,
            params.wrist_torque_max,
        )
        self._tremor = HandTremor(
            params.tremor_rms,
            params.tremor_frequency,
            params.tremor_bandwidth,
            params.drift_rms,
            params.drift_time,
            params.seed,
        )
        self._shake, self._rest, self._target = ZERO, p, p
        self.p, self.q = p, q
        self.p_OH, self.q_OH = vector(params.p_OH), IDENTITY
        self.course = Frame(p, q)
        self.hold: Attachment | None = None
        self._closed = False

    @property
    def calm(self) -> Vector:
        """Where the hand is, without its tremor."""
        return subtract(self.p, self._shake)

    def move(self, dt: float, p: Vector, q: Quaternion) -> Frame:
        """Return the course at the end of a step that leads to a pose without tremor, if nothing obstructs it."""
        self._recover(dt)
        self._tremor.advance(dt)
        self._shake = vector(self._tremor.displacement)
        before, self._target = self._target, add(p, self._shake)
        return _moving_frame(dt, before, self._target, q)

    def press(self, dt: float, course: Frame, G: Frame) -> tuple[Frame, Vector, Vector]:
        """Return the course of a fist as the palm lets it, its force on the gripper, and where it acts, seen from G."""
        p = self._p
        arm = subtract(course.p, G.p)
        x, y, z = inverse_rotate(G.R, arm)
        depth, aside = x + p.fist_radius - p.palm_depth, max(abs(y), abs(z))
        if not 0.0 < depth < 2.0 * p.fist_radius + _SLACK or aside > p.palm_width + p.fist_radius:
            return course, ZERO, ZERO
        n = column(G.R, 0)
        v = subtract(course.v, add(G.v, cross(G.w, arm)))
        push = p.arm_stiffness * depth + p.arm_damping * dot(v, n)
        push = min(max(push, 0.0), p.arm_force_max)
        kept_off = _moving_frame(dt, self.course.p, add_scaled(course.p, -depth, n), course.q)
        return kept_off, scale(push, n), add_scaled(arm, p.fist_radius - depth, n)

    def palm(self, course: Frame, body: RigidBody) -> Palm | None:
        """Return the palm for an object that it meets on a course, none for one that is elsewhere.

        Its spring is the arm's, which yields at arm_force_max, so the palm is no deeper than that.
        """
        p, R = self._p, rotation_matrix(body.q)
        s, depth = self._depth(course, body, R)
        if depth <= 0.0:
            return None
        n_W = column(course.R, 0)
        n = inverse_rotate(R, n_W)
        r = add_scaled((0.0, s, 0.0), -self._thick, n)
        yielding = min(depth, p.arm_force_max / p.arm_stiffness)
        return Palm(r, n, dot(course.v, n_W), yielding, p.arm_stiffness, p.arm_damping)

    def _depth(self, course: Frame, body: RigidBody, R: Matrix) -> tuple[float, float]:
        """Return where on its centre line an object meets the palm, and how deep it would be in it; 0: not at all."""
        p = self._p
        s, (x, y, z) = _nearest(self._half, course.p, course.R, body, R)
        depth = self._thick - p.palm_back - x
        meets = 0.0 < depth < p.arm_reach and max(abs(y), abs(z)) <= p.fist_radius
        return s, depth if meets else 0.0

    def kept_off(self, dt: float, course: Frame, body: RigidBody) -> Frame:
        """Return the course of an open hand as the object lets it."""
        _, depth = self._depth(course, body, rotation_matrix(body.q))
        if depth <= 0.0:
            return course
        return _moving_frame(dt, self.course.p, add_scaled(course.p, -depth, column(course.R, 0)), course.q)

    def reaches(self, body: RigidBody) -> bool:
        """Return whether the fingers get an object if they close."""
        _, (x, y, z) = _nearest(self._half, self.p, rotation_matrix(self.q), body, rotation_matrix(body.q))
        return math.hypot(x, z) <= self._p.finger_reach and abs(y) <= _BEYOND_END

    def gets(self, closed: bool, body: RigidBody) -> bool:
        """Return whether fingers that are closed, or not, have the object: they get it where they close."""
        closes, self._closed = closed and not self._closed, closed
        return closed if self.hold is not None else closes and self.reaches(body)

    def take_or_leave(self, wants: bool, body: RigidBody) -> None:
        """Take hold of an object where the hand is, or let it go; an arm that is stretched too far loses it."""
        if wants and self.hold is None:
            R = rotation_matrix(body.q)
            self.p_OH = inverse_rotate(R, subtract(self.p, body.p))
            self.q_OH = relative_quaternion(body.q, self.q)
            F = self.course
            place, turn = (
                inverse_rotate(F.R, subtract(self.p, F.p)),
                relative_quaternion(F.q, body.q),
            )
            self.hold = Attachment(self._arm, self.p_OH, place, turn)
        elif self.hold is not None:
            stretched = distance(self.p, self._rest) > self._p.arm_reach + _SLACK
            if not wants or stretched:
                self.hold = None

    def arrive(self, course: Frame, body: RigidBody) -> None:
        """Take the pose of the object that the hand holds, or of the course."""
        self.course = course
        if self.hold is None:
            self.p, self.q = course.p, course.q
        else:
            self.p = add(body.p, rotate(rotation_matrix(body.q), self.p_OH))
            self.q = quaternion_multiply(body.q, self.q_OH)

    def get_state(self) -> bytes:
        """Return the complete state."""
        h, c = self.hold, self.course
        hold = None if h is None else (h.r, h.place, h.turn)
        places = (self._shake, self._target, self.p, self.q, self.p_OH, self.q_OH)
        return pack_state((self._tremor.get_state(), hold, (c.p, c.q, c.v, c.w), places, self._closed))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this hand or of one with equal parameters."""
        tremor, hold, course, places, self._closed = unpack_state(state)
        self._tremor.set_state(tremor)
        self.hold = None if hold is None else Attachment(self._arm, *hold)
        self.course = Frame(*course)
        self._shake, self._target, self.p, self.q, self.p_OH, self.q_OH = places

    def _recover(self, dt: float) -> None:
        """Draw what the hand holds back to its course, after the arm has yielded."""
        hold = self.hold
        if hold is not None:
            left = max(0.0, 1.0 - dt / self._p.recovery_time)
            hold.place = scale(left, hold.place)
            hold.turn = nlerp(quaternion_inverse(self.q_OH), hold.turn, left)


def _moving_frame(dt: float, before: Vector, p: Vector, q: Quaternion) -> Frame:
    """Return the frame at p, q with the velocity that took it there from a position dt before."""
    return Frame(p, q, divide(subtract(p, before), dt))


class FlyerGripper:
    """Follows the closure at a limited rate, and holds an object that is between its fingers when they get to it.

    The gripper opens towards -x of G. The object's centre line, its long axis y, is within reach of the fingers where
    its point nearest to G is at most capture_axial and capture_lateral away along x and z of G, and G at most
    capture_end beyond its end. An object that is held keeps the pose that it had when the fingers closed, drawn to the
    fingers' middle in x and z with the time constant centring_time, until the fingers have opened by release_angle or
    it slides out of their reach. Where `grip_fades`, the force and torque at which it slides fall linearly to nothing
    on the way there, as of fingers that are springs.
    """

    def __init__(self, params: Params) -> None:
        self._p = p = params
        self._half = 0.5 * float(p.object_size[1])
        self._thick = 0.5 * float(p.object_size[0])
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
        if self.grip is not None and p.grip_fades:
            self.grip.stiffness = self.stiffness

    def palm(self, G: Frame, body: RigidBody) -> Palm | None:
        """Return the palm for an object that is near it, none for one that is elsewhere or in the grip."""
        p = self._p
        if self.grip is not None or max(abs(a - b) for a, b in zip(body.p, G.p, strict=True)) > 2.0 * self._half:
            return None
        R = rotation_matrix(body.q)
        s, (x, y, z) = self._nearest(G, body, R)
        depth = x + self._thick - p.palm_depth
        if not -_NEAR < depth < 2.0 * self._thick or abs(y) > p.palm_width or abs(z) > p.palm_width:
            return None
        n_W = scale(-1.0, column(G.R, 0))
        n = inverse_rotate(R, n_W)
        r = add_scaled((0.0, s, 0.0), -self._thick, n)
        p_GP = (x + self._thick, y, z)
        v = add(G.v, cross(G.w, rotate(G.R, p_GP)))
        return Palm(r, n, dot(v, n_W), depth, p.palm_stiffness, p.palm_damping)

    def touches(self, G: Frame, body: RigidBody) -> bool:
        """Return whether an object is in the palm."""
        palm = self.palm(G, body)
        return palm is not None and palm.depth > 0.0

    def crushes(self, G: Frame, body: RigidBody) -> bool:
        """Return whether an object is between fingers that are closed further than it is thick."""
        return self.angle < self._angle_object and self._reaches(G, body)

    def _reaches(self, G: Frame, body: RigidBody) -> bool:
        p, (_, (x, y, z)) = self._p, self._nearest(G, body, rotation_matrix(body.q))
        return abs(x) <= p.capture_axial and abs(y) <= p.capture_end and abs(z) <= p.capture_lateral

    def _grasp(self, G: Frame, body: RigidBody) -> Attachment | None:
        """Return a grip of the object as it is, none if it is out of the fingers' reach."""
        if not self._reaches(G, body):
            return None
        s, place = self._nearest(G, body, rotation_matrix(body.q))
        return Attachment(self.stiffness, (0.0, s, 0.0), place, relative_quaternion(G.q, body.q))

    def _nearest(self, G: Frame, body: RigidBody, R: Matrix) -> tuple[float, Vector]:
        return _nearest(self._half, G.p, G.R, body, R)


def _nearest(half: float, p: Vector, R_F: Matrix, body: RigidBody, R: Matrix) -> tuple[float, Vector]:
    """Return where on an object's centre line the point nearest to p lies, seen from the centre, and the point in F."""
    axis = column(R, 1)
    d = subtract(p, body.p)
    s = min(max(dot(d, axis), -half), half)
    return s, inverse_rotate(R_F, subtract(scale(s, axis), d))
