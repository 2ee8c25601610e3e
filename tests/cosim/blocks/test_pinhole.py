import cv2
import numpy as np
import pytest

from handover.cosim.blocks.geometry import InvalidCalibration, Pinhole, looking_at, quaternion_of
from handover.cosim.blocks.ports import Floats

P_WC = np.array([-0.95, 0.25, -0.6])
Q_WC = quaternion_of(looking_at(P_WC, np.array([0.0, 0.0, -0.6])))
INTRINSICS = np.array([907.0, 905.0, 638.0, 361.0])
DISTORTION = np.array([0.11, -0.19, 0.0006, -0.0008, 0.05])


def camera() -> Pinhole:
    return Pinhole("left", P_WC, Q_WC, INTRINSICS, DISTORTION)


def points() -> Floats:
    return np.random.default_rng(0).uniform([-0.3, -0.4, -0.9], [0.4, 0.4, -0.3], (200, 3))


def test_projection_is_opencv_s():
    c = camera()
    fx, fy, cx, cy = INTRINSICS
    turn, _ = cv2.Rodrigues(c.R_CW)
    K = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    expected, _ = cv2.projectPoints(points(), turn, -c.R_CW @ P_WC, K, DISTORTION)
    np.testing.assert_allclose(c.project(points()), expected.reshape(-1, 2), atol=1e-9)


def test_slope_is_that_of_central_differences():
    c, h = camera(), 1e-6
    pixels, slope = c.project_with_slope(points())
    np.testing.assert_array_equal(pixels, c.project(points()))
    for i in range(3):
        d = h * np.eye(3)[i]
        expected = (c.project(points() + d) - c.project(points() - d)) / (2 * h)
        np.testing.assert_allclose(slope[:, :, i], expected, atol=1e-5)


def test_rays_go_back_to_the_points():
    c = camera()
    towards = points() - P_WC
    expected = towards / np.linalg.norm(towards, axis=1, keepdims=True)
    np.testing.assert_allclose(c.rays(c.project(points())), expected, atol=1e-12)


def test_what_is_behind_the_camera_has_no_picture():
    assert np.isnan(camera().project(np.array([-1.5, 0.25, -0.6]))).all()


@pytest.mark.parametrize(
    ("quantity", "value"),
    [
        ("q_WC", np.array([1.0, 0.1, 0.0, 0.0])),
        ("intrinsics", np.array([907.0, -1.0, 638.0, 361.0])),
        ("intrinsics", np.array([0.0, 907.0, 638.0, 361.0])),
        ("distortion", np.array([np.nan, 0, 0, 0, 0])),
    ],
)
def test_meaningless_calibration_is_refused(quantity: str, value: Floats):
    given = {"p_WC": P_WC, "q_WC": Q_WC, "intrinsics": INTRINSICS, "distortion": DISTORTION} | {quantity: value}
    with pytest.raises(InvalidCalibration, match=f"'left': {quantity}") as refused:
        Pinhole("left", **given)
    assert refused.value.quantity == quantity
