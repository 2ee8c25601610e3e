"""Detection of a person's pull or push from a gripper's velocity. [Fernandes2020] sec. 3.1.2."""

import math

from handover.cosim.blocks.plain_rotation import Vector, lerp, norm


class VelocityMonitor:
    """Speed of the low-passed velocity, and a threshold that counts only once the gripper was slower than it.

    The components are filtered, not their norm, whose mean grows with the noise.

    Args:
        time: time constant of the filter, s; 0 for none.
        period: time between two measurements, s.
    """

    def __init__(self, time: float, period: float) -> None:
        self._gain = 1.0 - math.exp(-period / time) if time > 0.0 else 1.0
        self._v: Vector | None = None
        self._armed = False
        self.speed = 0.0

    def measure(self, v: Vector) -> None:
        """Take in a measured velocity; the first one is where the filter begins."""
        if self._v is not None:
            v = lerp(self._v, v, self._gain)
        self._v = v
        self.speed = norm(v)

    def disarm(self) -> None:
        """Ignore thresholds until the gripper is slower than one again."""
        self._armed = False

    def exceeds(self, threshold: float) -> bool:
        """Return whether the speed has risen above the threshold; to be called at each measurement after `disarm`."""
        if self.speed <= threshold:
            self._armed = True
            return False
        return self._armed

    def get_state(self) -> tuple[Vector | None, bool, float]:
        """Return the filter, whether the threshold counts, and the speed."""
        return self._v, self._armed, self.speed

    def set_state(self, state: tuple[Vector | None, bool, float]) -> None:
        """Restore a state that `get_state` gave."""
        self._v, self._armed, self.speed = state
