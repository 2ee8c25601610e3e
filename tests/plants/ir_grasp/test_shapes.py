import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.objects import drawn_solid
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


def test_integrals_of_a_polygon_with_a_dent_are_those_over_its_area():
    p = np.random.default_rng(0).uniform(-0.045, 0.045, (200000, 2))
    x, y = p[:, 0], p[:, 1]
    inside = (x > -0.03) & (x < 0.03) & (y > -0.02) & (y < 0.04) & ((x < -0.01) | (y < -0.005))
    assert HOOK.area == pytest.approx(0.09**2 * float(np.mean(inside)), rel=0.01)
    middle = np.mean(p[inside], axis=0, dtype=np.float64)
    np.testing.assert_allclose(HOOK.centroid, middle, atol=2e-4)
    away: Floats = np.linalg.norm(p[inside] - middle, axis=1)
    assert HOOK.radius_of_gyration_squared == pytest.approx(float(np.mean(away**2, dtype=np.float64)), rel=0.01)


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
