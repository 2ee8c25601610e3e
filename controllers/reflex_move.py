"""One commanded move of wrist and closure, and the reading of the sensors at its end."""

from typing import NamedTuple

X = tuple[float, ...]
"""Control inputs [p_x, p_y, yaw, sigma]: m, m, rad, 1."""


class Reading(NamedTuple):
    """Means over some scans at rest: encoders x and sensors, in ticks, shape (3,)."""

    x: X
    ticks: tuple[float, ...]


class Move:
    """Waits until the encoders have come to a goal or the time is up, lets the fingers calm down, averages scans.

    Args:
        tolerance: distance of encoders and goal at which the move is done, by input.
        calm: control periods between arrival and the first scan that counts. At least 1: what is read at the instant
            of arrival was scanned on the way.
    """

    def __init__(self, tolerance: X, calm: int) -> None:
        self._tolerance, self._calm = tolerance, calm
        self.goal: X = ()
        self._scans, self._periods, self._elapsed, self._rested = 0, 0, 0, 0
        self._sum: list[float] = []

    def start(self, goal: X, scans: int, periods: int) -> None:
        """Begin a move that ends with the mean of so many scans, with 0 on arrival.

        After so many control periods it counts as arrived in any case: what the fingers push against may keep the
        closure from its goal.
        """
        self.goal = goal
        self._scans, self._periods, self._elapsed, self._rested = scans, periods, 0, -1
        self._sum = [0.0] * 7

    def advance(self, x: X, ticks: X) -> Reading | None:
        """Look at encoders and sensors once; return the reading when the move is over, else None."""
        if self._rested < 0 and (self._elapsed >= self._periods or self._arrived(x)):
            self._rested = 0
            if not self._scans:
                return Reading(x, ticks)
        elif self._rested >= 0:
            self._rested += 1
            if self._rested >= self._calm:
                self._sum = [a + b for a, b in zip(self._sum, (*x, *ticks), strict=True)]
            if self._rested == self._calm + self._scans - 1:
                mean = [a / self._scans for a in self._sum]
                return Reading(tuple(mean[:4]), tuple(mean[4:]))
        self._elapsed += 1
        return None

    def _arrived(self, x: X) -> bool:
        return all(abs(a - b) <= tol for a, b, tol in zip(x, self.goal, self._tolerance, strict=True))

    def get_state(self) -> tuple[X, tuple[int, int, int, int], list[float]]:
        """Return goal, counters and sums."""
        return self.goal, (self._scans, self._periods, self._elapsed, self._rested), list(self._sum)

    def set_state(self, state: tuple[X, tuple[int, int, int, int], list[float]]) -> None:
        """Go back to a state that `get_state` gave."""
        self.goal, (self._scans, self._periods, self._elapsed, self._rested), total = state
        self._sum = list(total)
