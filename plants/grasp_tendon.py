"""The elastic tendon that closes all joints of the soft hand: T = k max(0, sigma L - sum r q)."""

from operator import mul
from typing import Final

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.grasp_hand import FINGERS, HIGHEST, LOWEST

PULLEYS: Final = np.array([r for f in FINGERS for r in f.pulleys])
"""Radii r at which the tendon passes the joints, (8,), in m."""

STIFFNESS: Final = np.array([k for f in FINGERS for k in f.stiffness])
"""Stiffness K of the joints, (8,), in N m/rad."""


GEARS: Final = tuple(
    f.flexion * (r - after) for f in FINGERS for r, after in zip(f.pulleys, (*f.pulleys[1:], 0.0), strict=True)
)
"""Tendon that a phalanx takes up by turning alone, 8, in m/rad; also the torque on it at a tension of 1 N."""

_PALM_GEAR = sum(f.flexion * f.pulleys[0] for f in FINGERS)
_RELAXED = sum(f.flexion * f.pulleys[0] * f.spread for f in FINGERS)


def taken_up(angles: list[float], yaw: float) -> float:
    """Return sum r q in m, by the orientations of the 8 phalanges and of the hand, in rad."""
    return sum(map(mul, GEARS, angles)) - _PALM_GEAR * yaw - _RELAXED


def resting_posture(sigma: float, stiffness: float, travel: float) -> Floats:
    """Return the joint angles, (8,), in rad, of the hand at rest in free space.

    There K q = r T at each joint between its limits, and sum r q + T / k = sigma L, whose left side rises with T.

    Args:
        sigma: closure, 0 to 1.
        stiffness: k of the tendon, in N/m.
        travel: L, what the motor takes up at closure 1, in m.
    """

    def posture(T: float) -> Floats:
        return np.clip(PULLEYS * T / STIFFNESS, LOWEST, HIGHEST)

    low, high = 0.0, stiffness * sigma * travel
    for _ in range(80):
        middle = (low + high) / 2.0
        if float(PULLEYS @ posture(middle)) + middle / stiffness < sigma * travel:
            low = middle
        else:
            high = middle
    return posture(low)
