"""Paths of straight and circular segments, point by point. [Gandarias2020] algorithms 1 and 2, corrected."""

import enum
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.ports import Floats


class Path(enum.IntEnum):
    """Paths of [Gandarias2020] sec. V-A, and custom ones."""

    LINEAR = 0
    CURVE = 1
    SQUARE = 2
    CUSTOM = 3


@dataclass(frozen=True)
class Line:
    """Straight segment from x_0 to x_g, shapes (3,), m: algorithm 1."""

    x_0: Floats
    x_g: Floats

    @property
    def length(self) -> float:
        """Length, m."""
        return float(np.linalg.norm(self.x_g - self.x_0))

    def sampled(self, N: int, V: float) -> tuple[Floats, Floats]:
        """Return N + 1 points, m, and the velocity at each, m/s, both of shape (N + 1, 3).

        x_{k+1} = x_k + (x_g - x_k) / (N - (k - 1)) comes out as N equal steps.
        """
        displacement = self.x_g - self.x_0
        points = self.x_0 + np.arange(N + 1)[:, None] / N * displacement
        points[N] = self.x_g
        return points, np.tile(V / self.length * displacement, (N + 1, 1))


@dataclass(frozen=True)
class QuarterArc:
    """Quarter circle in a plane y = const about x_c, from x_0 to x_g, shapes (3,), m: algorithm 2.

    At alpha the point is x_c + r [sin, 0, -cos] where x_0 is below x_c, and x_c - r [sin, 0, -cos] where it is above;
    velocities V [cos, 0, sin] and -V [cos, 0, sin]. The printed algorithm has the first only, which as the second half
    of the curve would run elsewhere, and takes each velocity at the point after that of its Jacobian; here both are of
    the same point.
    """

    x_0: Floats
    x_c: Floats

    @property
    def x_g(self) -> Floats:
        """End, shape (3,), m."""
        return self.x_c + self._sign * self._radius * np.array([1.0, 0.0, 0.0])

    @property
    def length(self) -> float:
        """Length, m."""
        return self._radius * math.pi / 2.0

    @property
    def _radius(self) -> float:
        return float(np.linalg.norm(self.x_c - self.x_0))

    @property
    def _sign(self) -> float:
        return 1.0 if self.x_0[2] < self.x_c[2] else -1.0

    def sampled(self, N: int, V: float) -> tuple[Floats, Floats]:
        """Return N + 1 points, m, and the velocity at each, m/s, both of shape (N + 1, 3)."""
        alpha = np.arange(N + 1) * (math.pi / 2.0 / N)
        zero = np.zeros(N + 1)
        points = self.x_c + self._sign * self._radius * np.column_stack([np.sin(alpha), zero, -np.cos(alpha)])
        velocities = self._sign * V * np.column_stack([np.cos(alpha), zero, np.sin(alpha)])
        return points, velocities


@dataclass(frozen=True)
class Arc:
    """Arc of a circle from x_0 by way of `via` to x_g, shapes (3,), m, which are not on one line."""

    x_0: Floats
    via: Floats
    x_g: Floats

    @property
    def length(self) -> float:
        """Length, m."""
        _, r, _, _ = self._circle()
        return r * self._sweep()

    def sampled(self, N: int, V: float) -> tuple[Floats, Floats]:
        """Return N + 1 points, m, and the velocity at each, m/s, both of shape (N + 1, 3)."""
        x_c, r, outwards, along = self._circle()
        alpha = np.arange(N + 1)[:, None] * (self._sweep() / N)
        points = x_c + r * (np.cos(alpha) * outwards + np.sin(alpha) * along)
        points[N] = self.x_g
        return points, V * (np.cos(alpha) * along - np.sin(alpha) * outwards)

    def _circle(self) -> tuple[Floats, float, Floats, Floats]:
        """Return the centre, the radius, and the directions at x_0 outwards and along the arc."""
        u, v = self.via - self.x_0, self.x_g - self.x_0
        n = np.cross(u, v)
        x_c = self.x_0 + (u @ u * np.cross(v, n) + v @ v * np.cross(n, u)) / (2.0 * n @ n)
        r = float(np.linalg.norm(self.x_0 - x_c))
        outwards = (self.x_0 - x_c) / r
        return x_c, r, outwards, np.cross(n, outwards) / float(np.linalg.norm(n))

    def _sweep(self) -> float:
        """Return the angle from x_0 to x_g, from 0 to 2 pi."""
        x_c, _, outwards, along = self._circle()
        to = self.x_g - x_c
        return math.atan2(float(to @ along), float(to @ outwards)) % (2.0 * math.pi)


Segment = Line | QuarterArc | Arc


def segments_of(path: Path, x_0: Floats, x_g: Floats) -> Sequence[Segment]:
    """Return the segments of a path of the paper, or of the straight one from x_0 to x_g, shapes (3,), m."""
    if path is Path.LINEAR:
        return [Line(_xz(0.3, 0.05), _xz(0.3, 0.35))]
    if path is Path.CURVE:
        return [QuarterArc(_xz(0.3, 0.05), _xz(0.3, 0.15)), QuarterArc(_xz(0.4, 0.15), _xz(0.4, 0.05))]
    if path is Path.SQUARE:
        corners = [_xz(0.35, 0.05), _xz(0.25, 0.05), _xz(0.25, 0.15), _xz(0.35, 0.15)]
        return [Line(corners[i], corners[(i + 1) % 4]) for i in range(4)]
    return [Line(np.array(x_0), np.array(x_g))]


def _xz(x: float, z: float) -> Floats:
    return np.array([x, 0.0, z])


class Departure:
    """When the tip sets off: it has waited for some periods, and `go` is true; the periods since then are counted."""

    def __init__(self, wait: float) -> None:
        self._wait = wait
        self.state: tuple[int, int | None] = 0, None
        """Periods waited, and those since it set off; None before."""

    def periods(self, *, go: bool) -> int | None:
        """Return the periods since it set off, 0 if it does here, None if it does not yet."""
        waited, since = self.state
        return 0 if since is None and waited >= self._wait and go else since

    def pass_period(self, *, go: bool) -> None:
        """Go to the end of a period, at whose beginning `go` was so."""
        waited, since = self.state[0], self.periods(go=go)
        self.state = (waited + 1, None) if since is None else (waited, since + 1)
