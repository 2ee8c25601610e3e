"""Where the hand's sensors are by its closure, the Jacobian that follows from that, and what a reading stands for.

In the hand's frame H: origin at the wrist, x ahead, y to the left. The values are of the hand's design (assumed, as
the plant's), its fingers free: what they touch bends them otherwise.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from handover.cosim.blocks.ports import Floats

_FULL_SCALE: Final = 4095.0
_HALVINGS: Final = 60  # halvings of 4095 ticks: beyond the last bit of a float

_STEP: Final = 0.1  # of the closure, from one row of the table to the next
_TABLE: Final = np.array(
    [
        [[0.1113, -0.0655, 1.071], [0.1330, 0.0841, -0.971], [0.1253, 0.0692, -1.121]],
        [[0.1144, -0.0530, 1.348], [0.1378, 0.0724, -1.219], [0.1288, 0.0502, -1.517]],
        [[0.1149, -0.0404, 1.624], [0.1404, 0.0603, -1.467], [0.1271, 0.0316, -1.913]],
        [[0.1128, -0.0281, 1.901], [0.1410, 0.0480, -1.716], [0.1207, 0.0146, -2.308]],
        [[0.1082, -0.0168, 2.178], [0.1395, 0.0361, -1.964], [0.1104, 0.0006, -2.704]],
        [[0.1017, -0.0068, 2.455], [0.1362, 0.0249, -2.212], [0.0975, -0.0097, -3.100]],
        [[0.0934, 0.0013, 2.731], [0.1311, 0.0147, -2.460], [0.0832, -0.0157, -3.496]],
    ]
)
"""Window of the sensor, x and y in m, and direction in which it looks, in rad from x to y: closure 0 to 0.6, then
thumb, index, ring."""

LARGEST_CLOSURE: Final = _STEP * (len(_TABLE) - 1)
"""Closure up to which the table goes."""


class SensorPoses(NamedTuple):
    """Windows p (3, 2) in m, directions n (3, 2), unit vectors, and dp/dsigma (3, 2) in m, all in H."""

    p: Floats
    n: Floats
    slope: Floats


@lru_cache(maxsize=8)  # asked several times in a round, at one closure
def sensor_poses(sigma: float) -> SensorPoses:
    """Return the poses of thumb's, index's and ring's sensor at a closure, by linear interpolation; read-only."""
    at = min(max(sigma / _STEP, 0.0), len(_TABLE) - 1.001)
    row = int(at)
    slope = _TABLE[row + 1] - _TABLE[row]
    pose = _TABLE[row] + (at - row) * slope
    n = np.column_stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])])
    poses = SensorPoses(pose[:, :2], n, slope[:, :2] / _STEP)
    for values in poses:
        values.flags.writeable = False
    return poses


@lru_cache(maxsize=8)  # likewise
def nominal_jacobian(sigma: float) -> Floats:
    """Return d(distance)/d[ahead, left, yaw, sigma], (3, 4), in m per m, m, rad, 1, for a surface that is met squarely.

    A window that moves by dp comes nearer by n . dp; that the beam turns changes its length in second order only. The
    array is read-only.
    """
    p, n, slope = sensor_poses(sigma)
    turning = n[:, 1] * p[:, 0] - n[:, 0] * p[:, 1]
    J: Floats = -np.column_stack([n, turning, np.sum(n * slope, axis=1)])
    J.flags.writeable = False
    return J


def surface_points(sigma: float, distances: Floats) -> Floats:
    """Return the points, (3, 2) in H, in m, that lie at distances (3,), in m, along the beams."""
    p, n, _ = sensor_poses(sigma)
    return p + distances[:, None] * n


@dataclass(frozen=True)
class Calibration:
    """y = a e^(b x) + c e^(d x): distance y in m over ADC output x in ticks, from 0 to 4095; falls as x grows."""

    a: float
    b: float
    c: float
    d: float

    def distance(self, ticks: float) -> float:
        """Return the distance y, in m, that stands for an ADC output, by eq. (11)."""
        return self.a * math.exp(self.b * ticks) + self.c * math.exp(self.d * ticks)

    def slope(self, ticks: float) -> float:
        """Return dy/dx, in m/tick."""
        return self.a * self.b * math.exp(self.b * ticks) + self.c * self.d * math.exp(self.d * ticks)

    def ticks(self, distance: float) -> float:
        """Return the ADC output x, in ticks, that stands for a distance in m, by halving; 0 or 4095 beyond the curve.

        A threshold in ticks is compared with readings directly, without the distance of each reading.
        """
        low, high = 0.0, _FULL_SCALE
        for _ in range(_HALVINGS):
            middle = (low + high) / 2.0
            low, high = (middle, high) if self.distance(middle) > distance else (low, middle)
        return (low + high) / 2.0

    def faults(self) -> list[str]:
        """Return what keeps the curve from falling, so that a reading would have no unique distance."""
        faults = [f"{name} = {x:g} m must be above 0" for name, x in (("a", self.a), ("c", self.c)) if x <= 0.0]
        falling = (("b", self.b), ("d", self.d))
        return faults + [f"{name} = {x:g} 1/tick must be below 0" for name, x in falling if x >= 0.0]
