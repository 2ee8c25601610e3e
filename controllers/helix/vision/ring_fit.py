"""The wrist's pose from all marker corners that the cameras see, in one fit."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from handover.controllers.helix.vision.markers import MarkerRing, Markers
from handover.controllers.helix.vision.stereo import least_squares
from handover.cosim.blocks.geometry import Pinhole, rotation_by
from handover.cosim.blocks.ports import Floats

_ITERATIONS = 12
_SETTLED = 1e-5  # m and rad; the next step would be some thousandth of that
_EXPLAINED = 2.5  # px; a single marker's pose that puts most corners so near is good enough to begin with


@dataclass(frozen=True)
class RingPose:
    """Pose of the ring.

    Attributes:
        p_WR: position, shape (3,), in m.
        R_WR: orientation, shape (3, 3).
        information: J^T J, shape (6, 6), in px^2 per (m, rad)^2, J the slope of all corners by a shift of p_WR and by a
            rotation vector in R.
    """

    p_WR: Floats
    R_WR: Floats
    information: Floats


class RingFit:
    """Gauss-Newton on the distances, in px, between seen corners and where the pose puts them.

    The thesis averages the poses of single markers (`published_detector`). We fit one pose to all corners, because that
    is a hundred times as accurate.

    Args:
        ring: the markers.
        cameras: that see it.
        tolerance: largest RMS distance of a marker's corners, per axis, in px; markers beyond it are left out.
    """

    def __init__(self, ring: MarkerRing, cameras: Sequence[Pinhole], tolerance: float) -> None:
        self._ring = ring
        self._turning = _turning(ring.corners)
        self._cameras = cameras
        self._tolerance = tolerance

    def fit(self, seen: Sequence[Markers], near: tuple[Floats, Floats] | None) -> RingPose | None:
        """Return the pose, or None when there is none that explains what is seen, or when one view alone carries it.

        A view is a marker in one camera's picture. Two poses explain a single small one about equally well, mirrored at
        the line of sight, so that noise chooses between them: tens of millimetres of the wrist. A second view decides,
        by the other camera or of another marker, which is turned by 45 degrees or more.

        Args:
            seen: the markers in each camera's picture.
            near: p_WR and R_WR of a moment ago, at which to begin, or None.
        """
        while sum(len(m.ids) for m in seen) > 1:
            solved = self._solve(seen, near or self._guess(seen))
            if solved is None:
                return None
            pose, e = solved
            worst, camera, marker = self._worst(seen, e)
            if worst <= self._tolerance:
                return pose if self._faces(seen, pose) else None
            seen = [_without(m, marker) if i == camera else m for i, m in enumerate(seen)]
        return None

    def _solve(self, seen: Sequence[Markers], start: tuple[Floats, Floats]) -> tuple[RingPose, Floats] | None:
        """Return the pose, and the misfit before the last step, shape (2 n,), that is to a hundredth of a pixel."""
        pose = start
        for _ in range(_ITERATIONS):
            e, J = self.misfit(seen, *pose)
            if not np.isfinite(e).all():
                return None
            try:
                dx, information = least_squares(J, e)
            except np.linalg.LinAlgError:
                return None
            pose = pose[0] + dx[:3], pose[1] @ rotation_by(dx[3:])
            if np.abs(dx).max() < _SETTLED:
                return RingPose(*pose, information), e
        return None

    def misfit(self, seen: Sequence[Markers], p_WR: Floats, R_WR: Floats) -> tuple[Floats, Floats]:
        """Return seen less expected pixels, shape (2 n,), and the slope of the latter by the pose, shape (2 n, 6)."""
        es: list[Floats] = []
        Js: list[Floats] = []
        for camera, markers in zip(self._cameras, seen, strict=True):
            p_RP = self._ring.corners[markers.ids].reshape(-1, 3)
            pixels, by_point = camera.project_with_slope(p_WR + p_RP @ np.transpose(R_WR))
            by_turn = np.einsum("nij,njk->nik", by_point @ R_WR, self._turning[markers.ids].reshape(-1, 3, 3))
            es.append((markers.corners.reshape(-1, 2) - pixels).ravel())
            Js.append(np.concatenate([by_point, by_turn], axis=2).reshape(-1, 6))
        return np.concatenate(es), np.concatenate(Js)

    def _worst(self, seen: Sequence[Markers], e: Floats) -> tuple[float, int, int]:
        """Return the largest RMS distance of a marker, and which camera's and which of its markers it is."""
        by_marker = np.sqrt(np.mean(e.reshape(-1, 8) ** 2, axis=1))
        owner = [(i, k) for i, m in enumerate(seen) for k in range(len(m.ids))]
        worst = int(np.argmax(by_marker))
        return float(by_marker[worst]), *owner[worst]

    def _faces(self, seen: Sequence[Markers], pose: RingPose) -> bool:
        """Return whether every marker shows its face to the camera that sees it."""
        for camera, markers in zip(self._cameras, seen, strict=True):
            middle = self._ring.corners[markers.ids].mean(axis=1)
            to_camera = camera.p_WC - pose.p_WR - middle @ np.transpose(pose.R_WR)
            outwards = (middle * [1.0, 1.0, 0.0]) @ np.transpose(pose.R_WR)
            if np.any(np.einsum("ij,ij->i", to_camera, outwards) <= 0.0):
                return False
        return True

    def _guess(self, seen: Sequence[Markers]) -> tuple[Floats, Floats]:
        """Return the pose by a single marker that puts most corners where they are seen.

        Large markers come first, since they tell most; the others are asked only if these do not explain what is seen.
        """
        views = [(float(size), i, k) for i, m in enumerate(seen) for k, size in enumerate(_sizes(m))]
        views.sort(reverse=True)
        best, least = (np.zeros(3), np.eye(3)), float("inf")
        for _, i, k in views:
            for guess in self._by_marker(i, seen[i], k):
                distance = self._typical_distance(seen, *guess)
                if distance <= least:
                    best, least = guess, distance
            if least < _EXPLAINED:
                break
        return best

    def _typical_distance(self, seen: Sequence[Markers], p_WR: Floats, R_WR: Floats) -> float:
        """Return the median distance along an axis, in px, between seen corners and where a pose puts them."""
        distances = [
            np.abs(markers.corners - camera.project(p_WR + self._ring.corners[markers.ids] @ np.transpose(R_WR)))
            for camera, markers in zip(self._cameras, seen, strict=True)
            if len(markers.ids)
        ]
        return float(np.median(np.nan_to_num(np.concatenate(distances), nan=np.inf)))

    def _by_marker(self, i: int, markers: Markers, k: int) -> list[tuple[Floats, Floats]]:
        """Return the poses of the ring by marker k in camera i's picture: a flat square leaves two."""
        camera = self._cameras[i]
        p_RP = self._ring.corners[markers.ids[k]]
        x_RM, y_RM = p_RP[1] - p_RP[0], p_RP[0] - p_RP[3]
        side = np.linalg.norm(x_RM)
        R_RM = np.column_stack([x_RM, y_RM, np.cross(x_RM, y_RM) / side]) / side
        p_MP = (p_RP - p_RP.mean(axis=0)) @ R_RM
        xy = camera.undistorted(markers.corners[k])
        _, turns, shifts, _ = cv2.solvePnPGeneric(p_MP, xy, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE_SQUARE)
        guesses: list[tuple[Floats, Floats]] = []
        for turn, shift in zip(turns, shifts, strict=True):
            R_WM = camera.R_WC @ rotation_by(np.asarray(turn, dtype=np.float64).ravel())
            p_WM = camera.p_WC + camera.R_WC @ np.asarray(shift, dtype=np.float64).ravel()
            R_WR = R_WM @ np.transpose(R_RM)
            guesses.append((p_WM - R_WR @ p_RP.mean(axis=0), R_WR))
        return guesses


def _turning(p_RP: Floats) -> Floats:
    """Return -[p]x, shape (..., 3, 3), of points, shape (..., 3): d(R exp(w) p)/dw = -R [p]x at w = 0."""
    return np.stack([np.cross(axis, p_RP) for axis in np.eye(3)], axis=-1)


def _without(markers: Markers, k: int) -> Markers:
    return Markers(np.delete(markers.ids, k), np.delete(markers.corners, k, axis=0))


def _sizes(markers: Markers) -> Floats:
    """Return the areas, shape (n,), in px^2, of markers in a picture."""
    d = markers.corners[:, 2:] - markers.corners[:, :2]  # diagonals
    return np.abs(d[:, 0, 0] * d[:, 1, 1] - d[:, 0, 1] * d[:, 1, 0]) * 0.5
