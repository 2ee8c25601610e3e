"""What both cameras saw at one moment, and where the controller took ball and arm to be."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cosim.ports import Floats
from cosim.signals import Signals

_SHAPE = (720, 1280, 3)


@dataclass(frozen=True)
class Snapshot:
    """Pictures, shape (720, 1280, 3), blue green red, and estimated positions in W, m."""

    t: float
    left: NDArray[np.uint8]
    right: NDArray[np.uint8]
    p_WO_est: Floats
    p_WR_est: Floats
    p_WG_est: Floats

    @classmethod
    def take(cls, t: float, signals: Signals) -> "Snapshot":
        """Copy the pictures and estimates as they are."""
        left, right = (signals[f"camera.{side}"].reshape(_SHAPE) for side in ("left", "right"))
        estimates = {f"{p}_est": signals[f"servo.{p}_est"] for p in ("p_WO", "p_WR", "p_WG")}
        return cls(t, left, right, **estimates)
