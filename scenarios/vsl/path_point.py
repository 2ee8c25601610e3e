"""A point of the desired path and where the arm was when its time for it was over."""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals


@dataclass(frozen=True)
class PathPoint:
    """Positions of the tip at time t, each of shape (3,), in W, m.

    Attributes:
        t: time, s.
        desired: the point that the arm had been told to go to.
        tracked: the tip by the tracker.
        true: the tip itself.
        servo: the tip that encoders and rigid links give.
        estimated: the tip that the forward model gives.
        outside: whether the learned model had to extrapolate.
    """

    t: float
    desired: Floats
    tracked: Floats
    true: Floats
    servo: Floats
    estimated: Floats
    outside: bool

    @classmethod
    def take(cls, t: float, desired: Floats, signals: Signals) -> "PathPoint":
        """Copy the positions as they are."""
        return cls(
            t,
            desired,
            signals["arm.p_WG_meas"],
            signals["arm.p_WG"],
            signals["kinematics.p_WG_model"],
            signals["kinematics.p_WG_est"],
            bool(signals["kinematics.outside"]),
        )

    @property
    def reach(self) -> float:
        """Horizontal distance of the desired point from the first joint's axis, m."""
        return float(np.hypot(self.desired[0], self.desired[1]))

    @property
    def error(self) -> float:
        """Distance of the tracked tip from the desired point, m."""
        return distance(self.tracked, self.desired)


def distance(p: Floats, q: Floats) -> float:
    """Return the distance between two points, m."""
    return float(np.linalg.norm(p - q))


def distance_to_path(p: Floats, path: Floats) -> float:
    """Return the distance of a point from the polyline through two or more points, shape (n, 3), m."""
    start, along = path[:-1], np.diff(path, axis=0)
    squares = np.maximum(np.sum(along**2, axis=1), np.finfo(np.float64).tiny)  # a leg of no length is its start
    share = np.clip(np.sum((p - start) * along, axis=1) / squares, 0.0, 1.0)
    return float(np.min(np.linalg.norm(start + share[:, None] * along - p, axis=1)))
