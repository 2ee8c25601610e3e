"""Geometry of the soft hand of the grasp scene, seen from above, without physics: where its phalanges and sensors are.

Frame H: origin at the wrist, x towards the object, y to the left. The thumb is on the right (-y), index and ring finger
are on the left, one behind the other. With the joints at 0 the fingers are straight and spread; a positive angle bends
inwards.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True, kw_only=True)
class Finger:
    """A chain of phalanges, in H.

    Attributes:
        base: first joint, in m.
        spread: direction of the first phalanx at joint angle 0, in rad from x to y.
        flexion: 1 if bending inwards turns from x to y, else -1.
        lengths: of the phalanges, in m; each is a capsule of that length between the middles of its ends.
        radii: half their thickness, in m.
        pulleys: radii at which the tendon passes the joints, in m.
        stiffness: of the joints, in N m/rad; they are relaxed at angle 0.
    """

    base: tuple[float, float]
    spread: float
    flexion: int
    lengths: tuple[float, ...]
    radii: tuple[float, ...]
    pulleys: tuple[float, ...]
    stiffness: tuple[float, ...]


THUMB: Final = Finger(
    base=(0.050, -0.040),
    spread=-0.50,
    flexion=1,
    lengths=(0.048, 0.036),
    radii=(0.008, 0.007),
    pulleys=(0.010, 0.007),
    stiffness=(0.040, 0.040),
)
INDEX: Final = Finger(
    base=(0.060, 0.042),
    spread=0.60,
    flexion=-1,
    lengths=(0.044, 0.028, 0.024),
    radii=(0.008, 0.007, 0.0065),
    pulleys=(0.010, 0.008, 0.006),
    stiffness=(0.064, 0.064, 0.060),
)
RING: Final = Finger(
    base=(0.050, 0.040),
    spread=0.45,
    flexion=-1,
    lengths=(0.042, 0.027, 0.023),
    radii=(0.008, 0.007, 0.0065),
    pulleys=(0.010, 0.008, 0.006),
    stiffness=(0.040, 0.040, 0.038),
)
FINGERS: Final = (THUMB, INDEX, RING)
"""In the order of joints, sensors and ticks. All assumed, of a human hand's size: [Luberto] gives no dimensions of the
hand. In a plan view fingers cannot be spread sideways, so index and ring lie on one side and differ in base, length and
stiffness: the stiffer index lags behind, as in sec. V-D."""

JOINTS: Final = sum(len(f.lengths) for f in FINGERS)
MIN_ANGLE, MAX_ANGLE = -0.2, 1.6
"""Limits of the joint angles, in rad; assumed."""

PALM: Final = ((0.0, -0.044), (0.056, -0.044), (0.056, 0.044), (0.0, 0.044))
"""Corners of the palm in H, in m, counter-clockwise; assumed."""

SENSOR_PLACE: Final = 0.5
"""Where on the distal phalanx the sensor sits, flush with the pad: 0 its joint, 1 its end; assumed. It looks square to
it."""


def finger_points(p_WH: Floats, yaw: float, q: Floats) -> list[Floats]:
    """Return the middles of joints and tip of each finger, (phalanges + 1, 2) in W, in m.

    Args:
        p_WH: position of the wrist, (2,), in m.
        yaw: orientation of the hand, in rad.
        q: joint angles, (8,), in rad: thumb 2, index 3, ring 3.
    """
    points: list[Floats] = []
    first = 0
    for f in FINGERS:
        n = len(f.lengths)
        heading = yaw + f.spread + f.flexion * np.cumsum(q[first : first + n], dtype=np.float64)
        first += n
        base = p_WH + _rotate(f.base, yaw)
        links = np.array(f.lengths)[:, None] * np.column_stack([np.cos(heading), np.sin(heading)])
        points.append(np.vstack([base, base + np.cumsum(links, axis=0)]))
    return points


def palm_outline(p_WH: Floats, yaw: float) -> Floats:
    """Return the corners of the palm, (4, 2) in W, in m."""
    return np.array([p_WH + _rotate(corner, yaw) for corner in PALM])


def sensor_rays(p_WH: Floats, yaw: float, q: Floats) -> tuple[Floats, Floats]:
    """Return where the sensors sit and where they look: origins (3, 2) in m and unit vectors (3, 2), both in W."""
    origins, directions = np.zeros((3, 2)), np.zeros((3, 2))
    for i, (f, points) in enumerate(zip(FINGERS, finger_points(p_WH, yaw, q), strict=True)):
        along = (points[-1] - points[-2]) / f.lengths[-1]
        directions[i] = f.flexion * np.array([-along[1], along[0]])
        origins[i] = points[-2] + SENSOR_PLACE * f.lengths[-1] * along + f.radii[-1] * directions[i]
    return origins, directions


def _rotate(p: tuple[float, float], yaw: float) -> Floats:
    c, s = math.cos(yaw), math.sin(yaw)
    return np.array([c * p[0] - s * p[1], s * p[0] + c * p[1]])
