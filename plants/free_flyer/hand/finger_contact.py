"""Fingers that close at a limited rate and stop at a box, and what they do to it where they cannot give way."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from handover.cosim.blocks.plain_rotation import (
    Vector,
    add,
    add_cross,
    add_scaled,
    distance,
    dot,
    lerp,
    norm,
    rotate,
    scale,
    subtract,
)
from handover.plants.free_flyer.hand.attachment import Frame, Palm
from handover.plants.free_flyer.hand.box import Box
from handover.plants.free_flyer.hand.hand_kinematics import (
    FINGERS,
    JOINT_MAX,
    PALM_BONES,
    PALM_RADIUS,
    RADIUS,
    REACH,
    STRAIGHT,
    Ball,
    Finger,
    Segment,
    phalanges,
)

Angles = tuple[float, ...]
Gap = Callable[[float], float]
"""The room between phalanges and object, m, by a joint's angle."""

_SWEEPS, _BISECTIONS = 4, 16
"""How finely a joint's motion in a step is looked through for contact, and how often what is found is halved."""
_TOUCH = 0.003
"""Metres between capsule and box, soft skin's give, within which a phalanx counts as touching."""
_OPPOSED = -0.5
"""Cosine of the angle between the normals of thumb or palm and a finger above which they do not oppose each other."""
_SHARES = (1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125, 0.0)
"""Shares of its rate at which a finger tries to close."""
_FINE = 0.05
"""Radians in which fingers close that begin around an object."""
_ROUNDING = 1e-7
"""Metres by which a capsule that has stopped may be in the box, by the bisection's last digit."""
_CLEARLY = 1e-12
"""Metres beyond rounding by which a ball is away."""
_STOPPED = 1e-5
"""Metres from the box within which a capsule counts as stopped: it is not looked for nearer to the surface."""


_LENGTHS = tuple(length for finger in FINGERS for length in finger.lengths)
"""Of phalanges, by the joint at their root, m."""
_REACHES = {finger.name: sum(finger.lengths) + RADIUS for finger in FINGERS}
"""Of fingers from their roots, m."""


@dataclass(frozen=True)
class Contact:
    """A phalanx at a box, in the box's frame; `gap` m between them, `n` the direction in which it pushes the box.

    `joint` is the one at its root, of the palm None; `radius` is its own, m.
    """

    joint: int | None
    radius: float
    gap: float
    p: Vector
    n: Vector


