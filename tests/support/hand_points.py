"""A hand's 21 landmarks as MediaPipe numbers them, of the simulated person's hand."""

import math

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.hand_kinematics import FINGERS, STRAIGHT, joint_places


def landmarks_of_hand(angles: tuple[float, ...] = STRAIGHT, *, right: bool = True) -> Floats:
    """Return 21 points of a hand in H, m: the wrist, and the joints and tips of the simulated person's fingers.

    The thumb has one more landmark than the simulated one's joints, at its base. The palm has the length that is
    assumed, 0.09 m from the wrist to the middle finger's knuckle. A left hand is the mirror image.
    """
    fingers = [joint_places(finger, angles[finger.joints.start : finger.joints.stop]) for finger in FINGERS]
    middle = np.array(fingers[2][0])
    wrist = middle - [math.sqrt(0.09**2 - middle[1] ** 2), middle[1], 0.0]
    thumb_base = np.array(fingers[0][0]) - 0.03 * np.array(FINGERS[0].ahead)
    points = np.array([wrist, thumb_base, *(p for finger in fingers for p in finger)])
    return points if right else points * [1.0, -1.0, 1.0]


def turned(points: Floats, R: Floats) -> Floats:
    """Return points, rows, turned by a rotation."""
    return np.einsum("ij,kj->ki", R, points)
