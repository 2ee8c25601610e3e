"""The two calibrated cameras of the experiment: what the camera unit takes pictures by and the detector measures by.

The thesis calibrates with a box of known corners and gets both cameras' places from it ([Vervloet2025] sec. 3.2.2);
here the calibration is taken as perfect, which is an assumption. The values are those of `paper.toml`.
"""

from typing import Any

import numpy as np

from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.scenarios.experiment.paper import paper_values


def calibration() -> dict[str, Any]:
    """Return both cameras' calibration under the names of the units' parameters."""
    facts = {name: np.array(value) for name, value in paper_values("helix", "camera").items()}
    found: dict[str, Any] = {}
    for i, side in enumerate(("left", "right")):
        p_WC = facts["p_WC"][i]
        found[f"p_WC_{side}"] = p_WC
        found[f"q_WC_{side}"] = quaternion_of(looking_at(p_WC, facts["looked_at"]))
        found[f"intrinsics_{side}"] = facts["intrinsics"][i]
        found[f"distortion_{side}"] = facts["distortion"][i]
    return found


def camera_of(side: str) -> Pinhole:
    """Return the camera of one side, `left` or `right`, to mark its pictures with."""
    c = calibration()
    return Pinhole(side, *(c[f"{what}_{side}"] for what in ("p_WC", "q_WC", "intrinsics", "distortion")))