class HandFingers:
    """14 joints that follow wanted angles at `rate`, and stop where a phalanx meets the object.

    Each joint, from the palm on, turns towards its wanted angle until its phalanx touches; those beyond it turn on.
    Where object or hand have moved so that a phalanx is in the object, its joint gives way and opens, at that rate too.
    What it cannot give way to is left as a depth, by which `touches` presses. So does a joint that stopped and wants to
    turn on, by what its tip lacks. Phalanges pass through each other.

    Attributes:
        wanted: angles to which the joints turn, rad.
        angles: of the joints, rad.
        reach: distance of the hand from the object beyond which nothing of it touches, m.
    """

    def __init__(self, sides: Vector, rate: float, angles: Angles = STRAIGHT) -> None:
        self._box = Box(scale(0.5, sides))
        self._rate = rate
        self.reach = norm(self._box.half) + REACH
        self._still: tuple[object, ...] | None = None
        """Arguments and angles of a step that changed no angle: the same again would change none either."""
        self._bones: tuple[Angles, list[tuple[list[Segment], Ball]]] | None = None
        """What `bones` gives, and the angles that it is of."""
        self.wanted = self.angles = angles

    def advance(self, dt: float, goal: Angles, H: Frame | None) -> None:
        """Turn the joints towards wanted angles, rad, for dt, with the hand at H, seen from the object.

        H may be None where the hand is farther from it than its reach.
        """
        most = self._rate * dt
        if goal != self.wanted:
            goal = tuple(min(max(angle, 0.0), JOINT_MAX) for angle in goal)
            self.wanted = tuple(_towards(a, b, most) for a, b in zip(self.wanted, goal, strict=True))
        if H is None:
            if self.angles != self.wanted:
                self.angles = tuple(_towards(a, b, most) for a, b in zip(self.angles, self.wanted, strict=True))
            return
        step = (dt, self.wanted, H.p, H.q, self.angles)
        if step == self._still:
            return
        before = self.angles
        self.angles = tuple(
            angle
            for finger, (_, ball) in zip(FINGERS, self.bones(), strict=True)
            for angle in self._turned(finger, ball, most, H)
        )
        self._still = step if self.angles == before else None

    def settle(self, goal: Angles, H: Frame) -> None:
        """Close straight fingers of a hand at H around the object, as far as they go."""
        for _ in range(math.ceil(JOINT_MAX / _FINE)):
            self.advance(_FINE / self._rate, goal, H)

    def contacts(self, H: Frame, within: float = _TOUCH) -> list[Contact]:
        """Return phalanges, and parts of the palm, of a hand at H that are at most that far from the object, m."""
        if norm(H.p) > self.reach:
            return []
        found: list[Contact] = []
        for finger, (bones, ball) in zip(FINGERS, self.bones(), strict=True):
            if self._is_near(H, ball, RADIUS + within):
                for joint, bone in zip(finger.joints, bones, strict=True):
                    self._add_contact(found, joint, RADIUS, _moved(H, bone), within)
        if self._is_near(H, _PALM_BALL, PALM_RADIUS + within):
            for bone in PALM_BONES:
                self._add_contact(found, None, PALM_RADIUS, _moved(H, bone), within)
        return found

    def touches(self, H: Frame, stiffness: float, damping: float, most: float, force: float) -> list[Palm]:
        """Return what the phalanges do to the object, each a one-sided spring.

        Args:
            H: the hand with its velocity, seen from the object.
            stiffness: of a phalanx, N/m.
            damping: of a phalanx, N s/m.
            most: what one presses with at most, N, however the hand moves.
            force: what one presses with at most by its joint, N.
        """
        found: list[Palm] = []
        for c in self.contacts(H):
            depth = max(0.0, -c.gap - _ROUNDING)
            if c.joint is not None and c.gap <= _STOPPED:
                lacking = max(0.0, self.wanted[c.joint] - self.angles[c.joint])
                depth += min(lacking * _LENGTHS[c.joint], force / stiffness)
            if depth <= 0.0:
                continue
            v = add_cross(H.v, H.w, subtract(c.p, H.p))
            r = add_scaled(c.p, c.radius + c.gap, c.n)
            found.append(Palm(r, c.n, dot(v, c.n), depth, stiffness, damping, most))
        return found

    def encloses(self, H: Frame) -> bool:
        """Return whether the object is between two fingers, at least, and thumb or palm of a hand at H.

        All of them, and the thumb always, are at most half a finger's thickness from it.
        """
        contacts = self.contacts(H, RADIUS)
        thumb = [c for c in contacts if c.joint in FINGERS[0].joints]
        opposed = [*thumb, *(c for c in contacts if c.joint is None)]
        fingers = {
            finger.name
            for finger in FINGERS[1:]
            for c in contacts
            if c.joint in finger.joints and any(dot(c.n, o.n) < _OPPOSED for o in opposed)
        }
        return bool(thumb) and len(fingers) >= 2

    def bones(self) -> list[tuple[list[Segment], Ball]]:
        """Return the lines in the middle of each finger's phalanges, and a ball that these are in, in H."""
        if self._bones is None or self._bones[0] != self.angles:
            fingers = [phalanges(finger, self._of(finger)) for finger in FINGERS]
            self._bones = self.angles, [(bones, _ball_around(bones)) for bones in fingers]
        return self._bones[1]

    def _of(self, finger: Finger) -> Angles:
        return tuple(self.angles[i] for i in finger.joints)

    def _is_near(self, H: Frame, ball: Ball, within: float) -> bool:
        """Return whether something in a ball of H may be that near to the object, m."""
        centre, radius = ball
        return self._box.distance(_seen(H, centre)) <= radius + within + _CLEARLY

    def _add_contact(
        self, found: list[Contact], joint: int | None, radius: float, line: Segment, within: float
    ) -> None:
        """Add what a capsule about a line is to the object, if it is that near."""
        if self._box.least_room(line) > radius + within:
            return
        away, p = self._box.nearest(line)
        if away - radius <= within:
            found.append(Contact(joint, radius, away - radius, p, scale(-1.0, self._box.normal(p))))

    def _turned(self, finger: Finger, ball: Ball, most: float, H: Frame) -> Angles:
        """Return a finger's angles after joints have turned by at most that much, rad; `ball` is around it.

        Where the ones beyond a joint cannot give way as fast as it brings them into the object, the finger closes more
        slowly.
        """
        before, first = self._of(finger), finger.first
        wanted = self.wanted[first : first + len(before)]
        if before == wanted and not self._is_near(H, ball, RADIUS):
            return before
        if self._box.distance(_seen(H, finger.root)) > _REACHES[finger.name]:
            return tuple(_towards(a, b, most) for a, b in zip(before, wanted, strict=True))
        rooms: dict[tuple[Vector, float], float] = {}
        angles = before
        for share in _SHARES:
            angles, least = self._turn(finger, (share * most, most), H, rooms)
            if least >= -_ROUNDING:
                break
        return angles

    def _turn(
        self, finger: Finger, most: tuple[float, float], H: Frame, rooms: dict[tuple[Vector, float], float]
    ) -> tuple[Angles, float]:
        """Return angles of joints that turn from the palm on, by at most these as they close and open, rad.

        And the least room that its phalanges have then, m; `rooms` keeps it by a phalanx's root and its direction.
        """
        closing, opening = most
        root, bent, least = finger.root, 0.0, math.inf
        turned: list[float] = []
        for i, length in zip(finger.joints, finger.lengths, strict=True):
            before, wanted, start = self.angles[i], self.wanted[i], _seen(H, root)

            def gap(
                angle: float, root: Vector = root, bent: float = bent, length: float = length, start: Vector = start
            ) -> float:
                way = bent + angle
                if (root, way) not in rooms:
                    tip = add_scaled(root, length, finger.direction(way))
                    rooms[root, way] = self._room((start, _seen(H, tip)))
                return rooms[root, way]

            room = gap(before)
            if room < -_ROUNDING:
                angle = _least_deep(gap, room, before, max(0.0, before - opening))
            else:
                angle = _last_free(gap, room, before, _towards(before, wanted, closing if wanted > before else opening))
            least = min(least, gap(angle))
            turned.append(angle)
            bent += angle
            root = add_scaled(root, length, finger.direction(bent))
        return tuple(turned), least

    def _room(self, line: Segment) -> float:
        """Return the distance between a phalanx and the object, or less, above _STOPPED, where it is farther."""
        least = self._box.least_room(line)
        return (least if least > RADIUS + _STOPPED else self._box.nearest(line)[0]) - RADIUS


