import cv2
import numpy as np
import pytest

from handover.controllers.helix.vision.ball import BallFinder
from handover.controllers.helix.vision.stereo import Pixels, Region

GREEN, GREY = (50, 170, 45), (150, 150, 150)
CENTRE, RADIUS = np.array([160.3, 121.7]), 20.4


def disc(background: tuple[int, int, int] = GREY) -> Pixels:
    """A green disc, drawn at 16 times its size."""
    fine = np.full((240 * 16, 320 * 16, 3), background, dtype=np.uint8)
    at = np.rint((CENTRE + 0.5) * 16 * 16).astype(int).tolist()
    cv2.circle(fine, at, round(RADIUS * 16 * 16), GREEN, -1, cv2.LINE_8, 4)
    return np.asarray(
        cv2.GaussianBlur(cv2.resize(fine, (320, 240), interpolation=cv2.INTER_AREA), (5, 5), 0.7), np.uint8
    )


def bar(picture: Pixels, start: tuple[int, int], end: tuple[int, int], thickness: int) -> Pixels:
    hidden = np.array(picture)
    cv2.line(hidden, start, end, (40, 40, 40), thickness)
    return hidden


@pytest.mark.parametrize("background", [GREY, (60, 60, 60), (225, 225, 225)])
def test_finds_the_circle_on_any_background(background: tuple[int, int, int]):
    picture = disc(background)
    found = BallFinder().find(picture, Region.whole(picture))
    assert found is not None
    np.testing.assert_allclose(found.centre, CENTRE, atol=0.6)
    assert found.radius == pytest.approx(RADIUS, abs=1.2)
    assert found.arc == 1.0


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
    picture = bar(disc(), start, end, thickness)
    found = BallFinder().find(picture, Region.whole(picture))
    assert found is not None
    np.testing.assert_allclose(found.centre, CENTRE, atol=1.0)
    assert found.radius == pytest.approx(RADIUS, abs=1.0)
    assert found.arc < 0.95


def test_a_sliver_is_no_outline():
    picture = bar(disc(), (157, 60), (157, 180), 41)
    assert BallFinder().find(picture, Region.whole(picture)) is None


def test_the_edge_of_the_region_is_not_the_ball_s():
    found = BallFinder().find(disc(), Region(155, 80, 230, 170))
    assert found is not None
    np.testing.assert_allclose(found.centre, CENTRE, atol=1.0)
    assert found.arc < 0.8


def test_a_search_encloses_the_disc():
    r = BallFinder().search(disc())
    assert r.x0 < CENTRE[0] - RADIUS < CENTRE[0] + RADIUS < r.x1
    assert r.y0 < CENTRE[1] - RADIUS < CENTRE[1] + RADIUS < r.y1
    assert BallFinder().search(np.full((240, 320, 3), 128, dtype=np.uint8)).empty
