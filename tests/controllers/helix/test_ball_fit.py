from collections.abc import Sequence

import cv2
import numpy as np
import pytest

from handover.controllers.helix.vision.ball import BallFinder, Disc
from handover.controllers.helix.vision.ball_fit import BallFit, edges, green_ends, outline_of
from handover.controllers.helix.vision.stereo import BallPosition, Pixels, Region, triangulate
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
    pixels = outline_of(c, p_WO, RADIUS).pixels
    centre = pixels.mean(axis=0)
    return Disc(centre + off, float(np.linalg.norm(pixels - centre, axis=1).mean()), arc)


def fit(cameras: Sequence[Pinhole] = CAMERAS) -> BallFit:
    return BallFit(cameras, RADIUS, 0.1, (0.0, 0.04), 0.012)


def fitted(places: Sequence[Floats], discs: Sequence[Disc | None], near: Floats | None = None) -> BallPosition:
    """Return what is found by two cameras, or three, of which each has the ball at its place."""
    cameras = THREE[: len(places)]
    found = fit(cameras).fit([picture(c, p) for c, p in zip(cameras, places, strict=True)], discs, near)
    assert found is not None
    return found


def test_meeting_point_of_two_rays_is_halfway_between_them():
    for off, atol in ((0.0, 1e-12), (0.004, 4e-4)):
        places = P_WO + np.array([[0, 0, off], [0, 0, -off]])
        p, gap = triangulate(CAMERAS, [c.project(at) for c, at in zip(CAMERAS, places, strict=True)])
        np.testing.assert_allclose(p, P_WO, atol=atol)
        assert gap == pytest.approx(2.0 * off, rel=0.02, abs=1e-12)
    p, gap = triangulate([LEFT, LEFT], [LEFT.project(P_WO)] * 2)
    assert np.isnan(p).all()
    assert gap == np.inf


def test_the_point_nearest_to_three_rays_is_nearer_in_the_mean_of_squares_than_any_beside_it():
    pixels = [c.project(P_WO) + off for c, off in zip(THREE, ([2.0, 1.0], [-1.0, 3.0], [0.0, -2.0]), strict=True)]
    rays = [(c.p_WC, c.rays(pixel[None])[0]) for c, pixel in zip(THREE, pixels, strict=True)]

    def distances(p: Floats) -> Floats:
        return np.array([float(np.linalg.norm(np.cross(p - a, d))) for a, d in rays])

    p, gap = triangulate(THREE, pixels)
    assert gap == pytest.approx(2.0 * distances(p).max())
    beside = [np.sum(distances(p + 1e-4 * d) ** 2) for d in (*np.eye(3), *-np.eye(3))]
    assert np.sum(distances(p) ** 2) < min(beside)


def test_the_outline_is_where_rays_touch_the_sphere():
    """Its slope is that of its pixels but for the lens."""
    for c in CAMERAS:
        outline = outline_of(c, P_WO, RADIUS)
        beside = np.linalg.norm(np.cross(c.rays(outline.pixels), P_WO - c.p_WC), axis=1)
        np.testing.assert_allclose(beside, RADIUS, rtol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(outline.outwards, axis=1), 1.0)
        assert np.all(np.einsum("ij,ij->i", outline.outwards, outline.pixels - c.project(P_WO)) > 15.0)
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


@pytest.mark.parametrize(
    ("off", "start"),
    [((-5.0, 4.0), None), ((0.0, 0.0), 0.002), ((0.0, 0.0), 0.1)],
)
def test_a_rough_start_does_not_show_in_the_position(off: tuple[float, float], start: float | None):
    near = None if start is None else P_WO + np.array([0.0, start, 0.0])
    found = fitted(places=[P_WO] * 2, discs=[disc(c, P_WO, off) for c in CAMERAS], near=near)
    np.testing.assert_allclose(found.p_WO, P_WO, atol=4e-5)
    assert abs(found.shift) < 0.03


