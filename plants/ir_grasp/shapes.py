"""Plane shapes of objects: discs, rectangles, polygons; what a ray meets of them, their integrals, what is wrong."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import NamedTuple

Point = tuple[float, float]

_SECTORS = 8
"""Faces of a disc: eighths of its circumference, the first from x to 45 degrees towards y."""

_SHORTEST_EDGE, _LEAST_AREA = 2e-3, 1e-4  # m, m2 (assumed); smaller ones slip through contacts and between rays


class Hit(NamedTuple):
    """Where a ray meets a shape: distance in m, cosine of the angle of incidence, and which face it is."""

    distance: float
    cosine: float
    face: int


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A circle about the origin of O, its radius in m. Its faces are eighths of its circumference."""

    radius: float

    @property
    def reach(self) -> float:
        """Largest distance of a point of it from the origin of O, in m."""
        return self.radius

    @property
    def area(self) -> float:
        """Area in m2."""
        return math.pi * self.radius**2

    @property
    def centroid(self) -> Point:
        """Middle of its area, in O, in m."""
        return (0.0, 0.0)

    @property
    def radius_of_gyration_squared(self) -> float:
        """Squared radius of gyration about its centroid, in m2."""
        return self.radius**2 / 2.0

    @property
    def mean_distance(self) -> float:
        """Mean distance of its points from its centroid, in m."""
        return 2.0 * self.radius / 3.0

    def intersect(self, x: float, y: float, d_x: float, d_y: float) -> Hit | None:
        """Return where a ray from (x, y) in O along the unit vector d enters."""
        middle = -(x * d_x + y * d_y)
        half_2 = self.radius**2 - x * x - y * y + middle * middle
        if half_2 <= 0.0:
            return None
        half = math.sqrt(half_2)
        if not middle > half:
            return None
        way = middle - half
        bearing = math.atan2(y + way * d_y, x + way * d_x) % (2.0 * math.pi)
        return Hit(way, half / self.radius, int(bearing / (2.0 * math.pi) * _SECTORS) % _SECTORS)


@dataclass(frozen=True, kw_only=True)
class Rectangle:
    """A rectangle along the axes of O: from `low` to `high`, in m. Its faces are those at -y, x, y and -x, as corners.

    Face i is the edge from corner i to the next one.
    """

    low: Point
    high: Point

    @property
    def corners(self) -> list[Point]:
        """The four corners, counter-clockwise."""
        (x_0, y_0), (x_1, y_1) = self.low, self.high
        return [(x_0, y_0), (x_1, y_0), (x_1, y_1), (x_0, y_1)]

    @cached_property
    def reach(self) -> float:
        """Largest distance of a point of it from the origin of O, in m."""
        return max(math.hypot(x, y) for x, y in self.corners)

    @property
    def area(self) -> float:
        """Area in m2."""
        return (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])

    @property
    def centroid(self) -> Point:
        """Middle of its area, in O, in m."""
        return ((self.low[0] + self.high[0]) / 2.0, (self.low[1] + self.high[1]) / 2.0)

    @property
    def radius_of_gyration_squared(self) -> float:
        """Squared radius of gyration about its centroid, in m2."""
        return sum((high - low) ** 2 for low, high in zip(self.low, self.high, strict=True)) / 12.0

    @property
    def mean_distance(self) -> float:
        """Mean distance of its points from its centroid, in m."""
        return Polygon(corners=tuple(self.corners)).mean_distance

    def intersect(self, x: float, y: float, d_x: float, d_y: float) -> Hit | None:
        """Return where a ray from (x, y) in O along the unit vector d enters."""
        enters, leaves, cosine, face = 0.0, math.inf, 0.0, 0
        faces = ((3, 1), (0, 2))  # at the low and the high end of x, of y
        axes = ((x, d_x, self.low[0], self.high[0]), (y, d_y, self.low[1], self.high[1]))
        for (at, along, low, high), (face_low, face_high) in zip(axes, faces, strict=True):
            if along == 0.0:
                if not low <= at <= high:
                    return None
                continue
            near, far = (low, high) if along > 0.0 else (high, low)
            if (near - at) / along > enters:
                enters, cosine = (near - at) / along, abs(along)
                face = face_low if along > 0.0 else face_high
            leaves = min(leaves, (far - at) / along)
        return Hit(enters, cosine, face) if 0.0 < enters < leaves else None


