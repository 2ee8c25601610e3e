"""The two calibrated cameras of the experiment: what the camera unit takes pictures by and the detector measures by.

The thesis calibrates with a box of known corners and gets both cameras' places from it ([Vervloet2025] sec. 3.2.2);
here the calibration is taken as perfect, which is an assumption. Values are listed in `paper.toml`.
"""

from typing import Any

import numpy as np

from cosim.geometry import looking_at, quaternion_of
from cosim.pinhole import Pinhole

_P_WC = {"left": np.array([-0.95, 0.25, -0.60]), "right": np.array([-0.95, -0.25, -0.60])}
_LOOKED_AT = np.array([0.0, 0.0, -0.62])
_INTRINSICS = {"left": np.array([907.0, 906.0, 642.5, 357.0]), "right": np.array([908.5, 907.5, 636.0, 361.5])}
_DISTORTION = {
    "left": np.array([0.105, -0.190, 0.0006, -0.0008, 0.060]),
    "right": np.array([0.092, -0.165, -0.0005, 0.0007, 0.045]),
}


def calibration() -> dict[str, Any]:
    """Return both cameras' calibration under the names of the units' parameters."""
    found: dict[str, Any] = {}
    for side, p_WC in _P_WC.items():
        found[f"p_WC_{side}"] = p_WC
        found[f"q_WC_{side}"] = quaternion_of(looking_at(p_WC, _LOOKED_AT))
        found[f"intrinsics_{side}"] = _INTRINSICS[side]
        found[f"distortion_{side}"] = _DISTORTION[side]
    return found


def camera_of(side: str) -> Pinhole:
    """Return the camera of one side, `left` or `right`, to mark its pictures with."""
    c = calibration()
    return Pinhole(side, *(c[f"{what}_{side}"] for what in ("p_WC", "q_WC", "intrinsics", "distortion")))
