"""A bowl that a ball falls into: its shape, and how the ball rolls in it until it rests. [Vervloet2025] sec. 3.5.3."""

import math
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.origins import assumed, derived
from handover.cosim.blocks.ports import Floats, Vector3, parameter
from handover.cosim.blocks.units import Metre

_ROLLING_TIME = 0.25
"""Time in which a ball that rolls in the bowl loses most of its speed, s (assumed)."""


@dataclass(frozen=True, kw_only=True)
class BowlParameters:
    """What the unit in which a ball falls into the bowl and the one that sees it declare of it."""

    p_WD: Vector3[Metre] = parameter(
        np.array([0.0, -0.16, -0.78]),
        "middle of the bowl's rim in the world, where there is a bowl",
        minimum=-2.0,
        origin=assumed(
            "own choice for the unit by itself, of no effect while bowl_radius is 0; helix_use_case sets it"
        ),
    )
    bowl_radius: Metre = parameter(
        0.0,
        "radius of the bowl's rim; 0: there is no bowl",
        minimum=0.0,
        maximum=1.0,
        origin=derived("secs. 3.5.1 and 3.5.3: only the third experiment has a bowl"),
    )
    bowl_depth: Metre = parameter(
        0.06, "depth of the bowl", minimum=0.001, maximum=1.0, origin=assumed("size of a bowl")
    )


@dataclass(frozen=True)
class Bowl:
    """A bowl that stands still with its rim level: the lower part of a hollow sphere.

    Its inner surface has the radius R = (radius^2 + depth^2) / (2 depth) about a point R - depth above the middle of
    the rim. Of a ball inside, the centre stays within a sphere about the same point whose radius is smaller by the
    ball's.

    Attributes:
        p_WD: middle of the rim, in W, shape (3,), m.
        radius: of the rim, m.
        depth: of the bowl's lowest point below the rim, m; as much as the radius at most.
        ball_radius: of the ball, m; less than the rim's.
    """

    p_WD: Floats
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
        return self.p_WD + np.array([0.0, 0.0, self.sphere_radius - self.depth])

    def crossing(self, p_before: Floats, p_after: Floats) -> Floats | None:
        """Return where a ball whose centre went straight from one point to another fell through the rim's plane.

        The point is in W, shape (3,), m, within the rim or beside it; None if the ball did not fall through the plane.
        """
        height = self.p_WD[2]
        if not p_after[2] < height <= p_before[2]:
            return None
        share = (p_before[2] - height) / (p_before[2] - p_after[2])
        return p_before + share * (p_after - p_before)

    def catches(self, p_before: Floats, p_after: Floats) -> bool:
        """Return whether a ball whose centre went from one point to another came in through the rim's plane."""
        p_WO = self.crossing(p_before, p_after)
        if p_WO is None:
            return False
        beside = (p_WO - self.p_WD)[:2]
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
