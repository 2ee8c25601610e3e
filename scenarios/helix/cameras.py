"""The two calibrated cameras of the experiment: the camera unit and the detector get the same calibration.

The thesis calibrates with a box of known corners and gets both cameras' poses from it ([Vervloet2025] sec. 3.2.2);
here the calibration is taken as perfect, which is an assumption. The values are those of `paper.toml`.
"""

from typing import Any

import numpy as np

from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.scenarios.experiment.paper import paper_values


def calibration() -> dict[str, Any]:
    """Return both cameras' calibration under the names of the units' parameters."""
    camera = {name: np.array(value) for name, value in paper_values("helix", "camera").items()}
    parameters: dict[str, Any] = {}
    for i, side in enumerate(("left", "right")):
        p_WC = camera["p_WC"][i]
        parameters[f"p_WC_{side}"] = p_WC
        parameters[f"q_WC_{side}"] = quaternion_of(looking_at(p_WC, camera["looked_at"]))
        parameters[f"intrinsics_{side}"] = camera["intrinsics"][i]
        parameters[f"distortion_{side}"] = camera["distortion"][i]
    return parameters


def camera_of(side: str) -> Pinhole:
    """Return the camera of one side, `left` or `right`, to mark its pictures with."""
    c = calibration()
    return Pinhole(side, *(c[f"{what}_{side}"] for what in ("p_WC", "q_WC", "intrinsics", "distortion")))
