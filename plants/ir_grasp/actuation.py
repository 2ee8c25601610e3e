"""How the hand of the grasp scene moves: the wrist follows its command, and one elastic tendon closes all joints.

The tendon's tension is T = k max(0, sigma L - sum r q); `resting_posture` gives the joints that it leads to in free
space.
"""

import math
from operator import mul
from typing import Final

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.hand import FINGERS, MAX_ANGLE, MIN_ANGLE


def follow(
    error: tuple[float, float], velocity: tuple[float, float], speed: float, acceleration: float, lag: float, dt: float
) -> tuple[float, float]:
    """Return the velocity for the coming dt of a point that is to go by `error`, in m and m/s, or rad and rad/s.

    It heads for its goal with the speed min(v_max, e / lag, sqrt(a e)), e what is left to go: from full speed it brakes
    with a / 2, then with at most a, and settles exponentially. The velocity changes by at most a dt.
    """
    left = math.hypot(*error)
    wanted = min(speed, left / lag, math.sqrt(acceleration * left)) / left if left > 0.0 else 0.0
    d_x, d_y = wanted * error[0] - velocity[0], wanted * error[1] - velocity[1]
    change = math.hypot(d_x, d_y)
    share = 1.0 if change <= acceleration * dt else acceleration * dt / change
    return velocity[0] + share * d_x, velocity[1] + share * d_y


PULLEYS: Final = np.array([r for f in FINGERS for r in f.pulleys])
"""Radii r at which the tendon passes the joints, (8,), in m."""

STIFFNESS: Final = np.array([k for f in FINGERS for k in f.stiffness])
"""Stiffness K of the joints by design, (8,), in N m/rad."""

GEARS: Final = tuple(
    f.flexion * (r - after) for f in FINGERS for r, after in zip(f.pulleys, (*f.pulleys[1:], 0.0), strict=True)
)
"""Tendon that a phalanx takes up by turning alone, 8, in m/rad; also the torque on it at a tension of 1 N."""

_PALM_GEAR = sum(f.flexion * f.pulleys[0] for f in FINGERS)
_RELAXED = sum(f.flexion * f.pulleys[0] * f.spread for f in FINGERS)


def tendon_excursion(angles: list[float], yaw: float) -> float:
    """Return sum r q in m, by the orientations of the 8 phalanges and of the hand, in rad."""
    return sum(map(mul, GEARS, angles)) - _PALM_GEAR * yaw - _RELAXED


def resting_posture(sigma: float, stiffness: float, travel: float, joint_stiffness: Floats = STIFFNESS) -> Floats:
    """Return the joint angles, (8,), in rad, of the hand at rest in free space.

    There K q = r T at each joint between its limits, and sum r q + T / k = sigma L, whose left side rises with T.

    Args:
        sigma: closure, 0 to 1.
        stiffness: k of the tendon, in N/m.
        travel: L, what the motor takes up at closure 1, in m.
        joint_stiffness: K of the joints, (8,), in N m/rad.
    """

    def posture(T: float) -> Floats:
        return np.clip(PULLEYS * T / joint_stiffness, MIN_ANGLE, MAX_ANGLE)

    low, high = 0.0, stiffness * sigma * travel
    for _ in range(80):
        middle = (low + high) / 2.0
        if float(PULLEYS @ posture(middle)) + middle / stiffness < sigma * travel:
            low = middle
        else:
            high = middle
    return posture(low)
