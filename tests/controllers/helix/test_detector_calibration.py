"""The shifts of corners and edges that pictures tell, against those that the true poses tell."""

import numpy as np
import pytest
from support.controllers.vision_scenes import anywhere

from handover.controllers.helix.vision.ball_edges import edges, outline_of
from handover.controllers.helix.vision.detector_calibration import Shift, TooFewPictures, calibrate_detector
from handover.controllers.helix.vision.markers import MarkerReader, MarkerRing
from handover.controllers.helix.vision.stereo import Pixels
from handover.cosim.blocks.geometry import Pinhole, rotation_of
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.cameras.stereo_camera import Inputs as Scene
from handover.plants.helix.cameras.stereo_camera import Params, StereoCamera

P = Params()
CAMERAS = [
    Pinhole("left", P.p_WC_left, P.q_WC_left, P.intrinsics_left, P.distortion_left),
    Pinhole("right", P.p_WC_right, P.q_WC_right, P.intrinsics_right, P.distortion_right),
]
RING = MarkerRing(P.apothem, P.marker)
Pair = tuple[Pixels, Pixels]


def taken(blur: float, poses: int) -> list[tuple[Scene, Pair]]:
    camera, rng = StereoCamera(Params(blur=blur)), np.random.default_rng(4)
    scenes = [anywhere(rng) for _ in range(poses)]
    pairs = [camera.step(0.0, 1 / 30, u) for u in scenes]
    return [(u, (y.left, y.right)) for u, y in zip(scenes, pairs, strict=True)]


def true_corner_shift(u: Scene, pictures: Pair) -> Floats:
    """How far each corner was found inside of where it truly was, along the diagonal, in px."""
    reader, found = MarkerReader(0.0), [np.empty(0)]
    for camera, picture in zip(CAMERAS, pictures, strict=True):
        markers = reader.read(picture, reader.search(picture))
        outwards = markers.corners - markers.corners.mean(axis=1, keepdims=True)
        outwards = outwards / np.linalg.norm(outwards, axis=2, keepdims=True)
        true = camera.project(u.p_WR + RING.corners[markers.ids] @ np.transpose(rotation_of(u.q_WR)))
        found.append(np.einsum("ijk,ijk->ij", true - markers.corners, outwards).ravel())
    return np.concatenate(found)


def true_edge_shift(u: Scene, pictures: Pair) -> Floats:
    """How far the purest edges were found outside of the ball's true outline, in px."""
    found = edges(pictures, [outline_of(camera, u.p_WO, P.ball_radius) for camera in CAMERAS])
    return found.offset[found.weight > 0.5]


@pytest.mark.parametrize("blur", [pytest.param(0.7, marks=pytest.mark.slow), 1.0])
def test_finds_the_shifts_without_knowing_the_poses(blur: float):
    pictures = taken(blur, 10)
    found = calibrate_detector([pair for _, pair in pictures], CAMERAS, RING, P.ball_radius)
    corner = np.median(np.concatenate([true_corner_shift(u, pair) for u, pair in pictures]))
    edge = np.median(np.concatenate([true_edge_shift(u, pair) for u, pair in pictures]))
    assert found.corner_shift.value == pytest.approx(corner, abs=0.05)
    assert found.edge_shift.value == pytest.approx(edge, abs=0.02)
    assert 0.0 < found.corner_shift.error < 0.03
    assert 0.0 < found.edge_shift.error < 0.01


def test_pictures_that_show_nothing_are_too_few():
    empty = np.zeros((720, 1280, 3), dtype=np.uint8)
    with pytest.raises(TooFewPictures, match="0 pairs of pictures show the marker ring to both cameras; 3 are needed"):
        calibrate_detector([(empty, empty)] * 4, CAMERAS, RING, P.ball_radius)


def test_a_shift_is_told_with_its_error():
    assert str(Shift(0.2114, 0.0123, 14)) == "+0.211 +- 0.012 px, by 14 pairs of pictures"
