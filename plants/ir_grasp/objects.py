"""The objects on the table of the grasp scene, seen from above: shapes, poses, masses, reflectivities."""

import enum
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from handover.cosim.blocks.ports import Floats


class Thing(enum.IntEnum):
    """An object of [Luberto] sec. V-A in one of its reference poses, the last letter."""

    CYLINDER = 0
    BABY_CUP_A = 1
    BABY_CUP_B = 2
    PAPER_BOX_A = 3
    PAPER_BOX_B = 4


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A circle about the origin of O, its radius in m."""

    radius: float

    @property
    def reach(self) -> float:
        """Largest distance of a point of it from the origin of O, in m."""
        return self.radius

    def intersect(self, x: float, y: float, d_x: float, d_y: float) -> tuple[float, float] | None:
        """Return where a ray from (x, y) in O along the unit vector d enters: distance and cosine of incidence."""
        middle = -(x * d_x + y * d_y)
        half_2 = self.radius**2 - x * x - y * y + middle * middle
        if half_2 <= 0.0:
            return None
        half = math.sqrt(half_2)
        return (middle - half, half / self.radius) if middle > half else None


@dataclass(frozen=True, kw_only=True)
class Slab:
    """A rectangle along the axes of O: from `low` to `high`, in m."""

    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def corners(self) -> list[tuple[float, float]]:
        """The four corners, counter-clockwise."""
        (x_0, y_0), (x_1, y_1) = self.low, self.high
        return [(x_0, y_0), (x_1, y_0), (x_1, y_1), (x_0, y_1)]

    @property
    def reach(self) -> float:
        """Largest distance of a point of it from the origin of O, in m."""
        return max(math.hypot(x, y) for x, y in self.corners)

    def intersect(self, x: float, y: float, d_x: float, d_y: float) -> tuple[float, float] | None:
        """Return where a ray from (x, y) in O along the unit vector d enters: distance and cosine of incidence."""
        enters, leaves, cosine = 0.0, math.inf, 0.0
        for at, along, low, high in ((x, d_x, self.low[0], self.high[0]), (y, d_y, self.low[1], self.high[1])):
            if along == 0.0:
                if not low <= at <= high:
                    return None
                continue
            near, far = (low, high) if along > 0.0 else (high, low)
            if (near - at) / along > enters:
                enters, cosine = (near - at) / along, abs(along)
            leaves = min(leaves, (far - at) / along)
        return (enters, cosine) if 0.0 < enters < leaves else None


@dataclass(frozen=True, kw_only=True)
class Solid:
    """An object in its frame O.

    Attributes:
        parts: convex shapes whose union it is; the first one carries the mass.
        yaw: orientation of O on the table that belongs to the pose, in rad.
        mass: in kg.
        reflectivity: infrared intensity it returns, over that of the surface the sensors were characterised with.
    """

    parts: tuple[Disc | Slab, ...]
    yaw: float
    mass: float
    reflectivity: float

    @property
    def gyration(self) -> float:
        """Squared radius of gyration of the first part about the origin of O, in m2."""
        body = self.parts[0]
        if isinstance(body, Disc):
            return body.radius**2 / 2.0
        return sum((high - low) ** 2 for low, high in zip(body.low, body.high, strict=True)) / 12.0

    @property
    def friction_arm(self) -> float:
        """Lever arm of table friction that turns: 2 R / 3 of a disc with the first part's area, in m."""
        body = self.parts[0]
        if isinstance(body, Disc):
            return 2.0 * body.radius / 3.0
        area = (body.high[0] - body.low[0]) * (body.high[1] - body.low[1])
        return 2.0 / 3.0 * math.sqrt(area / math.pi)

    @property
    def reach(self) -> float:
        """Largest distance of a point of it from the origin of O, in m."""
        return max(p.reach for p in self.parts)

    def intersect(self, x: float, y: float, d_x: float, d_y: float) -> tuple[float, float] | None:
        """Return what a ray meets first from outside: its distance in m and the cosine of the angle of incidence.

        Args:
            x: where the ray starts, in O, in m.
            y: likewise.
            d_x: of the ray's direction in O, a unit vector.
            d_y: likewise.
        """
        nearest: tuple[float, float] | None = None
        for part in self.parts:
            hit = part.intersect(x, y, d_x, d_y)
            if hit is not None and (nearest is None or hit < nearest):
                nearest = hit
        return nearest


_CUP: Final = (Disc(radius=0.035), Slab(low=(0.030, -0.006), high=(0.054, 0.006)))
_BOX: Final = (Slab(low=(-0.0375, -0.025), high=(0.0375, 0.025)),)

SOLIDS: Final = {
    Thing.CYLINDER: Solid(parts=(Disc(radius=0.033),), yaw=0.0, mass=0.15, reflectivity=0.9),
    Thing.BABY_CUP_A: Solid(parts=_CUP, yaw=math.pi / 2.0, mass=0.10, reflectivity=0.8),
    Thing.BABY_CUP_B: Solid(parts=_CUP, yaw=0.0, mass=0.10, reflectivity=0.8),
    Thing.PAPER_BOX_A: Solid(parts=_BOX, yaw=0.0, mass=0.12, reflectivity=1.0),
    Thing.PAPER_BOX_B: Solid(parts=_BOX, yaw=math.pi / 2.0, mass=0.12, reflectivity=1.0),
}
"""All assumed: [Luberto] shows the objects in photographs only.

Cup: handle along x of O; in pose A it points to the side, along y of W, in pose B away along x. Box: its long side lies
along x of W in pose A and along y in pose B. A hand whose yaw is 0 comes along x of W.
"""


def outlines(thing: Thing, points: int = 48) -> list[Floats]:
    """Return the outline of each part of a thing, closed polygons (n, 2) in O, in m; circles have `points` corners.

    In W: p_WO + R(yaw_O) times a corner, with the scene's outputs p_WO and yaw_O.
    """
    angles = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return [p.radius * circle if isinstance(p, Disc) else np.array(p.corners) for p in SOLIDS[thing].parts]
