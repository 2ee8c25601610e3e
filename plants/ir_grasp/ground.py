"""The ground under the object: at rest, or moved by a belt or a bump, which carry along what stands on it."""

import math
from dataclasses import dataclass

Pair = tuple[float, float]
Span = tuple[float, float, Pair]
"""From when until when, in s, and with which velocity, in m/s."""


@dataclass(frozen=True)
class MovingGround:
    """Velocity and way of the ground that the object's friction acts against, in W.

    The object stands on it with dry friction only: it goes along while nothing blocks it, and a finger that holds more
    than the friction stops it while the ground slides on below. Times are counted in whole steps of `dt`, so the way
    is exact at every step.

    Attributes:
        spans: when it moves, and how fast; overlapping ones add up.
        dt: time step, in s.
    """

    spans: tuple[Span, ...]
    dt: float

    @property
    def ever_moves(self) -> bool:
        """Whether it moves at any time."""
        return any(math.hypot(*v) > 0.0 and self._steps(start, end) != (0, 0) for start, end, v in self.spans)

    def velocity(self, step: int) -> Pair:
        """Return its velocity in m/s during a step; 0 is the first."""
        active = [v for start, end, v in self.spans if self._first(start) <= step < self._first(end)]
        return sum(v[0] for v in active), sum(v[1] for v in active)

    def way(self, step: int) -> Pair:
        """Return how far it has moved before a step, in m."""
        spent = [
            (self.dt * min(max(step - self._first(start), 0), max(self._first(end) - self._first(start), 0)), v)
            for start, end, v in self.spans
        ]
        return sum(t * v[0] for t, v in spent), sum(t * v[1] for t, v in spent)

    def _first(self, t: float) -> int:
        return round(t / self.dt)

    def _steps(self, start: float, end: float) -> tuple[int, int]:
        first, last = self._first(start), self._first(end)
        return (first, last) if first < last else (0, 0)


def bump(way: Pair, start: float, speed: float) -> Span:
    """Return the span in which the ground goes a way, in m, at a speed in m/s from a time in s on."""
    length = math.hypot(*way)
    if length == 0.0:
        return start, start, (0.0, 0.0)
    return start, start + length / speed, (way[0] / length * speed, way[1] / length * speed)
