"""The gripper's three fingers, as they are painted and as they touch: two links each, by the closure. All assumed."""

import numpy as np

from handover.cosim.blocks.ports import Floats

_OPEN = np.array([[0.012, -0.048], [0.042, -0.026], [0.050, 0.008]])  # from G: distance from the axis, along z_G; m
_CLOSED = np.array([[0.012, -0.048], [0.031, -0.018], [0.026, 0.014]])
_AZIMUTHS = np.radians([60.0, 180.0, 300.0])

FINGERS = len(_AZIMUTHS)
"""How many there are."""

KNUCKLE = 0.05
"""How far before G along z_G the fingers are joined to the gripper's stem, m."""

LINK_RADIUS, PALM_RADIUS = 0.0042, 0.0125
"""Of the fingers' links, and of the gripper's palm, where they touch, m."""


def finger_joints(p_WG: Floats, R_WG: Floats, grip: float) -> Floats:
    """Return root, middle joint and tip of each finger, in W, shape (3, 3, 3): finger, point, coordinate; m.

    The points move on straight lines from where they are when the gripper is open to where they are when it is closed.

    Args:
        p_WG: position of the gripper, shape (3,), m.
        R_WG: its orientation, z_G along the axis to the tips, shape (3, 3).
        grip: closure, 0 open, 1 closed; what lies beyond is cut.
    """
    joints = _OPEN + min(max(grip, 0.0), 1.0) * (_CLOSED - _OPEN)
    outwards = np.stack([np.cos(_AZIMUTHS), np.sin(_AZIMUTHS), np.zeros(3)], axis=1) @ np.transpose(R_WG)
    return p_WG + joints[:, :1] * outwards[:, None] + joints[:, 1:] * R_WG[:, 2]
