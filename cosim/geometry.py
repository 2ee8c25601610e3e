"""Frames, rotations and quaternions, in monogram notation.

`p_WG` is the position of G seen from W, `R_WC` turns coordinates in C into coordinates in W, `q_WB` is the quaternion
of `R_WB` with its scalar part first. A frame is a single capital letter; FRAMES lists them all.

Single rotations are computed here: SciPy's `Rotation`, made for many at once, takes ten times as long for one, and
loading it longer than all else that a camera or a hand needs.
"""

import math
from typing import Final

import numpy as np

from handover.cosim.ports import Floats

_SMALL_TURN = 1e-3  # rad

FRAMES: Final = {
    "W": "world: right-handed, z up; origin at the middle of the Helix's mount, at the foot of the VSL arm, near the "
    "place of a free-flyer's handover, on the table of the grasp scene",
    "B": "base of an arm or a free-flying body; the Helix's has z down, along the hanging arm (R_WB = diag(1, -1, -1)) "
    "and a free-flyer's has its origin at the centre of mass and its arm along -x",
    "R": "marker ring at the wrist: z along the arm towards the gripper",
    "G": "gripper: the point where an object is held; same axes as R on the Helix, as B on the free-flyer",
    "O": "object that is handed over or grasped: its centre",
    "H": "hand: middle of the palm; for the soft hand of the grasp scene its wrist, x towards the object",
    "C": "camera: z along the optical axis, x to the right and y down in the picture",
    "M": "one fiducial marker: z out of its face",
}


def rotation_of(q_AB: Floats) -> Floats:
    """Return R_AB, shape (3, 3), of the quaternion q_AB, shape (4,), scalar first; it need not be of unit length.

    Raises:
        ValueError: q_AB is zero.
    """
    w, x, y, z = np.asarray(q_AB, dtype=np.float64).tolist()
    return _matrix(*_normed(x, y, z, w))


def rotation_by(r_AB: Floats) -> Floats:
    """Return R_AB, shape (3, 3), of the rotation vector r_AB, shape (3,): its direction is the axis, its length in rad.

    The quaternion is (cos(a/2), sin(a/2)/a r_AB) for a turn by a = |r_AB|, by its series where a is small.
    """
    x, y, z = np.asarray(r_AB, dtype=np.float64).tolist()
    a = math.sqrt(x * x + y * y + z * z)
    a2 = a * a
    scale = math.sin(a / 2) / a if a > _SMALL_TURN else 0.5 - a2 / 48 + a2 * a2 / 3840
    return _matrix(scale * x, scale * y, scale * z, math.cos(a / 2))


def quaternion_of(R_AB: Floats) -> Floats:
    """Return q_AB, shape (4,), scalar first and not negative, of the rotation matrix R_AB, shape (3, 3).

    The greatest of the four entries is taken from the diagonal, the others from sums and differences beside it.
    """
    R: list[list[float]] = np.asarray(R_AB, dtype=np.float64).tolist()
    trace = R[0][0] + R[1][1] + R[2][2]
    greatest = [R[0][0], R[1][1], R[2][2], trace]
    i = greatest.index(max(greatest))
    if i == 3:
        q = [R[2][1] - R[1][2], R[0][2] - R[2][0], R[1][0] - R[0][1], 1.0 + trace]
    else:
        j, k = (i + 1) % 3, (i + 2) % 3
        q = [0.0, 0.0, 0.0, R[k][j] - R[j][k]]
        q[i], q[j], q[k] = 1.0 - trace + 2.0 * R[i][i], R[j][i] + R[i][j], R[k][i] + R[i][k]
    x, y, z, w = _normed(*q)
    return np.array([w, x, y, z] if (w, x, y, z) >= (0.0, 0.0, 0.0, 0.0) else [-w, -x, -y, -z])


def looking_at(p_WC: Floats, p_WT: Floats) -> Floats:
    """Return R_WC of a camera at p_WC that looks at p_WT and keeps the horizon level (x horizontal, y down)."""
    z = np.asarray(p_WT, dtype=np.float64) - p_WC
    z = z / np.linalg.norm(z)
    x = np.cross(z, np.array([0.0, 0.0, 1.0]))
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _normed(x: float, y: float, z: float, w: float) -> tuple[float, float, float, float]:
    length = math.sqrt(x * x + y * y + z * z + w * w)
    if length == 0.0:
        raise ValueError("a quaternion of length 0 is no rotation")
    return x / length, y / length, z / length, w / length


def _matrix(x: float, y: float, z: float, w: float) -> Floats:
    """Return the rotation matrix of a quaternion, whose sums are in SciPy's order: results are the same to the bit."""
    xx, yy, zz, ww = x * x, y * y, z * z, w * w
    xy, xz, yz, xw, yw, zw = x * y, x * z, y * z, x * w, y * w, z * w
    return np.array(
        [
            [xx - yy - zz + ww, 2.0 * (xy - zw), 2.0 * (xz + yw)],
            [2.0 * (xy + zw), -xx + yy - zz + ww, 2.0 * (yz - xw)],
            [2.0 * (xz - yw), 2.0 * (yz + xw), -xx - yy + zz + ww],
        ]
    )
