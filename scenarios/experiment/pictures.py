"""What a camera saw at a moment, and what was detected in it."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handover.scenarios.experiment.returned_types import COLOUR, Checked

QUALITY = 88
"""Quality of the JPEG that is kept, of 100."""

MarkShape = Literal["circle", "dashed circle", "cross", "plus"]


@dataclass(frozen=True, kw_only=True)
class Mark(Checked):
    """Something that was detected, at a place in the picture.

    Attributes:
        label: what it is, such as "ball, as measured".
        u, v: pixels from the left and from the top.
        radius: of a circle, in pixels.
        colour: as "#rrggbb".
    """

    label: str
    shape: MarkShape
    u: float
    v: float
    radius: float = 8.0
    colour: str = "#ffd23f"

    expected = {"colour": COLOUR}


@dataclass(frozen=True, kw_only=True)
class CameraPicture(Checked):
    """A picture of one camera at a time of the run, compressed as it is kept.

    Attributes:
        t: in seconds.
        camera: its name, such as "left".
        role: which moment it shows, such as "at the ball"; pictures of several cameras at one moment share it.
        jpeg: bytes of a JPEG file: at most a tenth of the pixels' size, since checkpoints hold pictures too.
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
        import cv2  # imported here and below: every scenario imports this module, and most take no pictures

        height, width, _ = pixels.shape
        _, coded = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
        return cls(t=t, camera=camera, role=role, jpeg=coded.tobytes(), width=width, height=height, marks=tuple(marks))

    @property
    def pixels(self) -> NDArray[np.uint8]:
        """The pixels as JPEG keeps them, shape (height, width, 3), blue green red."""
        import cv2

        decoded = cv2.imdecode(np.frombuffer(self.jpeg, dtype=np.uint8), cv2.IMREAD_COLOR)
        return np.asarray(decoded, dtype=np.uint8)
