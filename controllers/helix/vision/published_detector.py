"""The thesis's own way to find ball and wrist in pictures. [Vervloet2025] sec. 3.2.2 to 3.2.4.

Each picture is looked at by itself, and whole, and each marker gives a pose by itself. What the thesis leaves open is
marked below as assumed. `joint_detector` is this project's own way.
"""

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np

from handover.controllers.helix.vision.ball import SPECK, green_mask
from handover.controllers.helix.vision.markers import DICTIONARY, MarkerRing, Markers, read_markers
from handover.controllers.helix.vision.stereo import BallPosition, Pixels, WristPosition, triangulate
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

_BLUR = 1.4  # px; "the image is blurred", assumed

BALL_DEVIATION = 0.0042
"""Standard deviation of the ball along an axis, in m: 7.3 mm RMS, by tests/benchmarks/test_vision_speed.py."""
WRIST_DEVIATION = 0.028
"""Of the wrist, likewise: 48 mm RMS, most of it the same away from the cameras; 52 mm by one camera."""
GRIPPER_DEVIATION = 0.031
"""Of the gripper, likewise: 54 mm RMS; 57 mm by one camera."""


class PublishedDetector:
    """The smallest circle around what is green, triangulated, and the mean of the poses of single markers.

    The ball is the point nearest to the rays through the middles of both circles (sec. 3.2.2); so a ball that only one
    camera sees is not found; of three cameras, all that see it count (an assumption). The rays may pass each other as
    far as they will: the thesis names no bound.

    Of the ring, each marker in each picture gives a pose by `cv2.solvePnP`; its position, shifted by the apothem along
    its own -z, is the wrist, its y is the direction to the gripper. p_WR is the mean of all positions, and p_WG is p_WR
    + d_gripper d, with d the mean of all directions at unit length, so that eq. (13) holds. One marker is enough, in
    one picture.

    Assumed: markers are read with OpenCV's defaults, without refinement of corners; of the two poses of a flat square,
    that with the smaller misfit counts; green is what the other detector takes for it; the largest patch is the ball. A
    second ring's markers are shifted along their y as well.

    The thesis gives no covariance of a measurement (its filter has fixed ones). Own choice: fixed ones, measured over
    poses in the workspace against the simulation's truth. They are not divided by the number of markers, because
    averaging hardly helps: corners that are not refined lie half a pixel inside, so that each marker looks smaller, and
    5 % farther away, than it is.

    Args:
        cameras: two or more.
        ring: the markers.
        d_gripper: distance of the gripper from the wrist, in m, eq. (13).
    """

    def __init__(self, cameras: Sequence[Pinhole], ring: MarkerRing, d_gripper: float) -> None:
        self._cameras = cameras
        self._ring = ring
        self._d_gripper = d_gripper
        self._reader = cv2.aruco.ArucoDetector(DICTIONARY, cv2.aruco.DetectorParameters())

    def find_ball(self, pictures: Sequence[Pixels]) -> BallPosition | None:
        """Return the ball's position, or None unless two pictures show it before their cameras."""
        found = ((camera, green_middle(p)) for camera, p in zip(self._cameras, pictures, strict=True))
        seen = [(camera, middle) for camera, middle in found if middle is not None]
        if len(seen) < 2:
            return None
        cameras, middles = zip(*seen, strict=True)
        p_WO, _ = triangulate(cameras, middles)
        if not np.isfinite(p_WO).all() or min(float(c.depth(p_WO)) for c in cameras) <= 0.0:
            return None
        return BallPosition(p_WO, BALL_DEVIATION**2 * np.eye(3))

    def find_wrist(self, t: float, pictures: Sequence[Pixels]) -> WristPosition | None:  # noqa: ARG002
        """Return wrist and gripper, or None where no marker is read."""
        positions: list[Floats] = []
        directions: list[Floats] = []
        for camera, picture in zip(self._cameras, pictures, strict=True):
            markers = self._read(picture)
            for k in range(len(markers.ids)):
                p_WR, direction = self._wrist(camera, int(markers.ids[k]), markers.corners[k])
                positions.append(p_WR)
                directions.append(direction)
        d = np.sum(directions, axis=0) if directions else np.zeros(3)
        length = float(np.linalg.norm(d))
        if length == 0.0:
            return None
        p_WR = np.asarray(np.mean(positions, axis=0), dtype=np.float64)
        return WristPosition(
            p_WR,
            p_WR + self._d_gripper * d / length,
            WRIST_DEVIATION**2 * np.eye(3),
            GRIPPER_DEVIATION**2 * np.eye(3),
        )

    def get_state(self) -> Any:
        """Return None: pictures of one time are looked at by themselves."""

    def set_state(self, state: Any) -> None:
        """Restore a state that `get_state` gave."""

    def _read(self, picture: Pixels) -> Markers:
        gray = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        return read_markers(self._reader, gray, len(self._ring.corners))

    def _wrist(self, camera: Pinhole, number: int, corners: Floats) -> tuple[Floats, Floats]:
        """Return p_WR, in m, and the direction to the gripper, each of shape (3,), by one marker's corners, in px."""
        p_RP = self._ring.corners[number]
        middle = p_RP.mean(axis=0)
        half = 0.5 * float(np.linalg.norm(p_RP[1] - p_RP[0]))
        p_MP = half * np.array([[-1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, -1.0, 0.0]])
        xy = camera.undistorted(corners)
        _, turn, shift = cv2.solvePnP(p_MP, xy, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        R_WM = camera.R_WC @ np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
        p_WM = camera.p_WC + camera.R_WC @ np.asarray(shift, dtype=np.float64).ravel()
        apothem, up = float(np.linalg.norm(middle[:2])), -float(middle[2])
        return p_WM - apothem * R_WM[:, 2] + up * R_WM[:, 1], R_WM[:, 1]


def green_middle(picture: Pixels) -> Floats | None:
    """Return the middle, shape (2,), in px, of the smallest circle around the largest green patch, or None."""
    mask = green_mask(np.asarray(cv2.GaussianBlur(picture, (0, 0), _BLUR), dtype=np.uint8))
    contours, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    largest = max(contours, key=cv2.contourArea, default=None)
    if largest is None or cv2.contourArea(largest) < SPECK:
        return None
    middle, _ = cv2.minEnclosingCircle(largest)
    return np.asarray(middle, dtype=np.float64)
