"""Detection of a person's pull or push from a gripper's velocity. [Fernandes2020] sec. 3.1.2."""

import math

from handover.cosim.blocks.plain_rotation import ZERO, Vector, lerp, norm


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

    @property
    def velocity(self) -> Vector:
        """The low-passed velocity, m/s; zero before the first measurement."""
        return ZERO if self._v is None else self._v

    def disarm(self) -> None:
        """Ignore thresholds until the gripper is slower than one again."""
        self._armed = False

    def arm_below(self, threshold: float) -> None:
        """Let thresholds count from here on if the gripper is no faster than this one."""
        self._armed |= self.speed <= threshold

    def exceeds(self, threshold: float) -> bool:
        """Return whether the speed has risen above the threshold; to be called at each measurement after `disarm`."""
        self.arm_below(threshold)
        return self._armed and self.speed > threshold

    def get_state(self) -> tuple[Vector | None, bool, float]:
        """Return the filter, whether the threshold counts, and the speed."""
        return self._v, self._armed, self.speed

    def set_state(self, state: tuple[Vector | None, bool, float]) -> None:
        """Restore a state that `get_state` gave."""
        self._v, self._armed, self.speed = state


class PullMonitor:
    """Whether a gripper is being pulled: its speed has risen faster than thrust can make it, and is not braked since.

    A free-flyer that was knocked coasts at a speed that says nothing of when the knock ended: its rate of change does.
    A pull begins while the speed rises by more than `least`, and ends when it falls by more than `braking`, or is no
    more than a threshold.

    Args:
        least: acceleration, m/s2; above what the propulsion can give the gripper.
        braking: deceleration, m/s2; below what it can.
        time: time constant of the low-pass of the speed's rate, s; 0 for none.
        period: time between two measurements, s.
    """

    def __init__(self, least: float, braking: float, time: float, period: float) -> None:
        self._least, self._braking, self._period = least, braking, period
        self._gain = 1.0 - math.exp(-period / time) if time > 0.0 else 1.0
        self._speed: float | None = None
        self._rate, self._pulled = 0.0, False

    def measure(self, speed: float, threshold: float) -> bool:
        """Take in a speed, m/s; return whether the gripper is pulled. The first speed is where the rate begins."""
        before = speed if self._speed is None else self._speed
        self._rate += self._gain * ((speed - before) / self._period - self._rate)
        self._speed = speed
        if speed <= threshold or self._rate < -self._braking:
            self._pulled = False
        elif self._rate > self._least:
            self._pulled = True
        return self._pulled

    def get_state(self) -> tuple[float | None, float, bool]:
        """Return speed, its rate, and whether it is pulled."""
        return self._speed, self._rate, self._pulled

    def set_state(self, state: tuple[float | None, float, bool]) -> None:
        """Restore a state that `get_state` gave."""
        self._speed, self._rate, self._pulled = state
