from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from handover.controllers.helix.vision.ball import Disc
from handover.controllers.helix.vision.ball_edges import edges, green_ends, outline_of
from handover.controllers.helix.vision.ball_fit import BallFit
from handover.controllers.helix.vision.stereo import Pixels, triangulate
from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.cosim.blocks.ports import Floats

RADIUS = 0.025
P_WO = np.array([0.12, 0.1, -0.63])
GREY, GREEN, DARK = (150, 150, 150), (50, 170, 45), (45, 40, 40)
FINE = 5  # subpixels a pixel, each way
SHOWN = 40  # px around the ball that are painted finely


def camera(name: str, x: float, y: float, z: float) -> Pinhole:
    p_WC = np.array([x, y, z])
    q_WC = quaternion_of(looking_at(p_WC, np.array([0.0, 0.0, -0.6])))
    return Pinhole(name, p_WC, q_WC, np.array([907.0, 907.0, 640.0, 360.0]), np.array([0.1, -0.2, 0.001, 0.0, 0.0]))


LEFT, RIGHT = CAMERAS = [camera("left", -0.95, 0.25, -0.6), camera("right", -0.95, -0.25, -0.6)]
THREE = [*CAMERAS, camera("third", -0.55, 0.0, 0.1)]


def touching(c: Pinhole, p_WO: Floats, radius: float) -> Floats:
    """Pixels where rays touch the sphere."""
    to_ball = p_WO - c.p_WC
    sine2 = radius**2 / (to_ball @ to_ball)
    z = to_ball / np.linalg.norm(to_ball)
    x = np.cross(z, [0.0, 0.0, 1.0])
    x = x / np.linalg.norm(x)
    a = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)[:, None]
    return c.project(
        c.p_WC + (1 - sine2) * to_ball + radius * np.sqrt(1 - sine2) * (np.cos(a) * x + np.sin(a) * np.cross(z, x))
    )


def picture(c: Pinhole, p_WO: Floats, hidden: tuple[float, float] | None = None, radius: float = RADIUS) -> Pixels:
    """A green disc on grey, blurred; a dark upright bar hides the columns between two distances from its middle."""
    x0, y0 = np.rint(c.project(p_WO)).astype(int) - SHOWN
    at = np.asarray(np.arange(2 * SHOWN * FINE) / FINE + 0.5 / FINE - 0.5, dtype=np.float64)
    n = len(at)
    rays = c.rays(np.column_stack([np.tile(x0 + at, n), np.repeat(y0 + at, n)]))
    to_ball = p_WO - c.p_WC
    hits = to_ball @ to_ball - (rays @ to_ball) ** 2 < radius**2
    fine = np.where(hits.reshape(n, n, 1), GREEN, GREY).astype(np.uint8)
    if hidden:
        start, end = (round((SHOWN + d) * FINE) for d in hidden)
        fine[:, start:end] = DARK
    coarse = cv2.resize(fine, (2 * SHOWN, 2 * SHOWN), interpolation=cv2.INTER_AREA)
    whole = np.full((720, 1280, 3), GREY, dtype=np.uint8)
    whole[y0 : y0 + 2 * SHOWN, x0 : x0 + 2 * SHOWN] = coarse
    return np.asarray(cv2.GaussianBlur(whole, (7, 7), 0.7), dtype=np.uint8)


def disc(c: Pinhole, p_WO: Floats, off: tuple[float, float] = (0.0, 0.0), arc: float = 1.0) -> Disc:
    """As which the ball is found, off the true middle, in px."""
    pixels = touching(c, p_WO, RADIUS)
    centre = pixels.mean(axis=0)
    return Disc(centre + off, float(np.linalg.norm(pixels - centre, axis=1).mean()), arc)


def fit(shift: tuple[float, float] = (0.0, 0.04), cameras: Sequence[Pinhole] = CAMERAS) -> BallFit:
    return BallFit(cameras, RADIUS, 0.1, shift, 0.012)


def test_meeting_point_of_two_rays_is_the_point_they_come_from():
    p, gap = triangulate(CAMERAS, [c.project(P_WO) for c in CAMERAS])
    np.testing.assert_allclose(p, P_WO, atol=1e-12)
    assert gap < 1e-12


