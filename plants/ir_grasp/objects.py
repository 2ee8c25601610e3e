"""The objects on the table of the grasp scene, seen from above: shapes, poses, masses, reflectivities."""

import enum
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.shapes import Disc, Hit, Point, Polygon, Rectangle, Shape

MAX_CORNERS: Final = 8
"""Corners of a polygon at most, and faces of an object."""


class Thing(enum.IntEnum):
    """What stands on the table.

    The first five are the objects of [Luberto] sec. V-A in one of their reference poses, the last letter. The others
    are given by parameters, or drawn from a family by a seed (`drawn_solid`).
    """

    CYLINDER = 0
    BABY_CUP_A = 1
    BABY_CUP_B = 2
    PAPER_BOX_A = 3
    PAPER_BOX_B = 4
    DISC = 5
    BAR = 6
    POLYGON = 7
    DRAWN = 8


_EVEN = (1.0,) * MAX_CORNERS


@dataclass(frozen=True, kw_only=True)
class Solid:
    """An object in its frame O.

    Attributes:
        parts: shapes whose union it is; the first one carries the mass.
        yaw: orientation of O on the table that belongs to the pose, in rad.
        mass: in kg.
        reflectivity: infrared intensity it returns, over that of the surface the sensors were characterised with.
        faces: factors of the reflectivity by face of each part (`Hit.face`), 8.
        mass_offset: of the centre of mass from the first part's centroid, in O, in m.
    """

    parts: tuple[Shape, ...]
    yaw: float
    mass: float
    reflectivity: float
    faces: tuple[float, ...] = _EVEN
    mass_offset: Point = (0.0, 0.0)

    @property
    def centre_of_mass(self) -> Point:
        """Centre of mass, in O, in m. The table's pressure has its middle there, too."""
        x, y = self.parts[0].centroid
        return x + self.mass_offset[0], y + self.mass_offset[1]

    @property
    def radius_of_gyration_squared(self) -> float:
        """Squared radius of gyration about the centre of mass, in m2: that of the first part, if it were uniform."""
        return self.parts[0].radius_of_gyration_squared

    @property
    def friction_arm(self) -> float:
        """Lever arm of table friction about the vertical, in m: the mean distance of the first part's points.

        So the torque is that of even pressure on an object that turns about the middle of its first part.
        """
        return self.parts[0].mean_distance

    @cached_property
    def reach(self) -> float:
        """Largest distance of a point of it from the origin of O, in m."""
        return max(p.reach for p in self.parts)

    def intersect(self, x: float, y: float, d_x: float, d_y: float) -> Hit | None:
        """Return what a ray meets first from outside.

        Args:
            x: where the ray starts, in O, in m.
            y: likewise.
            d_x: of the ray's direction in O, a unit vector.
            d_y: likewise.
        """
        nearest: Hit | None = None
        for part in self.parts:
            hit = part.intersect(x, y, d_x, d_y)
            if hit is not None and (nearest is None or hit < nearest):
                nearest = hit
        return nearest


_CUP: Final = (Disc(radius=0.035), Rectangle(low=(0.030, -0.006), high=(0.054, 0.006)))
_BOX: Final = (Rectangle(low=(-0.0375, -0.025), high=(0.0375, 0.025)),)

SOLIDS: Final = {
    Thing.CYLINDER: Solid(parts=(Disc(radius=0.033),), yaw=0.0, mass=0.15, reflectivity=0.9),
    Thing.BABY_CUP_A: Solid(parts=_CUP, yaw=math.pi / 2.0, mass=0.10, reflectivity=0.8),
    Thing.BABY_CUP_B: Solid(parts=_CUP, yaw=0.0, mass=0.10, reflectivity=0.8),
    Thing.PAPER_BOX_A: Solid(parts=_BOX, yaw=0.0, mass=0.12, reflectivity=1.0),
    Thing.PAPER_BOX_B: Solid(parts=_BOX, yaw=math.pi / 2.0, mass=0.12, reflectivity=1.0),
}
"""The objects of [Luberto] in their poses. All assumed: the paper shows them in photographs only.

Cup: handle along x of O; in pose A it points to the side, along y of W, in pose B away along x. Box: its long side lies
along x of W in pose A and along y in pose B. A hand whose yaw is 0 comes along x of W.
"""

AREAL_DENSITY: Final = 40.0
"""Mass over area of an object whose mass is not given, in kg/m2 (assumed): about that of cylinder and box above."""

_PLAIN = 0.9
"""Reflectivity of an object that is given by its shape alone (assumed): the cylinder's."""


