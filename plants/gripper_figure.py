"""What the tendon-driven gripper looks like: a stem and three jointed fingers that close on what is at G."""

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.limb import Limb, rod

_METAL = (86.0, 82.0, 78.0)
_FINGER = (52.0, 50.0, 50.0)
_TIP = (50.0, 96.0, 196.0)
_OPEN = np.array([[0.012, -0.048], [0.042, -0.026], [0.050, 0.008]])  # from G: distance from the axis, along z_G; m
_CLOSED = np.array([[0.012, -0.048], [0.031, -0.018], [0.026, 0.014]])
_AZIMUTHS = np.radians([60.0, 180.0, 300.0])


def gripper(p_WR: Floats, p_WG: Floats, R_WG: Floats, grip: float) -> list[Limb]:
    """Return the limbs of a gripper at G on a wrist at R; grip is 0 when open, 1 when closed."""
    z_G = R_WG[:, 2]
    knuckle = p_WG - 0.050 * z_G
    limbs = [
        rod(p_WR + 0.021 * z_G, knuckle, (0.007, 0.006), _METAL),
        rod(knuckle - 0.004 * z_G, knuckle + 0.002 * z_G, (0.0125, 0.0125), _METAL),
    ]
    joints = _OPEN + min(max(grip, 0.0), 1.0) * (_CLOSED - _OPEN)
    for azimuth in _AZIMUTHS:
        outwards = R_WG @ np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        root, joint, tip = p_WG + joints[:, :1] * outwards + joints[:, 1:] * z_G
        pad = joint + 0.5 * (tip - joint)
        limbs.append(rod(root, joint, (0.0048, 0.0042), _FINGER))
        limbs.append(rod(joint, pad, (0.0042, 0.0038), _FINGER))
        limbs.append(rod(pad, tip, (0.0046, 0.0042), _TIP))
    return limbs
