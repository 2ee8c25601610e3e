"""What a camera saw at a moment, and what was detected in it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

QUALITY = 88
"""Of the JPEG that is kept, of 100."""


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
    """A picture of one camera at a time of the run, in the form in which it is kept.

    Attributes:
        t: in seconds.
        camera: its name, such as "left".
        role: what moment it is, such as "at the ball"; pictures of several cameras at one moment share it.
        jpeg: the picture as a JPEG file's bytes: a tenth or less of its pixels, which a checkpoint holds too.
        width, height: in pixels.
        marks: what was detected in it.
    """

    t: float
    camera: str
    role: str
    jpeg: bytes
    width: int
    height: int
    marks: Sequence[Mark] = ()

    @classmethod
    def take(
        cls, *, t: float, camera: str, role: str, pixels: NDArray[np.uint8], marks: Sequence[Mark] = ()
    ) -> "CameraPicture":
        """Return a picture of pixels, shape (height, width, 3), blue green red."""
        import cv2  # as below: every scenario knows pictures, most take none

        height, width, _ = pixels.shape
        _, coded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        return cls(t=t, camera=camera, role=role, jpeg=coded.tobytes(), width=width, height=height, marks=tuple(marks))

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """The pixels as JPEG keeps them, shape (height, width, 3), blue green red."""
        import cv2

        decoded = cv2.imdecode(np.frombuffer(self.jpeg, dtype=np.uint8), cv2.IMREAD_COLOR)
        return np.asarray(decoded, dtype=np.uint8)
