"""How far the controller's model of the arm is from the arm that the cameras see. [Vervloet2025] sec. 4.2, fig. 9."""

from typing import NamedTuple

import numpy as np

from handover.controllers.helix.constant_curvature import forward_kinematics
from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.paper import paper_values

_W_FROM_B = np.array([1.0, -1.0, -1.0])  # R_WB = diag(1, -1, -1)


class ModelMismatch(NamedTuple):
    """Distances of fig. 9, m: of gripper and model from where the gripper hangs after calibration, and between them."""

    arm_travel: float
    model_travel: float
    apart: float


def model_mismatch(q_sys: Floats, p_WG_est: Floats) -> ModelMismatch:
    """Compare the gripper of the commanded state, f(q_sys), with the filtered measured one.

    Args:
        q_sys: commanded state, shape (9,), rad and m.
        p_WG_est: filtered measured position of the gripper in W, shape (3,), m.
    """
    stated = paper_values("helix_handover", "servo")
    d_gripper = float(stated["d_gripper"])
    p_WG_sys = _W_FROM_B * forward_kinematics(q_sys, d_gripper)[3:]
    p_WG_calib = np.array([0.0, 0.0, -sum(stated["l_calib"]) - d_gripper])
    between = (p_WG_est - p_WG_calib, p_WG_sys - p_WG_calib, p_WG_sys - p_WG_est)
    return ModelMismatch(*(float(np.linalg.norm(d)) for d in between))
