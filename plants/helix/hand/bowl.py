"""A bowl that a ball falls into: its shape, and how the ball rolls in it until it rests. [Vervloet2025] sec. 3.5.3."""

import math
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.cameras.shapes import Light, PolygonLayer, ShadedLimbs, rods

_ROLLING_TIME = 0.25
"""Time in which a ball that rolls in the bowl loses most of its speed, s (assumed)."""
_WALL = 0.004
"""Thickness of the bowl as it is painted, m."""
_COLOUR = np.array([150.0, 176.0, 196.0])
"""Of the painted bowl: blue, green, red."""
_RINGS, _SEGMENTS = 5, 24
_POST, _METAL = (0.6, 0.012), (86.0, 82.0, 78.0)
"""Length and radius of the post on which the painted bowl stands, m, and its colour."""


@dataclass(frozen=True)
class Bowl:
    """A bowl that stands still with its rim level: the lower part of a hollow sphere.

    Its inner surface has the radius R = (radius^2 + depth^2) / (2 depth) about a point R - depth above the middle of
    the rim. Of a ball inside, the centre stays within a sphere about the same point whose radius is smaller by the
    ball's.

    Attributes:
        p_WB: middle of the rim, in W, shape (3,), m.
        radius: of the rim, m.
        depth: of the bowl's lowest point below the rim, m; as much as the radius at most.
        ball_radius: of the ball, m; less than the rim's.
    """

    p_WB: Floats
    radius: float
    depth: float
    ball_radius: float

    @property
    def sphere_radius(self) -> float:
        """Radius of the inner surface, m."""
        return (self.radius**2 + self.depth**2) / (2.0 * self.depth)

    @property
    def p_WS(self) -> Floats:
        """Middle of the inner surface's sphere, in W, shape (3,), m."""
        return self.p_WB + np.array([0.0, 0.0, self.sphere_radius - self.depth])

    def catches(self, p_before: Floats, p_after: Floats) -> bool:
        """Return whether a ball whose centre went from one point to another came in through the rim's plane."""
        height = self.p_WB[2]
        if not p_after[2] < height <= p_before[2]:
            return False
        share = (p_before[2] - height) / (p_before[2] - p_after[2])
        beside = (p_before + share * (p_after - p_before) - self.p_WB)[:2]
        return math.sqrt(beside @ beside) <= self.radius

    def roll(self, p_WO: Floats, v_WO: Floats, dt: float) -> tuple[Floats, Floats]:
        """Return place and velocity of a ball inside, after a free motion to p_WO with v_WO that took dt.

        Where the centre would be beyond its sphere, it is put back onto it; the velocity outwards is lost (no bounce),
        and along the surface rolling slows it, v' = -v / T.
        """
        beyond = p_WO - self.p_WS
        distance, reach = float(np.linalg.norm(beyond)), self.sphere_radius - self.ball_radius
        if distance <= reach:
            return p_WO, v_WO
        outwards = beyond / distance
        along = v_WO - max(float(v_WO @ outwards), 0.0) * outwards
        return self.p_WS + reach * outwards, along * math.exp(-dt / _ROLLING_TIME)

    def profile(self, points: int) -> Floats:
        """Return the inner surface's radius and height in W from the lowest point to the rim, shape (points, 2), m."""
        half_angle = math.atan2(self.radius, self.sphere_radius - self.depth)
        angle = np.linspace(0.0, half_angle, points)
        return np.column_stack([self.sphere_radius * np.sin(angle), self.p_WS[2] - self.sphere_radius * np.cos(angle)])


def paint(bowl: Bowl, camera: Pinhole, light: Light) -> list[PolygonLayer]:
    """Return the bowl's inside and its outside as far as they face a camera: what lies in it is painted between."""
    profile = bowl.profile(_RINGS + 1)
    angle = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS + 1)
    round_z = np.stack([np.cos(angle), np.sin(angle), np.zeros(_SEGMENTS + 1)], axis=1)
    depth = float(camera.depth(bowl.p_WB))
    foot = np.array([*bowl.p_WB[:2], float(profile[0, 1])])
    post = rods(
        np.array([[foot, foot - np.array([0.0, 0.0, _POST[0]])]]), np.array([[_POST[1]] * 2]), np.array([_METAL])
    )
    pixels, depths = camera.project(post.points), camera.depth(post.points)
    layers = ShadedLimbs([camera], light).polygons(post, pixels[None], depths[None])
    for facing, wall in ((-1.0, 0.0), (1.0, _WALL)):
        radii, heights = (
            profile[:, 0] * (1.0 + wall / bowl.radius),
            profile[:, 1] - wall * (1.0 - profile[:, 0] / bowl.radius),
        )
        points = radii[:, None, None] * round_z + heights[:, None, None] * np.array([0.0, 0.0, 1.0])
        points = points + np.array([bowl.p_WB[0], bowl.p_WB[1], 0.0])
        quads = np.stack([points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]], axis=2).reshape(-1, 4, 3)
        middles = quads.mean(axis=1)
        normals = facing * (middles - bowl.p_WS)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        seen = np.einsum("ij,ij->i", camera.p_WC - middles, normals) > 0.0
        depths = np.full(np.count_nonzero(seen), depth - facing * bowl.radius)
        colours = light.shade(normals[seen])[:, None] * _COLOUR
        layers.append(PolygonLayer(depths, camera.project(quads[seen]), colours, np.full(len(depths), True)))
    return layers