def test_meeting_point_of_rays_that_miss_is_halfway():
    (a, b) = (c.project(P_WO + d) for c, d in zip(CAMERAS, ([0, 0, 0.004], [0, 0, -0.004]), strict=True))
    p, gap = triangulate(CAMERAS, (a, b))
    np.testing.assert_allclose(p, P_WO, atol=4e-4)
    assert gap == pytest.approx(0.008, rel=0.02)


def test_the_point_nearest_to_three_rays_is_nearer_in_the_mean_of_squares_than_any_beside_it():
    pixels = [c.project(P_WO) + off for c, off in zip(THREE, ([2.0, 1.0], [-1.0, 3.0], [0.0, -2.0]), strict=True)]
    rays = [(c.p_WC, c.rays(pixel[None])[0]) for c, pixel in zip(THREE, pixels, strict=True)]

    def distances(p: Floats) -> Floats:
        return np.array([float(np.linalg.norm(np.cross(p - a, d))) for a, d in rays])

    p, gap = triangulate(THREE, pixels)
    assert gap == pytest.approx(2.0 * distances(p).max())
    beside = [np.sum(distances(p + 1e-4 * d) ** 2) for d in (*np.eye(3), *-np.eye(3))]
    assert np.sum(distances(p) ** 2) < min(beside)


def test_parallel_rays_meet_nowhere():
    c, pixel = LEFT, LEFT.project(P_WO)
    p, gap = triangulate([c, c], [pixel, pixel])
    assert np.isnan(p).all()
    assert gap == np.inf


def test_the_outline_is_where_rays_touch_the_sphere():
    for c in CAMERAS:
        outline = outline_of(c, P_WO, RADIUS)
        to_ball = P_WO - c.p_WC
        beside = np.linalg.norm(np.cross(c.rays(outline.pixels), to_ball), axis=1)
        np.testing.assert_allclose(beside, RADIUS, rtol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(outline.outwards, axis=1), 1.0)
        assert np.all(np.einsum("ij,ij->i", outline.outwards, outline.pixels - c.project(P_WO)) > 15.0)


def test_the_outline_s_slope_is_that_of_its_pixels_but_for_the_lens():
    for c in CAMERAS:
        outline = outline_of(c, P_WO, RADIUS)
        for axis, d in enumerate(1e-4 * np.eye(3)):
            moved = outline_of(c, P_WO + d, RADIUS).pixels - outline_of(c, P_WO - d, RADIUS).pixels
            slope = np.einsum("ij,ij->i", outline.outwards, moved) / 2e-4
            np.testing.assert_allclose(outline.slope[:, axis], slope, atol=0.05 * float(c.f[0]))


def test_edges_are_found_to_a_part_of_a_pixel():
    for c in CAMERAS:
        there = P_WO + 0.0002 * c.R_WC[:, 0]  # a sixth of a pixel to the right
        shown = [picture(c, there)]
        outline = outline_of(c, P_WO, RADIUS)
        moved = outline_of(c, there, RADIUS).pixels - outline.pixels
        expected = np.asarray(np.einsum("ij,ij->i", outline.outwards, moved), dtype=np.float64)
        exact, rough = edges(shown, [outline]), green_ends(shown, [outline])
        assert np.all(exact.weight > 0.3)
        assert np.all(rough.weight == 1.0)
        np.testing.assert_allclose(exact.offset, expected, atol=0.12)
        assert abs(float((exact.offset - expected).mean())) < 0.03
        np.testing.assert_allclose(rough.offset, expected, atol=0.8)


def test_an_edge_of_what_hides_the_ball_does_not_count():
    c = LEFT
    outline = outline_of(c, P_WO, RADIUS)
    found = edges([picture(c, P_WO, (-4.0, 6.0))], [outline])
    beside = outline.pixels[:, 0] - c.project(P_WO)[0]
    hidden = (beside > -4.0) & (beside < 6.0)
    assert np.count_nonzero(hidden) >= 8
    assert np.all(found.weight[hidden] < 0.05)
    assert np.all(found.weight[(beside < -9.0) | (beside > 11.0)] > 0.3)


@pytest.mark.parametrize("off", [(0.0, 0.0), (4.0, -3.0), (-5.0, 4.0)])
def test_a_rough_start_does_not_show_in_the_position(off: tuple[float, float]):
    shown = [picture(c, P_WO) for c in CAMERAS]
    found = fit().fit(shown, [disc(c, P_WO, off) for c in CAMERAS])
    assert found is not None
    np.testing.assert_allclose(found.p_WO, P_WO, atol=4e-5)
    assert abs(found.shift) < 0.03


