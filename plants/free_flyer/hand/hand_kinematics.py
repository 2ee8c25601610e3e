"""A person's hand as a chain of bones: 14 joints between the palm's frame H and five fingertips. All sizes are assumed.

Joints are those of [Fernandes2020] sec. 4.2.1: thumb 2, then 3 each of index, middle, ring and little finger, every one
a hinge from 0, straight, to 90 degrees. Fingers do not spread.

H is the middle of what the hand holds: x of H along the straight fingers, y towards the thumb's side, and the palm lies
above it and faces -z. Fingers bend towards -z; the thumb stands opposed, before the palm's heel, and bends towards x.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from handover.cosim.blocks.plain_rotation import Vector, add, add_scaled, scale

JOINTS = 14
JOINT_MAX = math.pi / 2.0
"""Largest angle of a joint, rad. [Fernandes2020] sec. 4.2.1"""
RADIUS = 0.008
"""Radius of a phalanx, a capsule, m."""
PALM: Vector = (-0.03, 0.0, 0.036)
"""Middle of the palm in H, m."""
PALM_SIDES: Vector = (0.085, 0.08, 0.022)
"""Sides of the palm, a box along the axes of H, m."""
REACH = 0.16
"""Metres from H within which the whole hand is, whatever its joints."""

Segment = tuple[Vector, Vector]
"""The line between the ends of a bone."""
Ball = tuple[Vector, float]
"""Centre and radius, m."""


@dataclass(frozen=True)
class Finger:
    """A finger in H.

    Attributes:
        name: of the finger.
        root: where it joins the palm, m.
        ahead: its direction where it is straight.
        bend: the direction towards which it bends, at a right angle to `ahead`.
        lengths: of its phalanges from the root, m.
        first: index of its first joint.
        closed: angles of its joints in a fist, rad.
    """

    name: str
    root: Vector
    ahead: Vector
    bend: Vector
    lengths: tuple[float, ...]
    first: int
    closed: tuple[float, ...]

    @property
    def joints(self) -> range:
        """The indices of its joints among the hand's."""
        return range(self.first, self.first + len(self.lengths))

    def direction(self, bent: float) -> Vector:
        """Return the direction of a phalanx that is bent by an angle, rad, from where the finger is straight."""
        return add_scaled(scale(math.cos(bent), self.ahead), math.sin(bent), self.bend)


def _finger(name: str, y: float, lengths: tuple[float, ...], first: int) -> Finger:
    root = add(PALM, (0.5 * PALM_SIDES[0], y, 0.0))
    return Finger(name, root, (1.0, 0.0, 0.0), (0.0, 0.0, -1.0), lengths, first, (1.2, 1.4, 1.0))


_THUMB_ROOT = (-0.036, 0.022, 0.020)
"""Where the thumb joins the palm, in H, m."""
FINGERS = (
    Finger("thumb", _THUMB_ROOT, (0.0, 0.2, -math.sqrt(0.96)), (1.0, 0.0, 0.0), (0.035, 0.028), 0, (1.0, 0.8)),
    _finger("index", 0.03, (0.038, 0.024, 0.018), 2),
    _finger("middle", 0.01, (0.042, 0.027, 0.018), 5),
    _finger("ring", -0.01, (0.039, 0.025, 0.018), 8),
    _finger("little", -0.03, (0.031, 0.019, 0.016), 11),
)
"""Thumb, index, middle, ring and little finger; bones as long as an adult's."""

CLOSED = tuple(angle for finger in FINGERS for angle in finger.closed)
"""Angles of a fist's joints, rad."""
STRAIGHT = (0.0,) * JOINTS


PALM_RADIUS = 0.5 * PALM_SIDES[2]
"""Radius of the capsules of which the palm is made where it touches an object, m."""
PALM_BONES: tuple[Segment, ...] = tuple(
    (add(PALM, (x, -0.03, 0.0)), add(PALM, (x, 0.03, 0.0))) for x in (-0.03, -0.01, 0.01, 0.03)
)
"""Their lines in H, across the palm."""


def joint_places(finger: Finger, angles: Sequence[float]) -> list[Vector]:
    """Return where a finger's joints and its tip are in H, m, at the angles of its joints, rad."""
    places, bent = [finger.root], 0.0
    for angle, length in zip(angles, finger.lengths, strict=True):
        bent += angle
        places.append(add_scaled(places[-1], length, finger.direction(bent)))
    return places


def phalanges(finger: Finger, angles: Sequence[float]) -> list[Segment]:
    """Return the lines in the middle of a finger's phalanges in H, from the palm, at the angles of its joints, rad."""
    return list(pairwise(joint_places(finger, angles)))
