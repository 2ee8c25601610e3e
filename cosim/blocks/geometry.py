"""Frames, rotations, quaternions and the pinhole camera, in monogram notation.

`p_WG` is the position of G seen from W, `R_WC` turns coordinates in C into coordinates in W, `q_WB` is the quaternion
of `R_WB` with its scalar part first. A frame is a single capital letter; FRAMES lists them all, but for those of a few
lines, as P of any point.

Rotations are computed by `plain_rotation` and not by SciPy's `Rotation`: that is made for many rotations at once and
takes ten times as long for one, and importing it takes longer than all other imports of a camera or a hand together.
`Pinhole` is a calibrated camera with the radial and tangential distortion of its lens (Brown and Conrady).
"""

from typing import Final

import numpy as np

from handover.cosim.blocks.plain_rotation import (
    Quaternion,
    from_rotation_vector,
    norm,
    normalize,
    quaternion,
    quaternion_dot,
    rotation_matrix,
    rotation_vector,
    vector,
)
from handover.cosim.blocks.ports import Floats

_CONVERGED = 1e-9  # of a Newton step, whose error is some hundredth of its square
_UNIT_TOLERANCE = 1e-6  # of a quaternion's length
_MIN_DEPTH = 0.02  # m; points nearer to the lens, or behind it, are not projected

FRAMES: Final = {
    "W": "world: right-handed, z up. Its origin is the middle of the Helix's mount, or the foot of the VSL arm. Of "
    "the free-flyers it is near the place of the handover, in the grasp scene on the table",
    "B": "base of an arm or a free-flying body. The Helix's has z down, along the hanging arm (R_WB = diag(1, -1, "
    "-1)). A free-flyer's has its origin at the centre of mass and its arm along -x",
    "R": "marker ring at the wrist: z along the arm towards the gripper",
    "G": "gripper: the point where an object is held; same axes as R on the Helix, as B on the free-flyer",
    "O": "object that is handed over or grasped: its centre",
    "H": "hand: middle of the palm; for the soft hand of the grasp scene its wrist, x towards the object",
    "C": "camera: z along the optical axis, x to the right and y down in the picture",
    "M": "one fiducial marker: z out of its face",
    "K": "lowest point of the cup that the hand before the Helix makes",
    "E": "elbow of that hand's person",
    "D": "middle of the rim of the Helix's bowl; on the free-flyer the goal's frame",
    "S": "middle of the sphere of which that bowl's inside is a part",
}


def rotation_of(q_AB: Floats) -> Floats:
    """Return R_AB, shape (3, 3), of the quaternion q_AB, shape (4,), scalar first; it need not be of unit length.

    Raises:
        ValueError: q_AB is zero.
    """
    q = quaternion(np.asarray(q_AB, dtype=np.float64))
    if quaternion_dot(q, q) == 0.0:
        raise ValueError("a quaternion of length 0 is not a rotation")
    return _matrix(normalize(q))


def rotation_by(r_AB: Floats) -> Floats:
    """Return R_AB, shape (3, 3), of the rotation vector r_AB, shape (3,): along the axis, as long as the angle, rad."""
    return _matrix(from_rotation_vector(vector(np.asarray(r_AB, dtype=np.float64))))


def quaternion_of(R_AB: Floats) -> Floats:
    """Return q_AB, shape (4,), scalar first and not negative, of the rotation matrix R_AB, shape (3, 3).

    The largest entry is computed from the diagonal, the others from sums and differences of off-diagonal entries.
    """
    R: list[list[float]] = np.asarray(R_AB, dtype=np.float64).tolist()
    trace = R[0][0] + R[1][1] + R[2][2]
    candidates = [R[0][0], R[1][1], R[2][2], trace]
    i = candidates.index(max(candidates))
    if i == 3:
        q = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1], 1.0 + trace]
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q = [0.0, 0.0, 0.0, R[k][j] - R[j][k]]
        q[i], q[j], q[k] = 1.0 - trace + 2.0 * R[i][i], R[j][i] + R[i][j], R[k][i] + R[i][k]
    w, x, y, z = normalize((q[3], q[0], q[1], q[2]))
    return np.array([w, x, y, z] if (w, x, y, z) >= (0.0, 0.0, 0.0, 0.0) else [-w, -x, -y, -z])


def skew(v: Floats) -> Floats:
    """Return [v]x, shape (3, 3), of v, shape (3,): [v]x a is the cross product v x a."""
    x, y, z = np.asarray(v, dtype=np.float64).tolist()
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def looking_at(p_WC: Floats, p_WT: Floats) -> Floats:
    """Return R_WC of a camera at p_WC that looks at p_WT and keeps the horizon level (x horizontal, y down)."""
    z = np.asarray(p_WT, dtype=np.float64) - p_WC
    z = z / np.linalg.norm(z)
    x = np.cross(z, np.array([0.0, 0.0, 1.0]))
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def rotation_angle(R_AB: Floats) -> float:
    """Return the angle of a rotation matrix, from 0 to pi, in rad."""
    return norm(rotation_vector(quaternion(quaternion_of(R_AB))))


def _matrix(q_AB: Quaternion) -> Floats:
    return np.array(rotation_matrix(q_AB)).reshape(3, 3)


class InvalidCalibration(ValueError):
    """A camera's calibration is invalid: quaternion not of unit length, or focal length not positive."""

    def __init__(self, camera: str, quantity: str, value: Floats, wanted: str) -> None:
        super().__init__(f"camera {camera!r}: {quantity} = {np.asarray(value).tolist()}; it must be {wanted}")
        self.camera, self.quantity, self.value, self.wanted = camera, quantity, value, wanted


