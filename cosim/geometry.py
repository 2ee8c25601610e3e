"""Frames, rotations and quaternions, in monogram notation.

`p_WG` is the position of G seen from W, `R_WC` turns coordinates in C into coordinates in W, `q_WB` is the quaternion
of `R_WB` with its scalar part first. A frame is a single capital letter; FRAMES lists them all.
"""

from typing import Final

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.ports import Floats

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
    """Return R_AB, shape (3, 3), of the unit quaternion q_AB, shape (4,), scalar first."""
    return Rotation.from_quat(q_AB, scalar_first=True).as_matrix()


def quaternion_of(R_AB: Floats) -> Floats:
    """Return q_AB, shape (4,), scalar first and not negative, of the rotation matrix R_AB, shape (3, 3)."""
    return Rotation.from_matrix(R_AB).as_quat(canonical=True, scalar_first=True)


def looking_at(p_WC: Floats, p_WT: Floats) -> Floats:
    """Return R_WC of a camera at p_WC that looks at p_WT and keeps the horizon level (x horizontal, y down)."""
    z = np.asarray(p_WT, dtype=np.float64) - p_WC
    z = z / np.linalg.norm(z)
    x = np.cross(z, np.array([0.0, 0.0, 1.0]))
    x = x / np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
