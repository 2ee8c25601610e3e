"""Fingers that close at a limited rate and stop at a box, and what they do to it where they cannot give way."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from handover.cosim.blocks.plain_rotation import (
    ZERO,
    Vector,
    add,
    add_cross,
    add_scaled,
    divide,
    dot,
    lerp,
    norm,
    rotate,
    scale,
    subtract,
)
from handover.plants.free_flyer.hand.attachment import Frame, Palm
from handover.plants.free_flyer.hand.hand_kinematics import (
    FINGERS,
    JOINT_MAX,
    PALM_BONES,
    PALM_RADIUS,
    RADIUS,
    REACH,
    STRAIGHT,
    Finger,
    Segment,
    phalanges,
)

Angles = tuple[float, ...]
Gap = Callable[[float], float]
"""The room between phalanges and object, m, by a joint's angle."""

_SEARCHES = 20
"""How often the range in which a bone's point nearest to a box lies is cut to two thirds: to 3e-4 of its length."""
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
_STOPPED = 1e-5
"""Metres from the box within which a capsule counts as stopped: it is not looked for nearer to the surface."""


_LENGTHS = tuple(length for finger in FINGERS for length in finger.lengths)
"""Of phalanges, by the joint at their root, m."""


@dataclass(frozen=True)
class Box:
    """A box about the origin of its own frame; `half` are half its sides, m."""

    half: Vector

    def distance(self, p: Vector) -> float:
        """Return the signed distance of a point from the surface, below 0 inside, m; a convex function of p."""
        return self.distance_along(p, ZERO, 0.0)

    def distance_along(self, p: Vector, d: Vector, s: float) -> float:
        """Return the distance of p + s d."""
        (x, y, z), (dx, dy, dz), (a, b, c) = p, d, self.half
        x, y, z = abs(x + s * dx) - a, abs(y + s * dy) - b, abs(z + s * dz) - c
        if x <= 0.0 and y <= 0.0 and z <= 0.0:
            return max(x, y, z)
        x, y, z = x if x > 0.0 else 0.0, y if y > 0.0 else 0.0, z if z > 0.0 else 0.0
        return math.sqrt(x * x + y * y + z * z)

    def least_room(self, bone: Segment) -> float:
        """Return a distance than which no point of a line is nearer to the box, m; it changes by 1 a metre at most.

        It is that of the line's bounding box.
        """
        (a_x, a_y, a_z), (b_x, b_y, b_z) = bone
        x = 0.0 if a_x * b_x <= 0.0 else min(abs(a_x), abs(b_x))
        y = 0.0 if a_y * b_y <= 0.0 else min(abs(a_y), abs(b_y))
        z = 0.0 if a_z * b_z <= 0.0 else min(abs(a_z), abs(b_z))
        return self.distance((x, y, z))

    def normal(self, p: Vector) -> Vector:
        """Return the outward normal at the surface's point that is nearest to p."""
        room = subtract((abs(p[0]), abs(p[1]), abs(p[2])), self.half)
        out = [max(x, 0.0) for x in room]
        if not any(out):
            out[room.index(max(room))] = 1.0
        n = (math.copysign(out[0], p[0]), math.copysign(out[1], p[1]), math.copysign(out[2], p[2]))
        return divide(n, norm(n))

    def nearest(self, bone: Segment) -> tuple[float, Vector]:
        """Return distance and place of the point of a line that is nearest to the box, or deepest in it.

        The distance is convex along the line, so a ternary search finds it; of a line along a face, its middle.
        """
        a, b = bone
        d, distance_along = subtract(b, a), self.distance_along
        low, high = 0.0, 1.0
        for _ in range(_SEARCHES):
            third = (high - low) / 3.0
            s, t = low + third, high - third
            left, right = distance_along(a, d, s), distance_along(a, d, t)
            if left <= right:
                high = t
            if right <= left:
                low = s
        ends = ((self.distance(p), p) for p in (lerp(a, b, 0.5 * (low + high)), a, b))
        return min(ends, key=lambda end: end[0])


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
    """

    def __init__(self, sides: Vector, rate: float, angles: Angles = STRAIGHT) -> None:
        self._box = Box(scale(0.5, sides))
        self._rate = rate
        self._far = norm(self._box.half) + REACH
        self._still: tuple[object, ...] | None = None
        """Arguments and angles of a step that changed no angle: the same again would change none either."""
        self._bones: tuple[Angles, list[Segment]] | None = None
        """The phalanges and the angles that they are of."""
        self.wanted = self.angles = angles

    def advance(self, dt: float, goal: Angles, H: Frame) -> None:
        """Turn the joints towards wanted angles, rad, for dt, with the hand at H, seen from the object."""
        most = self._rate * dt
        if goal != self.wanted:
            goal = tuple(min(max(angle, 0.0), JOINT_MAX) for angle in goal)
            self.wanted = tuple(_towards(a, b, most) for a, b in zip(self.wanted, goal, strict=True))
        if self.angles == self.wanted and norm(H.p) > self._far:
            return
        step = (dt, self.wanted, H.p, H.q, self.angles)
        if step == self._still:
            return
        before = self.angles
        self.angles = tuple(angle for finger in FINGERS for angle in self._turned(finger, most, H))
        self._still = step if self.angles == before else None

    def settle(self, goal: Angles, H: Frame) -> None:
        """Close straight fingers of a hand at H around the object, as far as they go."""
        for _ in range(math.ceil(JOINT_MAX / _FINE)):
            self.advance(_FINE / self._rate, goal, H)

    def contacts(self, H: Frame, within: float = _TOUCH) -> list[Contact]:
        """Return phalanges, and parts of the palm, of a hand at H that are at most that far from the object, m."""
        if norm(H.p) > self._far:
            return []
        capsules = [(i, RADIUS, bone) for i, bone in enumerate(self.bones())]
        found: list[Contact] = []
        for joint, radius, bone in [*capsules, *((None, PALM_RADIUS, bone) for bone in PALM_BONES)]:
            line = _moved(H, bone)
            if self._box.least_room(line) > radius + within:
                continue
            away, p = self._box.nearest(line)
            if away - radius <= within:
                found.append(Contact(joint, radius, away - radius, p, scale(-1.0, self._box.normal(p))))
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

    def bones(self) -> list[Segment]:
        """Return the lines in the middle of all phalanges, in H."""
        if self._bones is None or self._bones[0] != self.angles:
            bones = [bone for finger in FINGERS for bone in phalanges(finger, self._of(finger))]
            self._bones = self.angles, bones
        return self._bones[1]

    def _of(self, finger: Finger) -> Angles:
        return tuple(self.angles[i] for i in finger.joints)

    def _turned(self, finger: Finger, most: float, H: Frame) -> list[float]:
        """Return a finger's angles after joints have turned by at most that much, rad.

        Where the ones beyond a joint cannot give way as fast as it brings them into the object, the finger closes more
        slowly.
        """
        angles = [_towards(self.angles[i], self.wanted[i], most) for i in finger.joints]
        if self._box.distance(add(H.p, rotate(H.R, finger.root))) > sum(finger.lengths) + RADIUS:
            return angles
        for share in _SHARES:
            angles = [self.angles[i] for i in finger.joints]
            self._turn(finger, angles, share * most, most, H)
            if self._deepest(finger, angles, 0, H) >= -_ROUNDING:
                break
        return angles

    def _turn(self, finger: Finger, angles: list[float], closing: float, opening: float, H: Frame) -> None:
        """Turn joints from the palm on, by at most these angles, rad."""
        for k, (i, before) in enumerate(zip(finger.joints, angles, strict=True)):

            def gap(angle: float, k: int = k) -> float:
                angles[k] = angle
                return self._deepest(finger, angles, k, H, k + 1)

            room, wanted = gap(before), self.wanted[i]
            if room < -_ROUNDING:
                angles[k] = _least_deep(gap, room, before, max(0.0, before - opening))
            else:
                most = closing if wanted > before else opening
                angles[k] = _last_free(gap, room, before, _towards(before, wanted, most))

    def _deepest(self, finger: Finger, angles: Sequence[float], first: int, H: Frame, end: int | None = None) -> float:
        """Return the least room between the object and phalanges from `first` to before `end`, m."""
        bones = phalanges(finger, angles)[first:end]
        return min(self._room(H, bone) for bone in bones)

    def _room(self, H: Frame, bone: Segment) -> float:
        """Return the distance between a phalanx and the object, or less, above _STOPPED, where it is farther."""
        line = _moved(H, bone)
        least = self._box.least_room(line)
        return (least if least > RADIUS + _STOPPED else self._box.nearest(line)[0]) - RADIUS


def _moved(H: Frame, bone: Segment) -> Segment:
    """Return a line of a frame as seen from where that frame stands at H."""
    a, b = (add(H.p, rotate(H.R, p)) for p in bone)
    return a, b


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
