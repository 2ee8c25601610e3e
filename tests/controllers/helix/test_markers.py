import cv2
import numpy as np
import pytest

from handover.controllers.helix.vision.markers import MarkerReader, MarkerRing
from handover.controllers.helix.vision.stereo import Pixels, Region
from handover.cosim.blocks.ports import Floats

H = np.array([[1.4, 0.12, 301.7], [-0.2, 1.35, 222.4], [0.0008, 0.0004, 1.0]])  # mm on the marker to px


def picture(i: int) -> Pixels:
    """Marker i, 20 mm wide, in 4 mm of white, warped by H at 8 times its size, averaged, and blurred."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    marker = np.asarray(cv2.aruco.generateImageMarker(dictionary, i, 120), dtype=np.uint8)
    face = cv2.cvtColor(np.pad(marker, 24, constant_values=255), cv2.COLOR_GRAY2BGR)
    texel = np.array([[1 / 6, 0, -4 + 1 / 12], [0, 1 / 6, -4 + 1 / 12], [0, 0, 1]])  # texture px to mm
    fine = np.array([[8, 0, 3.5], [0, 8, 3.5], [0, 0, 1]])  # px to fine px, middles to middles
    warped = cv2.warpPerspective(face, fine @ H @ texel, (640 * 8, 480 * 8), borderValue=(120, 120, 120))
    return np.asarray(
        cv2.GaussianBlur(cv2.resize(warped, (640, 480), interpolation=cv2.INTER_AREA), (5, 5), 0.7), np.uint8
    )


def corners() -> Floats:
    p = np.array([[0, 0, 1], [20, 0, 1], [20, 20, 1], [0, 20, 1]]) @ np.transpose(H)
    return p[:, :2] / p[:, 2:]


@pytest.mark.parametrize("i", [0, 5])
def test_reads_number_and_corners_to_a_fraction_of_a_pixel(i: int):
    found = MarkerReader(0.21).read(picture(i), Region(270, 190, 350, 270))
    assert found.ids.tolist() == [i]
    np.testing.assert_allclose(found.corners[0], corners(), atol=0.2)
    np.testing.assert_allclose(found.corners[0].mean(axis=0), corners().mean(axis=0), atol=0.06)


def test_the_shift_moves_corners_outwards():
    region = Region(270, 190, 350, 270)
    a, b = (MarkerReader(shift).read(picture(0), region).corners[0] for shift in (0.0, 0.5))
    np.testing.assert_allclose(np.linalg.norm(b - a, axis=1), 0.5)
    assert np.all(np.linalg.norm(b - b.mean(axis=0), axis=1) > np.linalg.norm(a - a.mean(axis=0), axis=1))


def test_other_numbers_are_not_of_the_ring():
    region = Region(270, 190, 350, 270)
    assert not len(MarkerReader(0.21).read(picture(9), region).ids)
    assert MarkerReader(0.21, rings=2).read(picture(9), region).ids.tolist() == [9]
    assert not len(MarkerReader(0.21, rings=2).read(picture(16), region).ids)


def test_the_second_ring_is_the_first_moved_by_a_side_of_the_collar_towards_the_mount():
    one, two = MarkerRing(0.034, 0.020), MarkerRing(0.034, 0.020, rings=2)
    side = 2.0 * 0.034 * np.tan(np.pi / 8)
    np.testing.assert_array_equal(two.corners[:8], one.corners)
    np.testing.assert_allclose(two.corners[8:], one.corners - [0.0, 0.0, side])
    assert one.outline[:, 2].max() == pytest.approx(0.5 * side)
    assert (two.outline[:, 2].min(), two.outline[:, 2].max()) == pytest.approx((-1.5 * side, 0.5 * side))


def test_a_search_finds_the_marker_in_the_whole_picture():
    r = MarkerReader(0.21).search(picture(3))
    low, high = corners().min(axis=0), corners().max(axis=0)
    assert (r.x0 < low[0], r.y0 < low[1], r.x1 > high[0], r.y1 > high[1]) == (True, True, True, True)
    assert MarkerReader(0.21).search(np.full((480, 640, 3), 90, dtype=np.uint8)).empty