def _ball_around(bones: Sequence[Segment]) -> Ball:
    """Return a ball that lines which follow each other are in."""
    centre = lerp(bones[0][0], bones[-1][1], 0.5)
    return centre, max(distance(centre, end) for bone in bones for end in bone)


_PALM_BALL = _ball_around(PALM_BONES)


def _seen(H: Frame, p: Vector) -> Vector:
    """Return a point of a frame as seen from where that frame stands at H."""
    return add(H.p, rotate(H.R, p))


def _moved(H: Frame, bone: Segment) -> Segment:
    """Return a line of a frame likewise."""
    a, b = bone
    return _seen(H, a), _seen(H, b)


def _towards(a: float, b: float, most: float) -> float:
    """Return b, or what is `most` from a on the way there."""
    return b if abs(b - a) <= most else a + math.copysign(most, b - a)


def _last_free(gap: Gap, room: float, before: float, after: float) -> float:
    """Return the angle at which a joint that turns from a free angle stops, or the one that it wants."""
    free = before
    if before == after:
        return before
    for n in range(1, _SWEEPS + 1):
        angle = after if n == _SWEEPS else before + n / _SWEEPS * (after - before)
        if gap(angle) < -_ROUNDING:
            return before if n == 1 and room < _STOPPED else _bisected(gap, free, angle)
        free = angle
    return after


def _least_deep(gap: Gap, room: float, before: float, after: float) -> float:
    """Return the angle to which a joint opens whose phalanx is in the object: free, or where it is least deep."""
    at, blocked = before, before
    for n in range(1, _SWEEPS + 1):
        angle = before + n / _SWEEPS * (after - before)
        there = gap(angle)
        if there >= -_ROUNDING:
            return _bisected(gap, angle, blocked)
        blocked = angle
        if there > room:
            room, at = there, angle
    return at


def _bisected(gap: Gap, free: float, blocked: float) -> float:
    """Return the free angle that is next to a blocked one."""
    for _ in range(_BISECTIONS):
        middle = 0.5 * (free + blocked)
        if gap(middle) < -_ROUNDING:
            blocked = middle
        else:
            free = middle
    return free
