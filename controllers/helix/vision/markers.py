"""The wrist's ring of fiducial markers, and how markers are found in a picture, after [Vervloet2025] sec. 3.2.4."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from handover.controllers.helix.vision.stereo import Pixels, Region
from handover.cosim.blocks.ports import Floats

SIDES = 8
DICTIONARY = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)

_ZOOM = 3  # enlargement of a region; corners of enlarged markers come out twice as exact
_SEARCH_WINDOW = 7  # px, of the threshold; finds a marker of 10 px and more, at half the cost of two windows
_SMALLEST = 0.1  # perimeter over the larger side of a region; a ring that a region just holds has markers of twice that
_NEAR = 4.0  # marker sides around the largest marker found; the ring is smaller than that
_NEAR_A_RING = 1.5  # more of them for each further ring


class MarkerRing:
    """Eight ArUco markers around z_R, number i at i * 45 degrees from x_R towards y_R, middles in the plane z_R = 0.

    A second ring, markers 8 to 15, sits above the first, towards the mount: marker i + 8 one side of the collar, that
    is 2 apothem tan(22.5 degrees), from marker i along -z_R.

    Marker i's frame M has z out of its face, y along z_R (towards the gripper) and x = y x z; its printed top is at
    +y_M. Shifting a marker along -z_M by the apothem gives the wrist, and from there along y_M the gripper.

    Attributes:
        corners: shape (8 rings, 4, 3), in R, in m: upper left, upper right, lower right, lower left as printed.
        outline: shape (16, 3), in R, in m: corners of the box around all markers, with the margin they are printed in.

    Args:
        apothem: distance of the markers from the axis, in m.
        marker: side of a marker, in m.
        rings: 1 or 2.
    """

    def __init__(self, apothem: float, marker: float, rings: int = 1) -> None:
        angle = np.arange(SIDES) * 2.0 * np.pi / SIDES
        z_RM = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)])
        x_RM = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(SIDES)])
        square = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])
        flat = square[:, :1] * x_RM[:, None] + square[:, 1:] * np.array([0.0, 0.0, 1.0])
        half = apothem * np.tan(np.pi / SIDES)
        first = apothem * z_RM[:, None] + 0.5 * marker * flat
        up = np.array([0.0, 0.0, -2.0 * half])
        self.corners = np.concatenate([first + k * up for k in range(rings)])
        low, high = (apothem * z_RM + half * flat[:, i] for i in (0, 3))  # flat's first corner is at +z_R
        self.outline = np.stack([low, high + (rings - 1) * up], axis=1).reshape(-1, 3)


@dataclass(frozen=True)
class Markers:
    """Numbers, shape (n,), each once, and corners, shape (n, 4, 2), in px, in the order of `MarkerRing.corners`."""

    ids: NDArray[np.int64]
    corners: Floats


NO_MARKERS = Markers(np.empty(0, dtype=np.int64), np.empty((0, 4, 2)))


class MarkerReader:
    """Reads ArUco markers 0 to 7, or 15, of DICT_4X4_50.

    Args:
        shift: how far refined corners come out inside of the printed ones, along the diagonal, in px: blur rounds the
            corners off.
        rings: of markers, 1 or 2.
    """

    def __init__(self, shift: float, rings: int = 1) -> None:
        self._shift = shift
        self._numbers = SIDES * rings
        self._near = _NEAR + _NEAR_A_RING * (rings - 1)
        self._coarse = _detector(_SEARCH_WINDOW, refined=False)
        self._fine = _detector(13, refined=True)

    def read(self, picture: Pixels, region: Region) -> Markers:
        """Return the markers in a region of a picture, corners refined."""
        if region.empty:
            return NO_MARKERS
        gray = cv2.cvtColor(region.of(picture), cv2.COLOR_BGR2GRAY)
        enlarged = np.asarray(cv2.resize(gray, None, fx=_ZOOM, fy=_ZOOM, interpolation=cv2.INTER_CUBIC), np.uint8)
        markers = read_markers(self._fine, enlarged, self._numbers)
        corners = (markers.corners + 0.5) / _ZOOM - 0.5 + region.origin  # the centres of pixels have whole coordinates
        outwards = corners - corners.mean(axis=1, keepdims=True)
        return Markers(markers.ids, corners + self._shift * outwards / np.linalg.norm(outwards, axis=2, keepdims=True))

    def search(self, picture: Pixels) -> Region:
        """Return the region of a picture around the largest marker in it that holds a whole ring; empty if none."""
        gray = np.asarray(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY), dtype=np.uint8)
        markers = read_markers(self._coarse, gray, self._numbers)
        if not len(markers.ids):
            return Region(0, 0, 0, 0)
        sides = np.linalg.norm(markers.corners - np.roll(markers.corners, 1, axis=1), axis=2).max(axis=1)
        largest = int(np.argmax(sides))
        return Region.around(markers.corners[largest], self._near * float(sides[largest]), picture)


def read_markers(detector: cv2.aruco.ArucoDetector, gray: Pixels, numbers: int) -> Markers:
    """Return the markers 0 to numbers - 1 in a picture of one channel, as the detector gives their corners."""
    quads, found, _ = detector.detectMarkers(gray)
    if not len(quads):
        return NO_MARKERS
    ids = np.asarray(found, dtype=np.int64).ravel()
    corners = np.asarray(quads, dtype=np.float64).reshape(-1, 4, 2)
    once = (ids < numbers) & (np.bincount(ids)[ids] == 1)  # a number seen twice is ambiguous
    order = np.argsort(ids[once])
    return Markers(ids[once][order], corners[once][order])


def _detector(threshold_window: int, refined: bool) -> cv2.aruco.ArucoDetector:
    p = cv2.aruco.DetectorParameters()
    p.adaptiveThreshWinSizeMin = p.adaptiveThreshWinSizeMax = threshold_window
    if refined:
        p.minMarkerPerimeterRate = _SMALLEST
        p.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        p.relativeCornerRefinmentWinSize = 1.0  # a whole marker cell
    return cv2.aruco.ArucoDetector(DICTIONARY, p)