def solid_of(
    thing: Thing,
    *,
    disc_radius: float = 0.033,
    bar_size: Floats | None = None,
    corners: Floats | None = None,
    corner_count: int = 0,
    thing_seed: int = 0,
) -> Solid:
    """Return an object by its name, and what its kind needs besides.

    Args:
        thing: which one.
        disc_radius: of `DISC`, in m.
        bar_size: length along x of O and width of `BAR`, (2,), in m.
        corners: of `POLYGON`, (8, 2) in O, in m, counter-clockwise, of which the first `corner_count` count.
        corner_count: see there.
        thing_seed: which one of `DRAWN`.
    """
    if thing is Thing.DISC:
        return _plain(Disc(radius=disc_radius))
    if thing is Thing.BAR:
        length, width = (0.11, 0.03) if bar_size is None else bar_size.tolist()
        return _plain(Rectangle(low=(-length / 2.0, -width / 2.0), high=(length / 2.0, width / 2.0)))
    if thing is Thing.POLYGON:
        return _plain(Polygon(corners=polygon_corners(np.zeros((0, 2)) if corners is None else corners, corner_count)))
    return drawn_solid(thing_seed) if thing is Thing.DRAWN else SOLIDS[thing]


def polygon_corners(corners: Floats, count: int) -> tuple[Point, ...]:
    """Return the corners that count as pairs."""
    return tuple((float(x), float(y)) for x, y in corners[:count])


def drawn_solid(seed: int) -> Solid:
    """Return the object of a family that a seed draws.

    A disc of 15 to 47 mm radius, a bar of 50 to 110 mm by 20 to 50 mm, or a polygon of 5 to 8 corners that are 20 to 45
    mm from its middle and may be dents, each with a probability of 1/3; turned by any angle; of 0.05 to 0.3 kg, its
    centre of mass up to 5 mm off in each axis; of reflectivity 0.3 to 1.5, by face 0.7 to 1.3 times that. All uniform,
    and all assumed.

    Objects of odd seeds are kept from all tuning (`is_held_out`).
    """
    rng = np.random.default_rng([seed, 0x0B1EC7])
    kind = int(rng.integers(3))
    shape: Shape
    if kind == 0:
        shape = Disc(radius=float(rng.uniform(0.015, 0.047)))
    elif kind == 1:
        half_length, half_width = float(rng.uniform(0.025, 0.055)), float(rng.uniform(0.010, 0.025))
        shape = Rectangle(low=(-half_length, -half_width), high=(half_length, half_width))
    else:
        n = int(rng.integers(5, MAX_CORNERS + 1))
        angles = 2.0 * math.pi * (np.arange(n) + rng.uniform(-0.25, 0.25, n)) / n
        radii = rng.uniform(0.020, 0.045, n)
        shape = Polygon(corners=polygon_corners(radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)]), n))
    return Solid(
        parts=(shape,),
        yaw=float(rng.uniform(-math.pi, math.pi)),
        mass=float(rng.uniform(0.05, 0.3)),
        reflectivity=float(rng.uniform(0.3, 1.5)),
        faces=tuple(rng.uniform(0.7, 1.3, MAX_CORNERS).tolist()),
        mass_offset=(float(rng.uniform(-0.005, 0.005)), float(rng.uniform(-0.005, 0.005))),
    )


def is_held_out(seed: int) -> bool:
    """Return whether the object that a seed draws is kept from all tuning: those of odd seeds are."""
    return seed % 2 == 1


def outlines(solid: Solid, points: int = 48) -> list[Floats]:
    """Return the outline of each part of an object, closed polygons (n, 2) in O, in m; circles have `points` corners.

    In W: p_WO + R(yaw_O) times a corner, with the scene's outputs p_WO and yaw_O.
    """
    angles = np.linspace(0.0, 2.0 * math.pi, points, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    return [p.radius * circle if isinstance(p, Disc) else np.array(p.corners) for p in solid.parts]


def placed(solid: Solid, p_WO: Floats, yaw: float) -> list[Floats]:
    """Return the outlines of an object that is at p_WO, (2,) in m, with O turned by yaw, in rad: (n, 2) in W."""
    R_WO: Floats = np.array([[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]])
    return [p_WO + outline @ np.transpose(R_WO) for outline in outlines(solid)]


def _plain(shape: Shape) -> Solid:
    return Solid(parts=(shape,), yaw=0.0, mass=AREAL_DENSITY * abs(shape.area), reflectivity=_PLAIN)


def with_own(solid: Solid, mass: float, reflectivity: float, faces: Floats, mass_offset: Floats) -> Solid:
    """Return an object with mass (kg) and reflectivity replaced where not 0, faces and mass offset (m) changed."""
    return replace(
        solid,
        mass=mass or solid.mass,
        reflectivity=reflectivity or solid.reflectivity,
        faces=tuple((np.array(solid.faces) * faces).tolist()),
        mass_offset=(solid.mass_offset[0] + float(mass_offset[0]), solid.mass_offset[1] + float(mass_offset[1])),
    )