@dataclass(frozen=True, kw_only=True)
class Polygon:
    """A polygon in O, convex or not: its corners in m, counter-clockwise. Face i is the edge from corner i on."""

    corners: tuple[Point, ...]

    @cached_property
    def reach(self) -> float:
        """Largest distance of a point of it from the origin of O, in m."""
        return max(math.hypot(x, y) for x, y in self.corners)

    @property
    def area(self) -> float:
        """Area in m2; negative where the corners go clockwise."""
        return sum(_cross(a, b) for a, b in self._edges) / 2.0

    @property
    def centroid(self) -> Point:
        """Middle of its area, in O, in m."""
        share = 1.0 / (6.0 * self.area)
        x = share * sum((a[0] + b[0]) * _cross(a, b) for a, b in self._edges)
        return x, share * sum((a[1] + b[1]) * _cross(a, b) for a, b in self._edges)

    @property
    def radius_of_gyration_squared(self) -> float:
        """Squared radius of gyration about its centroid, in m2."""
        about_origin = sum(
            _cross(a, b) * sum(p * p + p * q + q * q for p, q in zip(a, b, strict=True)) for a, b in self._edges
        )
        x, y = self.centroid
        return about_origin / (12.0 * self.area) - x * x - y * y

    @property
    def mean_distance(self) -> float:
        """Mean distance of its points from its centroid, in m."""
        x, y = self.centroid
        triangles = (_distance_integral((a[0] - x, a[1] - y), (b[0] - x, b[1] - y)) for a, b in self._edges)
        return sum(triangles) / self.area

    def intersect(self, x: float, y: float, d_x: float, d_y: float) -> Hit | None:
        """Return where a ray from (x, y) in O, outside, along the unit vector d enters."""
        nearest: Hit | None = None
        for face, (a_x, a_y, e_x, e_y, length) in enumerate(self._sides):
            towards = d_x * e_y - d_y * e_x  # negative: the ray comes from the outside of this edge
            if towards >= 0.0:
                continue
            r_x, r_y = a_x - x, a_y - y
            way, share = (r_x * e_y - r_y * e_x) / towards, (r_x * d_y - r_y * d_x) / towards
            if 0.0 <= share <= 1.0 and way > 0.0 and (nearest is None or way < nearest.distance):
                nearest = Hit(way, -towards / length, face)
        return nearest

    @cached_property
    def _edges(self) -> tuple[tuple[Point, Point], ...]:
        return tuple(zip(self.corners, (*self.corners[1:], self.corners[0]), strict=True))

    @cached_property
    def _sides(self) -> tuple[tuple[float, float, float, float, float], ...]:
        """Start, extent and length of each edge."""
        return tuple((a[0], a[1], b[0] - a[0], b[1] - a[1], math.dist(a, b)) for a, b in self._edges)


Shape = Disc | Rectangle | Polygon


def _distance_integral(a: Point, b: Point) -> float:
    """Return the integral of the distance from the origin over the triangle from there to an edge, in m3.

    With h the edge's signed distance from the origin, s a place along it from the foot and r = sqrt(s^2 + h^2), it is
    h / 6 (s r + h^2 asinh(s / |h|)) between the ends; negative where the edge goes clockwise.
    """
    length = math.dist(a, b)
    h = _cross(a, b) / length
    if h == 0.0:
        return 0.0
    ends = ((p[0] * (b[0] - a[0]) + p[1] * (b[1] - a[1])) / length for p in (a, b))
    start, end = (s * math.hypot(s, h) + h * h * math.asinh(s / abs(h)) for s in ends)
    return h / 6.0 * (end - start)