@pytest.mark.parametrize(
    "hidden",
    [
        ((-4.0, 5.0), (2.0, 11.0)),  # bars across
        ((-40.0, -3.0), (3.0, 40.0)),  # a side of each is hidden
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
    discs = [disc(c, P_WO, (1.0, 1.0)) if i == side else None for i in range(2)]
    found = fitted(places=[P_WO] * 2, discs=discs)
    axis = (P_WO - c.p_WC) / np.linalg.norm(P_WO - c.p_WC)
    e = found.p_WO - P_WO
    assert np.linalg.norm(e - (axis @ e) * axis) < 4e-5
    assert abs(axis @ e) < 0.002
    depth = np.sqrt(axis @ found.covariance @ axis)
    assert depth == pytest.approx(0.04 * float(c.depth(P_WO)) ** 2 / (RADIUS * 907.0), rel=0.6)  # dz = z^2 / (r f) dr
    assert depth > 10.0 * np.sqrt(np.linalg.eigvalsh(found.covariance)[0])


UP = np.array([0.0, 0.0, 0.05])


def test_pictures_that_contradict_each_other_leave_the_fuller_one():
    discs = [disc(LEFT, P_WO), disc(RIGHT, P_WO + UP, arc=0.5)]
    assert np.linalg.norm(fitted(places=[P_WO, P_WO + UP], discs=discs).p_WO - P_WO) < 0.002


@pytest.mark.parametrize("wrong", [0, 2])
def test_of_three_pictures_the_two_that_agree_count(wrong: int):
    places = [P_WO + UP * (i == wrong) for i in range(3)]
    discs = [disc(c, p) for c, p in zip(THREE, places, strict=True)]
    np.testing.assert_allclose(fitted(places=places, discs=discs).p_WO, P_WO, atol=2e-4)


def test_a_third_picture_narrows_what_two_leave_open():
    two, three = (fitted([P_WO] * n, [disc(c, P_WO) for c in THREE[:n]]) for n in (2, 3))
    np.testing.assert_allclose(three.p_WO, P_WO, atol=4e-5)
    assert np.linalg.eigvalsh(three.covariance)[-1] < 0.5 * np.linalg.eigvalsh(two.covariance)[-1]


def test_nothing_and_something_twice_as_large_are_not_the_ball():
    discs = [disc(c, P_WO) for c in CAMERAS]
    assert fit().fit([picture(c, P_WO, radius=1.8 * RADIUS) for c in CAMERAS], discs) is None
    empty = [np.full((720, 1280, 3), GREY, dtype=np.uint8)] * 2
    assert fit().fit(empty, [None, None]) is None
    assert fit().fit(empty, discs) is None


CENTRE, DISC_RADIUS = np.array([160.3, 121.7]), 20.4


def green_disc(background: tuple[int, int, int] = GREY) -> Pixels:
    """A green disc, drawn at 16 times its size."""
    fine = np.full((240 * 16, 320 * 16, 3), background, dtype=np.uint8)
    at = np.rint((CENTRE + 0.5) * 16 * 16).astype(int).tolist()
    cv2.circle(fine, at, round(DISC_RADIUS * 16 * 16), GREEN, -1, cv2.LINE_8, 4)
    return np.asarray(
        cv2.GaussianBlur(cv2.resize(fine, (320, 240), interpolation=cv2.INTER_AREA), (5, 5), 0.7), np.uint8
    )


def bar(picture: Pixels, start: tuple[int, int], end: tuple[int, int], thickness: int) -> Pixels:
    hidden = np.array(picture)
    cv2.line(hidden, start, end, (40, 40, 40), thickness)
    return hidden


@pytest.mark.parametrize("background", [GREY, (60, 60, 60), (225, 225, 225)])
def test_finds_the_circle_on_any_background(background: tuple[int, int, int]):
    picture = green_disc(background)
    found, r = BallFinder().find(picture, Region.whole(picture)), BallFinder().search(picture)
    assert found is not None
    np.testing.assert_allclose(found.centre, CENTRE, atol=0.6)
    assert (found.radius, found.arc) == (pytest.approx(DISC_RADIUS, abs=1.2), 1.0)
    assert r.x0 < CENTRE[0] - DISC_RADIUS < CENTRE[0] + DISC_RADIUS < r.x1
    assert r.y0 < CENTRE[1] - DISC_RADIUS < CENTRE[1] + DISC_RADIUS < r.y1


@pytest.mark.parametrize(
    ("start", "end", "thickness"),
    [
        ((150, 60), (150, 180), 9),  # across, off the middle
        ((160, 122), (160, 180), 12),  # half way in
        ((140, 60), (140, 180), 16),  # cuts a side off
        ((100, 138), (220, 138), 14),  # cuts the lower part off
    ],
)
def test_what_hides_a_part_does_not_shift_the_circle(start: tuple[int, int], end: tuple[int, int], thickness: int):
    picture = bar(green_disc(), start, end, thickness)
    found = BallFinder().find(picture, Region.whole(picture))
    assert found is not None
    np.testing.assert_allclose(found.centre, CENTRE, atol=1.0)
    assert found.radius == pytest.approx(DISC_RADIUS, abs=1.0)
    assert found.arc < 0.95


def test_the_edge_of_the_region_is_not_the_ball_s_and_a_sliver_is_no_outline():
    found = BallFinder().find(green_disc(), Region(155, 80, 230, 170))
    assert found is not None
    np.testing.assert_allclose(found.centre, CENTRE, atol=1.0)
    assert found.arc < 0.8
    sliver = bar(green_disc(), (157, 60), (157, 180), 41)
    assert BallFinder().find(sliver, Region.whole(sliver)) is None
    assert BallFinder().search(np.full((240, 320, 3), 128, dtype=np.uint8)).empty