class Pinhole:
    """Projects points p_WP to pixels, and pixels back to rays. The middle of the upper left pixel is at (0, 0).

    With (x, y) = (X, Y) / Z in the camera's frame C and r^2 = x^2 + y^2, a pixel is (fx x_d + cx, fy y_d + cy),
    x_d = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2), y_d likewise with p1 and p2 exchanged.

    Args:
        name: the camera's name in messages.
        p_WC: position in the world, shape (3,), in m.
        q_WC: orientation, shape (4,), scalar first.
        intrinsics: fx, fy, cx, cy, in px.
        distortion: k1, k2, p1, p2, k3.

    Raises:
        InvalidCalibration: q_WC is not of unit length, fx or fy is not positive, or an entry is not finite.
    """

    def __init__(self, name: str, p_WC: Floats, q_WC: Floats, intrinsics: Floats, distortion: Floats) -> None:
        quantities = {"p_WC": p_WC, "q_WC": q_WC, "intrinsics": intrinsics, "distortion": distortion}
        for quantity, value in quantities.items():
            if not np.isfinite(value).all():
                raise InvalidCalibration(name, quantity, value, "finite")
        if abs(float(np.linalg.norm(q_WC)) - 1.0) > _UNIT_TOLERANCE:
            raise InvalidCalibration(name, "q_WC", q_WC, "a quaternion of unit length, scalar first")
        if min(intrinsics[:2]) <= 0.0:
            raise InvalidCalibration(name, "intrinsics", intrinsics, "(fx, fy, cx, cy) with fx and fy positive")
        self.p_WC = np.array(p_WC)
        self.R_WC = rotation_of(q_WC)
        self.R_CW = np.transpose(self.R_WC)
        self.f = np.array(intrinsics[:2])
        self.c = np.array(intrinsics[2:])
        self.distortion = np.array(distortion)

    def depth(self, p_WP: Floats) -> Floats:
        """Return the distance along the optical axis, in m, of points of shape (..., 3)."""
        return (p_WP - self.p_WC) @ self.R_WC[:, 2]

    def project(self, p_WP: Floats) -> Floats:
        """Return pixels, shape (..., 2), of points of shape (..., 3); NaN for what is behind the camera."""
        p_CP = (p_WP - self.p_WC) @ self.R_WC
        Z = np.where(p_CP[..., 2:] > _MIN_DEPTH, p_CP[..., 2:], np.nan)
        return self.f * self._distorted(p_CP[..., :2] / Z) + self.c

    def project_with_slope(self, p_WP: Floats) -> tuple[Floats, Floats]:
        """Return pixels, shape (n, 2), of points of shape (n, 3), and d pixel / d p_WP, shape (n, 2, 3), in px/m."""
        p_CP = (p_WP - self.p_WC) @ self.R_WC
        Z = np.where(p_CP[:, 2:] > _MIN_DEPTH, p_CP[:, 2:], np.nan)
        xy = p_CP[:, :2] / Z
        slope = self.f[:, None] * self._slope(xy)  # d pixel / d (x, y)
        by_point = np.concatenate([slope, -slope @ xy[:, :, None]], axis=2) / Z[:, :, None]
        return self.f * self._distorted(xy) + self.c, by_point @ self.R_CW

    def undistorted(self, pixels: Floats) -> Floats:
        """Return (x, y) = (X, Y) / Z, shape (n, 2), of pixels of shape (n, 2), by Newton's method."""
        target = (pixels - self.c) / self.f
        xy = target
        for _ in range(4):
            slope, residual = self._slope(xy), target - self._distorted(xy)
            a, b, c, d = slope[:, 0, 0], slope[:, 0, 1], slope[:, 1, 0], slope[:, 1, 1]
            x, y = residual[:, 0], residual[:, 1]
            step = np.column_stack([d * x - b * y, a * y - c * x]) / (a * d - b * c)[:, None]  # the slope's inverse
            xy = xy + step
            if np.abs(step).max(initial=0.0) < _CONVERGED:
                break
        return xy

    def rays(self, pixels: Floats) -> Floats:
        """Return unit directions in W, shape (n, 3), from the camera through pixels, shape (n, 2)."""
        xy = self.undistorted(pixels)
        d = np.column_stack([xy, np.ones(len(xy))]) @ self.R_CW
        return d / np.linalg.norm(d, axis=1, keepdims=True)

    def _distorted(self, xy: Floats) -> Floats:
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[..., 0], xy[..., 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        skew = 2.0 * (p1 * y + p2 * x)
        return xy * (radial + skew)[..., None] + r2[..., None] * np.array([p2, p1])

    def _slope(self, xy: Floats) -> Floats:
        """Return d (x_d, y_d) / d (x, y), shape (n, 2, 2)."""
        k1, k2, p1, p2, k3 = self.distortion
        x, y = xy[:, 0], xy[:, 1]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        by_r2 = 2.0 * (k1 + r2 * (2.0 * k2 + r2 * 3.0 * k3))
        skew = 2.0 * (p1 * y + p2 * x)
        cross = by_r2 * x * y + 2.0 * (p1 * x + p2 * y)
        slope = np.empty((len(xy), 2, 2))
        slope[:, 0, 0] = radial + skew + by_r2 * x * x + 4.0 * p2 * x
        slope[:, 1, 1] = radial + skew + by_r2 * y * y + 4.0 * p1 * y
        slope[:, 0, 1] = slope[:, 1, 0] = cross
        return slope
