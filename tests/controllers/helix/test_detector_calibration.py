"""The shifts of corners and edges that pictures tell, against those that the true poses tell."""

import math

import numpy as np
import pytest
from support.controllers.vision_scenes import anywhere
from support.wording import Wording

from handover.controllers.helix.vision.ball_fit import edges, outline_of
from handover.controllers.helix.vision.calibration import TooFewCorners, camera_pose
from handover.controllers.helix.vision.detector_calibration import Shift, TooFewPictures, calibrate_detector
from handover.controllers.helix.vision.markers import MarkerReader, MarkerRing
from handover.controllers.helix.vision.stereo import Pixels
from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of, rotation_of
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


def test_finds_the_shifts_without_knowing_the_poses():
    pictures = taken(1.0, 8)
    found = calibrate_detector([pair for _, pair in pictures], CAMERAS, RING, P.ball_radius)
    corner = np.median(np.concatenate([true_corner_shift(u, pair) for u, pair in pictures]))
    edge = np.median(np.concatenate([true_edge_shift(u, pair) for u, pair in pictures]))
    assert found.corner_shift.value == pytest.approx(corner, abs=0.05)
    assert found.edge_shift.value == pytest.approx(edge, abs=0.02)
    assert 0.0 < found.corner_shift.error < 0.03
    assert 0.0 < found.edge_shift.error < 0.01


def test_a_shift_is_reported_with_its_error_and_too_few_pictures_are_refused(wording: Wording):
    wording.check(Shift(0.2114, 0.0123, 14))
    empty = np.zeros((720, 1280, 3), dtype=np.uint8)
    with pytest.raises(TooFewPictures) as caught:
        calibrate_detector([(empty, empty)] * 4, CAMERAS, RING, P.ball_radius)
    wording.check(caught.value)


INTRINSICS, DISTORTION = np.array([907.0, 906.0, 642.5, 357.0]), np.array([0.105, -0.19, 0.0006, -0.0008, 0.06])
P_WC = np.array([-0.95, 0.25, -0.6])
R_WC = looking_at(P_WC, np.array([0.0, 0.0, -0.62]))
NEAR = [[-0.15, 0.15, -0.7], [-0.15, -0.15, -0.7], [-0.15, -0.15, -0.9], [-0.15, 0.15, -0.9]]
CORNERS = np.array([*NEAR, [0.15, 0.15, -0.7], [0.15, -0.15, -0.7]])


def pixels() -> Floats:
    return Pinhole("left", P_WC, quaternion_of(R_WC), INTRINSICS, DISTORTION).project(CORNERS)


def test_the_error_grows_with_the_clicks_noise_and_the_misfit_tells_it():
    rng = np.random.default_rng(0)
    off: dict[float, float] = {}
    for noise in (0.25, 1.0):
        poses = [
            camera_pose("left", pixels() + noise * rng.standard_normal((6, 2)), CORNERS, INTRINSICS, DISTORTION)
            for _ in range(60)
        ]
        off[noise] = math.sqrt(sum(math.dist(p.p_WC, P_WC) ** 2 for p in poses) / len(poses))
        free = np.sqrt(2 * (12 - 6) / 12)  # six of twelve coordinates go into the pose
        assert np.sqrt(np.mean([p.misfit**2 for p in poses])) == pytest.approx(noise * free, rel=0.15)
    assert off[1.0] == pytest.approx(4.0 * off[0.25], rel=0.4)
    assert 0.002 < off[1.0] < 0.02


def test_exact_clicks_give_the_pose_by_four_seen_corners_and_three_are_refused(wording: Wording):
    clicked = pixels()
    for unseen in ([], [0, 5]):
        clicked[unseen] = np.nan
        pose = camera_pose("left", clicked, CORNERS, INTRINSICS, DISTORTION)
        np.testing.assert_allclose(pose.p_WC, P_WC, atol=1e-5)
        np.testing.assert_allclose(rotation_of(pose.q_WC), R_WC, atol=1e-5)
        assert pose.misfit < 1e-3
    clicked[3] = np.nan
    with pytest.raises(TooFewCorners) as caught:
        camera_pose("left", clicked, CORNERS, INTRINSICS, DISTORTION)
    wording.check(caught.value)
