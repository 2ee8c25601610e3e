"""The cameras' poses come from the clicks alone."""

import math

import numpy as np
import pytest

from handover.controllers.helix.vision.calibration import TooFewCorners, camera_pose
from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of, rotation_of
from handover.cosim.blocks.ports import Floats

INTRINSICS, DISTORTION = np.array([907.0, 906.0, 642.5, 357.0]), np.array([0.105, -0.19, 0.0006, -0.0008, 0.06])
P_WC = np.array([-0.95, 0.25, -0.6])
R_WC = looking_at(P_WC, np.array([0.0, 0.0, -0.62]))
NEAR = [[-0.15, 0.15, -0.7], [-0.15, -0.15, -0.7], [-0.15, -0.15, -0.9], [-0.15, 0.15, -0.9]]
CORNERS = np.array([*NEAR, [0.15, 0.15, -0.7], [0.15, -0.15, -0.7]])


def pixels() -> Floats:
    return Pinhole("left", P_WC, quaternion_of(R_WC), INTRINSICS, DISTORTION).project(CORNERS)


def test_exact_clicks_give_the_pose():
    pose = camera_pose("left", pixels(), CORNERS, INTRINSICS, DISTORTION)
    np.testing.assert_allclose(pose.p_WC, P_WC, atol=1e-6)
    np.testing.assert_allclose(rotation_of(pose.q_WC), R_WC, atol=1e-6)
    assert pose.misfit < 1e-3


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


def test_four_seen_corners_are_enough_and_three_are_refused():
    clicked = pixels()
    clicked[[0, 5]] = np.nan
    np.testing.assert_allclose(camera_pose("left", clicked, CORNERS, INTRINSICS, DISTORTION).p_WC, P_WC, atol=1e-5)
    clicked[3] = np.nan
    with pytest.raises(TooFewCorners, match=r"the left camera sees 3 corners of the calibration box; .* 4 at least"):
        camera_pose("left", clicked, CORNERS, INTRINSICS, DISTORTION)
