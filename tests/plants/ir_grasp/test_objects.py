import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.objects import SOLIDS, Solid, Thing, outlines
from handover.plants.ir_grasp.shapes import Disc, Polygon, Rectangle


def met_of_polygons(thing: Thing, start: tuple[float, float], heading: float) -> float | None:
    """Distance at which a ray crosses an edge of the outlines first."""
    d = np.array([math.cos(heading), math.sin(heading)])
    found: list[float] = []
    for outline in outlines(SOLIDS[thing], points=5000):
        a, b = outline - start, np.roll(outline, -1, axis=0) - start
        edge = b - a
        with np.errstate(divide="ignore", invalid="ignore"):
            det = d[0] * edge[:, 1] - d[1] * edge[:, 0]
            along = (a[:, 0] * edge[:, 1] - a[:, 1] * edge[:, 0]) / det
            across = (a[:, 0] * d[1] - a[:, 1] * d[0]) / det
        found.extend(along[(along > 0.0) & (across >= 0.0) & (across <= 1.0)])
    return min(found, default=None)


@given(st.sampled_from(list(SOLIDS)), st.floats(0.0, 2.0 * math.pi), st.floats(0.07, 0.2), st.floats(-0.08, 0.08))
def test_a_ray_meets_the_outline(thing: Thing, bearing: float, distance: float, aside: float):
    start = (distance * math.cos(bearing), distance * math.sin(bearing))
    heading = bearing + math.pi + math.atan2(aside, distance)
    met, wanted = met_of(thing, *start, heading), met_of_polygons(thing, start, heading)
    if met is None or wanted is None:
        beside = [met_of(thing, *start, heading + turn) for turn in (-1e-3, 1e-3)]
        assert (met is None and wanted is None) or None in beside  # the ray grazes a silhouette
    else:
        assert met[0] == pytest.approx(wanted, abs=1e-5 / max(met[1], 1e-3))
        assert 0.0 < met[1] <= 1.0 + 1e-12


def met_of(thing: Thing, x: float, y: float, heading: float) -> tuple[float, float] | None:
    hit = SOLIDS[thing].intersect(x, y, math.cos(heading), math.sin(heading))
    return None if hit is None else (hit.distance, hit.cosine)


def around(distance: float, cosine: float) -> Any:
    return pytest.approx(np.array([distance, cosine]))


def test_angle_of_incidence_and_the_nearer_part_hides_the_other():
    cylinder, box, cup, r = Thing.CYLINDER, Thing.PAPER_BOX_A, Thing.BABY_CUP_A, 0.033
    for share in (0.0, 0.5, -0.9):
        cosine = math.sqrt(1.0 - share**2)
        assert met_of(cylinder, 0.1, share * r, math.pi) == around(0.1 - r * cosine, cosine)
    assert met_of(box, 0.1, 0.0, math.pi) == around(0.1 - 0.0375, 1.0)
    slanting = met_of(box, 0.0, 0.075, -math.pi / 2.0 + 0.3)
    assert slanting == around(0.05 / math.cos(0.3), math.cos(0.3))
    assert met_of(cup, 0.2, 0.0, math.pi) == around(0.2 - 0.054, 1.0)
    assert met_of(cup, -0.2, 0.0, 0.0) == around(0.2 - 0.035, 1.0)
    assert met_of(cup, 0.045, 0.1, -math.pi / 2.0) == around(0.1 - 0.006, 1.0)


def test_the_outline_reaches_as_far_as_the_solid_and_a_ray_that_points_away_meets_nothing():
    for thing, solid in SOLIDS.items():
        assert np.max(np.linalg.norm(np.vstack(outlines(solid)), axis=1)) == pytest.approx(solid.reach)
        assert met_of(thing, 0.1, 0.0, 0.0) is None
    cup, other = SOLIDS[Thing.BABY_CUP_A], SOLIDS[Thing.BABY_CUP_B]
    assert (cup.yaw - other.yaw, cup.parts) == (pytest.approx(math.pi / 2.0), other.parts)


def mean(x: Floats) -> float:
    return float(np.mean(x, dtype=np.float64))


@pytest.mark.parametrize("shape", [Disc(radius=0.04), Rectangle(low=(-0.04, -0.025), high=(0.04, 0.025))])
def test_gyration_and_friction_arm_are_the_integrals_over_the_shape(shape: Disc | Rectangle):
    p = np.random.default_rng(0).uniform(-0.05, 0.05, (200000, 2))
    distance: Floats = np.linalg.norm(p, axis=1)
    disc = distance < 0.04
    inside = disc if isinstance(shape, Disc) else (np.abs(p[:, 0]) < 0.04) & (np.abs(p[:, 1]) < 0.025)
    solid = Solid(parts=(shape,), yaw=0.0, mass=1.0, reflectivity=1.0)
    assert solid.radius_of_gyration_squared == pytest.approx(mean(distance[inside] ** 2), rel=0.01)
    assert solid.friction_arm == pytest.approx(mean(distance[inside]), rel=0.01)


def test_a_slender_bar_and_a_dented_polygon_have_the_friction_arm_of_their_area():
    bar = Rectangle(low=(0.03, -0.005), high=(0.13, 0.005))
    assert bar.mean_distance == pytest.approx(0.025, rel=0.03)  # a quarter of the length, and a little
    dented = Polygon(corners=((0.04, 0.0), (0.008, 0.006), (0.0, 0.04), (-0.03, 0.0), (0.0, -0.04)))
    corners = dented.corners
    edges = list(zip(corners, (*corners[1:], corners[0]), strict=True))
    p = np.random.default_rng(0).uniform(-0.05, 0.05, (100000, 2))
    inside = np.sum([_crosses(p, a, b) for a, b in edges], axis=0) % 2 == 1
    distance: Floats = np.linalg.norm(p - np.array(dented.centroid), axis=1)
    assert dented.mean_distance == pytest.approx(mean(distance[inside]), rel=0.01)


def _crosses(p: Floats, a: tuple[float, float], b: tuple[float, float]) -> NDArray[np.bool_]:
    """Return of which points a ray along x crosses an edge."""
    x, y = p.T
    return ((a[1] > y) != (b[1] > y)) & (x < a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]))
