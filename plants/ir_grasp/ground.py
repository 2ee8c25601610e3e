"""The ground under the object: at rest, or moved by a belt or a bump, which carry along what stands on it."""

import math
from dataclasses import dataclass
from functools import cached_property

from handover.plants.ir_grasp.shapes import Point

Span = tuple[float, float, Point]
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
        return any(math.hypot(*v) > 0.0 and first < end for first, end, v in self._in_steps)

    def velocity(self, step: int) -> Point:
        """Return its velocity in m/s during a step; 0 is the first."""
        active = [v for first, end, v in self._in_steps if first <= step < end]
        return sum(v[0] for v in active), sum(v[1] for v in active)

    def way(self, step: int) -> Point:
        """Return how far it has moved before a step, in m."""
        spent = [(self.dt * min(max(step - first, 0), max(end - first, 0)), v) for first, end, v in self._in_steps]
        return sum(t * v[0] for t, v in spent), sum(t * v[1] for t, v in spent)

    @cached_property
    def _in_steps(self) -> tuple[tuple[int, int, Point], ...]:
        """The spans by the steps that begin nearest to their times: the first, and the first after them."""
        return tuple((round(start / self.dt), round(end / self.dt), v) for start, end, v in self.spans)


def bump(way: Point, start: float, speed: float) -> Span:
    """Return the span in which the ground goes a way, in m, at a speed in m/s from a time in s on."""
    length = math.hypot(*way)
    if length == 0.0:
        return start, start, (0.0, 0.0)
    return start, start + length / speed, (way[0] / length * speed, way[1] / length * speed)