def capsule_hit(a: Point, b: Point, radius: float, origin: Point, direction: Point) -> tuple[float, float] | None:
    """Return where a ray enters a capsule from outside: distance in m and cosine of the angle of incidence.

    Args:
        a: middle of one end, in m.
        b: middle of the other end.
        radius: half the capsule's thickness, in m.
        origin: of the ray, in m.
        direction: of the ray, a unit vector.
    """
    (x, y), (d_x, d_y) = origin, direction
    beside, beside_b = d_x * (a[1] - y) - d_y * (a[0] - x), d_x * (b[1] - y) - d_y * (b[0] - x)
    if min(beside, beside_b) > radius or max(beside, beside_b) < -radius:  # most rays pass by
        return None
    e_x, e_y = b[0] - a[0], b[1] - a[1]
    length = math.hypot(e_x, e_y)
    u_x, u_y = e_x / length, e_y / length
    r_x, r_y = x - a[0], y - a[1]
    along, across = r_x * u_x + r_y * u_y, u_x * r_y - u_y * r_x
    d_along, d_across = d_x * u_x + d_y * u_y, u_x * d_y - u_y * d_x
    if d_across != 0.0 and abs(across) > radius:
        way = (math.copysign(radius, across) - across) / d_across
        if way > 0.0 and 0.0 <= along + way * d_along <= length:
            return way, abs(d_across)
    hits = [
        (hit.distance, hit.cosine)
        for end in (a, b)
        if (hit := Disc(radius=radius).intersect(x - end[0], y - end[1], d_x, d_y)) is not None
    ]
    return min(hits, default=None)


def polygon_faults(corners: Sequence[Point], name: str) -> list[str]:
    """Return what is wrong with a polygon's corners: short edges, edges that cross, clockwise order, hardly any area.

    Args:
        corners: in m; edge i goes from corner i to the next one, both counted from 0.
        name: of the parameter that they are from.
    """
    n = len(corners)
    edges = [(corners[i], corners[(i + 1) % n]) for i in range(n)]
    short = [i for i, (a, b) in enumerate(edges) if math.dist(a, b) < _SHORTEST_EDGE]
    if short:
        return [
            f"{name}: edge {i} {_format_edge(edges[i])} must be at least {1e3 * _SHORTEST_EDGE:g} mm long"
            for i in short
        ]
    faults = [
        f"{name}: edge {i} {_format_edge(edges[i])} and edge {j} {_format_edge(edges[j])} "
        f"{'overlap' if _adjacent(i, j, n) else 'cross or touch'}; a polygon's edges must meet at its corners only"
        for i, j in combinations(range(n), 2)
        if _meet_beside_corners(edges[i], edges[j], i, j, n)
    ]
    if faults:
        return faults
    area = Polygon(corners=tuple(corners)).area
    if area < 0.0:
        return [f"{name}: the corners go clockwise; give them counter-clockwise"]
    if area < _LEAST_AREA:
        return [f"{name}: the polygon's area is {1e6 * area:.3g} mm2 and must be at least {1e6 * _LEAST_AREA:g} mm2"]
    return []


def _adjacent(i: int, j: int, n: int) -> bool:
    return j - i in (1, n - 1)


def _meet_beside_corners(one: tuple[Point, Point], other: tuple[Point, Point], i: int, j: int, n: int) -> bool:
    (a, b), (c, d) = one, other
    if _adjacent(i, j, n):  # they share a corner, and may not fold back onto each other
        corner, p, q = (b, a, d) if j == i + 1 else (a, b, c)
        r, s = (p[0] - corner[0], p[1] - corner[1]), (q[0] - corner[0], q[1] - corner[1])
        return abs(_cross(r, s)) <= 1e-9 * math.hypot(*r) * math.hypot(*s) and r[0] * s[0] + r[1] * s[1] > 0.0
    sides = [_side(a, b, c), _side(a, b, d), _side(c, d, a), _side(c, d, b)]
    if sides[0] * sides[1] < 0.0 and sides[2] * sides[3] < 0.0:
        return True
    pairs = ((a, b, c, sides[0]), (a, b, d, sides[1]), (c, d, a, sides[2]), (c, d, b, sides[3]))
    return any(side == 0.0 and _between(p, q, r) for p, q, r, side in pairs)


def _side(a: Point, b: Point, p: Point) -> float:
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


def _between(a: Point, b: Point, p: Point) -> bool:
    return all(min(u, v) <= w <= max(u, v) for u, v, w in zip(a, b, p, strict=True))


def _cross(a: Point, b: Point) -> float:
    return a[0] * b[1] - a[1] * b[0]


def _format_edge(edge: tuple[Point, Point]) -> str:
    return " ".join(f"{word} ({1e3 * x:g}, {1e3 * y:g}) mm" for word, (x, y) in zip(("from", "to"), edge, strict=True))
