"""What a camera saw at a moment, and what was detected in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Mark:
    """Something that was detected, at a place in the picture.

    Attributes:
        label: what it is, such as "ball, as measured".
        shape: "circle", "cross" or "plus".
        u, v: pixels from the left and from the top.
        radius: of a circle, in pixels.
        colour: as "#rrggbb".
    """

    label: str
    shape: str
    u: float
    v: float
    radius: float = 8.0
    colour: str = "#ffd23f"


@dataclass(frozen=True, kw_only=True)
class CameraPicture:
    """A picture, shape (height, width, 3), blue green red, of one camera at a time of the run.

    `role` tells what moment it is, such as "at the ball"; pictures of several cameras at one moment share it.
    """

    t: float
    camera: str
    role: str
    pixels: NDArray[np.uint8]
    marks: Sequence[Mark] = ()
