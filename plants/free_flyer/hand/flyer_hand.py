"""A person's hand at the end of a compliant arm: its course, what it holds, and what it presses and bumps.

The hand follows its course, the object that it holds, or keeps off a palm that it presses.
"""

import math

from handover.cosim.blocks.plain_rotation import (
    IDENTITY,
    ZERO,
    Matrix,
    Quaternion,
    Vector,
    add,
    add_cross,
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
    rotation_vector,
    scale,
    subtract,
    vector,
)
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.plants.free_flyer.hand.attachment import Attachment, Frame, Palm, Stiffness
from handover.plants.free_flyer.hand.floating_object import nearest_on_centre_line
from handover.plants.free_flyer.hand.parameters import ContactParams
from handover.plants.free_flyer.rigid_body import RigidBody
from handover.plants.hand_motion import HandTremor

_SLACK = 0.1
"""Metres beyond its reach at which an arm loses what the hand holds (assumed)."""
_BEYOND_END = 0.01
"""Metres beyond an object's end at which a hand still gets it (assumed)."""


class FlyerHand:
    """The hand H. Its course, where the arm wants it, is the person's plus tremor.

    What the hand holds, it holds fast: the compliance is the arm's, between course and object (`Attachment`). The arm
    yields at arm_force_max, and recovers with the time constant recovery_time. Fingers that close get the object if its
    middle line is at most finger_reach away, and 1 cm beyond its end; else they close on nothing. The palm of an open
    hand, palm_back behind its middle, pushes an object that is in its way by the arm's stiffness and damping. A fist on
    the palm of a gripper is kept off it, by the depth that its course has in the palm, and presses with the arm's
    stiffness and damping times depth and speed, at most arm_force_max. One that has passed beside the palm and is
    behind it does not touch it on its way back: the robot's body behind its gripper is not modelled.

    Args:
        params: of the person; object_size are the sides of what is held.
        p: where the hand starts, m, in the world.
        q: its orientation there.
        middle: of what is held, a bar along y of the object, seen from the object's centre, m.
    """

    def __init__(self, params: ContactParams, p: Vector, q: Quaternion, middle: Vector = ZERO) -> None:
        self._p = params
        self.middle = middle
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
        self._closed, self._lost = False, False
        self._passed: tuple[int, ...] = ()
        """Numbers of the grippers behind whose palm it is, beside which it passed."""

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
        return _moving_frame(dt, before, self.course.q, self._target, q)

    def press(self, dt: float, course: Frame, G: Frame, gripper: int = 0) -> tuple[Frame, Vector, Vector]:
        """Return the course of a fist as a palm lets it, its force on the gripper, and where it acts, seen from G.

        Of several grippers each has a number.
        """
        p = self._p
        arm = subtract(course.p, G.p)
        x, y, z = inverse_rotate(G.R, arm)
        depth, aside = x + p.fist_radius - p.palm_depth, max(abs(y), abs(z))
        x_before, _, _ = inverse_rotate(G.R, subtract(self.course.p, G.p))
        others = tuple(i for i in self._passed if i != gripper)
        if x_before > p.palm_depth:
            self._passed = (*others, gripper)
        elif x_before + p.fist_radius <= p.palm_depth:
            self._passed = others
        if depth <= 0.0 or gripper in self._passed or aside > p.palm_width + p.fist_radius:
            return course, ZERO, ZERO
        n = column(G.R, 0)
        v = subtract(course.v, add(G.v, cross(G.w, arm)))
        push = p.arm_stiffness * depth + p.arm_damping * dot(v, n)
        push = min(max(push, 0.0), p.arm_force_max)
        kept_off = _moving_frame(dt, self.course.p, self.course.q, add_scaled(course.p, -depth, n), course.q)
        return kept_off, scale(push, n), add_scaled(arm, p.fist_radius - depth, n)

    def palm(self, course: Frame, body: RigidBody) -> Palm | None:
        """Return the palm for an object that it meets on a course, none for one that is elsewhere.

        Its spring and damper are the arm's, which yields at arm_force_max: so the palm is no deeper than that.
        """
        p, R = self._p, rotation_matrix(body.q)
        touched, depth = self._depth(course, body, R)
        if depth <= 0.0:
            return None
        n_W = column(course.R, 0)
        n = inverse_rotate(R, n_W)
        r = add_scaled(touched, -self._thick, n)
        yielding = min(depth, p.arm_force_max / p.arm_stiffness)
        v = add_cross(course.v, course.w, subtract(add(body.p, rotate(R, r)), course.p))
        return Palm(r, n, dot(v, n_W), yielding, p.arm_stiffness, p.arm_damping, p.arm_force_max)

    def _depth(self, course: Frame, body: RigidBody, R: Matrix) -> tuple[Vector, float]:
        """Return where on its centre line an object meets the palm, and how deep it would be in it; 0: not at all.

        An object behind the palm has been passed at its side: the palm does not meet it from there.
        """
        before, back = self.course, self._p.palm_back
        r, (x, y, z) = nearest_on_centre_line(self.middle, self._half, course.p, course.R, body, R)
        depth, aside = self._thick - back - x, max(abs(y), abs(z))
        if depth <= 0.0 or aside > self._p.fist_radius:
            return r, 0.0
        _, (x_before, _, _) = nearest_on_centre_line(self.middle, self._half, before.p, before.R, body, R)
        return r, depth if x_before > -back - self._thick else 0.0

    def kept_off(self, dt: float, course: Frame, body: RigidBody) -> Frame:
        """Return the course of an open hand as the object lets it."""
        _, depth = self._depth(course, body, rotation_matrix(body.q))
        if depth <= 0.0:
            return course
        p = add_scaled(course.p, -depth, column(course.R, 0))
        return _moving_frame(dt, self.course.p, self.course.q, p, course.q)

    def is_around(self, body: RigidBody) -> bool:
        """Return whether the fingers get an object if they close."""
        _, (x, y, z) = nearest_on_centre_line(
            self.middle, self._half, self.p, rotation_matrix(self.q), body, rotation_matrix(body.q)
        )
        return math.hypot(x, z) <= self._p.finger_reach and abs(y) <= _BEYOND_END

    def gets(self, closed: bool, body: RigidBody) -> bool:
        """Return whether fingers that are closed, or not, have the object: they get it where they close."""
        closes, self._closed = closed and not self._closed, closed
        return closed if self.hold is not None else closes and self.is_around(body)

    def grasps(self, closed: bool, encloses: bool) -> bool:
        """Return whether a led hand, closed or not, has the object: from when its fingers enclose it until they open.

        An object that it lost it takes again only after it has been open.
        """
        self._lost = self._lost and closed
        return closed and not self._lost and (encloses or self.hold is not None)

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
                self.hold, self._lost = None, stretched

    def carried_by(self, body: RigidBody) -> Frame:
        """Return the hand as it moves with the object that it holds."""
        w = body.w
        return Frame(self.p, self.q, add_cross(body.v, w, subtract(self.p, body.p)), w)

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
        seen = (self._closed, self._lost, self._passed)
        return pack_state((self._tremor.get_state(), hold, (c.p, c.q, c.v, c.w), places, seen))

    def set_state(self, state: bytes) -> None:
        """Restore a state of this hand or of one with equal parameters."""
        tremor, hold, course, places, seen = unpack_state(state)
        self._closed, self._lost, self._passed = seen
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


def _moving_frame(dt: float, p_0: Vector, q_0: Quaternion, p: Vector, q: Quaternion) -> Frame:
    """Return the frame at p, q with the velocity and angular velocity that took it there from p_0, q_0 dt before."""
    turn = rotation_vector(quaternion_multiply(q, quaternion_inverse(q_0)))
    return Frame(p, q, divide(subtract(p, p_0), dt), divide(turn, dt))