def test_a_start_nearby_does_not_show_either_and_one_far_off_is_not_taken():
    shown, discs = [picture(c, P_WO) for c in CAMERAS], [disc(c, P_WO) for c in CAMERAS]
    for off in (0.002, 0.1):
        found = fit().fit(shown, discs, P_WO + np.array([0.0, off, 0.0]))
        assert found is not None
        np.testing.assert_allclose(found.p_WO, P_WO, atol=4e-5)


@pytest.mark.parametrize(
    "hidden",
    [
        ((-4.0, 5.0), (2.0, 11.0)),  # bars across
        ((-40.0, -3.0), (3.0, 40.0)),  # a side of each is hidden
        ((12.0, 20.0), (-30.0, 2.0)),
    ],
)
def test_what_hides_a_part_does_not_shift_the_ball(hidden: tuple[tuple[float, float], tuple[float, float]]):
    shown = [picture(c, P_WO, h) for c, h in zip(CAMERAS, hidden, strict=True)]
    found = fit().fit(shown, [disc(c, P_WO, (1.5, 0.5)) for c in CAMERAS])
    assert found is not None
    np.testing.assert_allclose(found.p_WO, P_WO, atol=2e-4)


@pytest.mark.parametrize("side", [0, 1])
def test_one_camera_finds_depth_by_the_ball_s_size(side: int):
    c = CAMERAS[side]
    shown = [picture(c, P_WO) for c in CAMERAS]
    found = fit().fit(shown, [disc(c, P_WO, (1.0, 1.0)) if i == side else None for i in range(2)])
    assert found is not None
    axis = (P_WO - c.p_WC) / np.linalg.norm(P_WO - c.p_WC)
    e = found.p_WO - P_WO
    assert np.linalg.norm(e - (axis @ e) * axis) < 4e-5
    assert abs(axis @ e) < 0.002
    depth = np.sqrt(axis @ found.covariance @ axis)
    assert depth == pytest.approx(0.04 * float(c.depth(P_WO)) ** 2 / (RADIUS * 907.0), rel=0.6)  # dz = z^2 / (r f) dr
    assert depth > 10.0 * np.sqrt(np.linalg.eigvalsh(found.covariance)[0])


def test_pictures_that_contradict_each_other_leave_the_fuller_one():
    shown = [picture(LEFT, P_WO), picture(RIGHT, P_WO + np.array([0.0, 0.0, 0.05]))]
    discs = [disc(LEFT, P_WO), disc(RIGHT, P_WO + np.array([0.0, 0.0, 0.05]), arc=0.5)]
    found = fit().fit(shown, discs)
    assert found is not None
    assert np.linalg.norm(found.p_WO - P_WO) < 0.002


@pytest.mark.parametrize("wrong", [0, 1, 2])
def test_of_three_pictures_the_two_that_agree_count(wrong: int):
    places = [P_WO + np.array([0.0, 0.0, 0.05 * (i == wrong)]) for i in range(3)]
    shown = [picture(c, p) for c, p in zip(THREE, places, strict=True)]
    found = fit(cameras=THREE).fit(shown, [disc(c, p) for c, p in zip(THREE, places, strict=True)])
    assert found is not None
    np.testing.assert_allclose(found.p_WO, P_WO, atol=2e-4)


def test_a_third_picture_narrows_what_two_leave_open():
    shown = [picture(c, P_WO) for c in THREE]
    discs = [disc(c, P_WO) for c in THREE]
    two, three = fit().fit(shown[:2], discs[:2]), fit(cameras=THREE).fit(shown, discs)
    assert two is not None
    assert three is not None
    np.testing.assert_allclose(three.p_WO, P_WO, atol=4e-5)
    assert np.linalg.eigvalsh(three.covariance)[-1] < 0.5 * np.linalg.eigvalsh(two.covariance)[-1]


def test_something_twice_as_large_is_not_the_ball():
    shown = [picture(c, P_WO, radius=1.8 * RADIUS) for c in CAMERAS]
    assert fit().fit(shown, [disc(c, P_WO) for c in CAMERAS]) is None


def test_nothing_seen_is_no_position():
    empty = np.full((720, 1280, 3), GREY, dtype=np.uint8)
    assert fit().fit([empty, empty], [None, None]) is None
    assert fit().fit([empty, empty], [disc(c, P_WO) for c in CAMERAS]) is None
