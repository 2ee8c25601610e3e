"""Calibration of the cameras on corners of a box that somebody clicks on, after [Vervloet2025] sec. 3.2.2."""

from dataclasses import dataclass

import cv2
import numpy as np

from handover.cosim.blocks.geometry import Pinhole, quaternion_of, rotation_by
from handover.cosim.blocks.ports import Floats

MIN_CORNERS = 4
"""Corners that fix a camera's pose; the thesis clicks on six."""


class TooFewCorners(ValueError):
    """A camera sees too few corners of the box for its pose to be known."""

    def __init__(self, camera: str, seen: int) -> None:
        super().__init__(
            f"the {camera} camera sees {seen} corners of the calibration box; its pose takes {MIN_CORNERS} at least"
        )
        self.camera, self.seen = camera, seen


@dataclass(frozen=True)
class CameraPose:
    """Where a camera is found to be.

    Attributes:
        p_WC: position in W, shape (3,), m.
        q_WC: orientation in W, shape (4,), scalar first.
        misfit: RMS distance of the clicked pixels from where the pose puts the corners, px.
    """

    p_WC: Floats
    q_WC: Floats
    misfit: float


def camera_pose(camera: str, clicked: Floats, p_WP: Floats, intrinsics: Floats, distortion: Floats) -> CameraPose:
    """Return a camera's pose by the corners that were clicked on: PnP, refined by Levenberg and Marquardt.

    Args:
        camera: its name, for messages.
        clicked: pixels, shape (n, 2); those of corners that are not seen are NaN.
        p_WP: the same corners in W, shape (n, 3), m.
        intrinsics: f_x, f_y, c_x, c_y, px.
        distortion: k_1, k_2, p_1, p_2, k_3.

    Raises:
        TooFewCorners: fewer than four are seen.
    """
    seen = np.isfinite(clicked).all(axis=1)
    if np.count_nonzero(seen) < MIN_CORNERS:
        raise TooFewCorners(camera, int(np.count_nonzero(seen)))
    points, pixels = p_WP[seen], clicked[seen]
    lens = Pinhole(camera, np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), intrinsics, distortion)
    xy = lens.undistorted(pixels)
    _, turn, shift = cv2.solvePnP(points, xy, np.eye(3), None, flags=cv2.SOLVEPNP_SQPNP)
    turn, shift = cv2.solvePnPRefineLM(points, xy, np.eye(3), None, turn, shift)
    R_CW = rotation_by(np.asarray(turn, dtype=np.float64).ravel())
    p_WC: Floats = -np.transpose(R_CW) @ np.asarray(shift, dtype=np.float64).ravel()
    found = Pinhole(camera, p_WC, quaternion_of(np.transpose(R_CW)), intrinsics, distortion)
    off = np.asarray(found.project(points) - pixels, dtype=np.float64).ravel()
    return CameraPose(p_WC, quaternion_of(np.transpose(R_CW)), float(np.sqrt(off @ off / len(points))))
