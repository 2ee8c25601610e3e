"""Shapes of objects: where rays meet them, integrals over them, and polygons that are none."""

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.objects import SOLIDS, Thing, drawn_solid, outlines
from handover.plants.ir_grasp.pymunk_edge import convex_parts
from handover.plants.ir_grasp.shapes import Disc, Point, Polygon, Rectangle, capsule_hit, polygon_faults

HOOK = Polygon(corners=((-0.03, -0.02), (0.03, -0.02), (0.03, -0.005), (-0.01, -0.005), (-0.01, 0.04), (-0.03, 0.04)))
"""A polygon with a dent."""


def test_a_polygon_with_the_corners_of_a_rectangle_is_that_rectangle():
    rectangle = Rectangle(low=(-0.03, -0.01), high=(0.05, 0.02))
    polygon = Polygon(corners=tuple(rectangle.corners))
    assert polygon.area == pytest.approx(rectangle.area)
    assert polygon.centroid == pytest.approx(rectangle.centroid)
    assert polygon.radius_of_gyration_squared == pytest.approx(rectangle.radius_of_gyration_squared)
    assert polygon.reach == pytest.approx(rectangle.reach)
    for bearing in np.linspace(0.0, 6.2, 40):
        x, y = 0.01 + 0.2 * math.cos(bearing), 0.2 * math.sin(bearing)
        for aside in (-0.15, 0.0, 0.1):
            d = (math.cos(bearing + math.pi + aside), math.sin(bearing + math.pi + aside))
            one, other = rectangle.intersect(x, y, *d), polygon.intersect(x, y, *d)
            assert (one is None) == (other is None)
            if one is not None and other is not None:
                assert other == pytest.approx(one)


@pytest.mark.parametrize(
    ("shape", "boxes"),
    [
        (Disc(radius=0.04), []),
        (Rectangle(low=(-0.04, -0.02), high=(0.02, 0.02)), [((-0.04, -0.02), (0.02, 0.02))]),
        (HOOK, [((-0.03, -0.02), (0.03, -0.005)), ((-0.03, -0.02), (-0.01, 0.04))]),
    ],
    ids=["disc", "rectangle", "hook"],
)
def test_integrals_of_a_shape_are_those_over_its_area(
    shape: Disc | Rectangle | Polygon, boxes: list[tuple[Point, Point]]
):
    p: Floats = np.random.default_rng(0).uniform(-0.045, 0.045, (200000, 2))
    within = [np.all((p > low) & (p < high), axis=1) for low, high in boxes]
    p = p[np.any(within, axis=0) if boxes else np.linalg.norm(p, axis=1) < 0.04]
    assert shape.area == pytest.approx(0.09**2 * len(p) / 200000, rel=0.01)
    middle = np.mean(p, axis=0, dtype=np.float64)
    np.testing.assert_allclose(shape.centroid, middle, atol=2e-4)
    away: Floats = np.linalg.norm(p - middle, axis=1)
    assert shape.radius_of_gyration_squared == pytest.approx(float(np.mean(away**2)), rel=0.01)
    assert shape.mean_distance == pytest.approx(float(np.mean(away)), rel=0.01)


def test_a_slender_bar_has_the_friction_arm_of_a_line():
    bar = Rectangle(low=(0.03, -0.005), high=(0.13, 0.005))
    assert bar.mean_distance == pytest.approx(0.025, rel=0.03)  # a quarter of the length, and a little


def test_a_ray_into_a_dent_meets_what_is_nearer():
    assert HOOK.intersect(0.02, 0.1, 0.0, -1.0) == pytest.approx((0.105, 1.0, 2))
    assert HOOK.intersect(0.1, 0.02, -1.0, 0.0) == pytest.approx((0.11, 1.0, 3))
    assert HOOK.intersect(0.1, -0.01, -1.0, 0.0) == pytest.approx((0.07, 1.0, 1))
    assert HOOK.intersect(0.02, 0.1, 0.0, 1.0) is None


def test_convex_parts_make_up_the_polygon():
    solids = [drawn_solid(seed).parts[0] for seed in range(60)]
    for polygon in (HOOK, *(s for s in solids if isinstance(s, Polygon))):
        parts = [Polygon(corners=tuple(part)) for part in convex_parts(polygon.corners)]
        assert sum(part.area for part in parts) == pytest.approx(polygon.area)
        for part in parts:
            corners = [*part.corners, *part.corners[:2]]
            turns = [
                (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
                for (a, b), (_, c) in zip(pairwise(corners), pairwise(corners[1:]), strict=False)
            ]
            assert min(turns) > -1e-12


def test_faces_are_eighths_of_a_disc_and_edges_by_their_first_corner():
    disc, rectangle = Disc(radius=0.03), Rectangle(low=(-0.02, -0.01), high=(0.02, 0.01))
    eighths = [(math.cos(k), math.sin(k)) for k in (np.arange(8) + 0.5) * math.pi / 4.0]
    for shape, ways in ((disc, eighths), (rectangle, [(0.0, -1.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0)])):
        hits = [shape.intersect(0.1 * x, 0.1 * y, -x, -y) for x, y in ways]
        assert [hit and hit.face for hit in hits] == list(range(len(ways)))


@given(st.floats(-0.1, 0.1), st.floats(-0.1, 0.1), st.floats(0.0, 6.28))
def test_a_ray_enters_a_capsule_where_its_distance_from_the_axis_is_the_radius(x: float, y: float, heading: float):
    a, b, radius = (-0.02, 0.0), (0.03, 0.02), 0.008

    def away(p: Floats) -> Floats:
        e, r = np.subtract(b, a), np.subtract(p, a)
        return np.linalg.norm(r - np.clip(r @ e / (e @ e), 0.0, 1.0)[..., None] * e, axis=-1)

    assume(away(np.array((x, y))) > radius + 1e-6)
    d = (math.cos(heading), math.sin(heading))
    along = away(np.array((x, y)) + np.linspace(0.0, 0.3, 3001)[:, None] * np.array(d))
    hit = capsule_hit(a, b, radius, (x, y), d)
    if hit is None:
        assert np.min(along) > radius - 1e-5
    else:
        assert away(np.array((x, y)) + hit[0] * np.array(d)) == pytest.approx(radius, abs=1e-9)
        inside = np.flatnonzero(along < radius)
        assert not len(inside) or hit[0] == pytest.approx(inside[0] * 1e-4, abs=1.1e-4)
        assert 0.0 <= hit[1] <= 1.0 + 1e-12


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (40, 40), (40, 0), (0, 40)],
        [(0, 0), (40, 0), (40, 30), (20, 0), (0, 30)],
        [(0, 0), (40, 0), (20, 0), (20, 30)],
        [(0, 0), (0, 40), (40, 40), (40, 0)],
        [(0, 0), (40, 0), (40.5, 1), (0, 40)],
        [(0, 0), (40, 0), (20, 3)],
    ],
    ids=["crossed", "touching", "overlapping", "clockwise", "short edge", "small"],
)
def test_corners_that_make_no_polygon_are_refused_with_what_crosses(corners: list[Point], wording: Wording):
    wording.check(polygon_faults([(1e-3 * x, 1e-3 * y) for x, y in corners], "corners")[0])


def test_simple_polygons_are_accepted():
    drawn = [drawn_solid(seed).parts[0] for seed in range(60)]
    for shape in (HOOK, *(s for s in drawn if isinstance(s, Polygon))):
        assert polygon_faults(shape.corners, "corners") == []


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
