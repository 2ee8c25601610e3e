"""A rectangle of a picture in which something is looked for."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats

Pixels = NDArray[np.uint8]
"""A picture, shape (h, w, 3), blue, green, red, or one channel, shape (h, w)."""


@dataclass(frozen=True)
class Region:
    """Columns x0 to x1 and rows y0 to y1, the last ones excluded; empty when there are none."""

    x0: int
    y0: int
    x1: int
    y1: int

    @staticmethod
    def whole(picture: Pixels) -> "Region":
        """Return the region of all of a picture."""
        return Region(0, 0, picture.shape[1], picture.shape[0])

    @staticmethod
    def around(points: Floats, margin: float, picture: Pixels) -> "Region":
        """Return the part of a picture within a margin, in px, of pixels, shape (n, 2); empty if one is not finite."""
        if not np.isfinite(points).all():
            return Region(0, 0, 0, 0)
        h, w = picture.shape[:2]
        low = np.clip(np.floor(points.min(axis=0) - margin), 0, [w, h]).astype(int).tolist()
        high = np.clip(np.ceil(points.max(axis=0) + margin) + 1.0, 0, [w, h]).astype(int).tolist()
        return Region(*low, *high)

    @property
    def empty(self) -> bool:
        """Whether there is nothing worth looking at."""
        return self.x1 - self.x0 < 8 or self.y1 - self.y0 < 8

    @property
    def origin(self) -> Floats:
        """Upper left pixel, shape (2,)."""
        return np.array([self.x0, self.y0], dtype=np.float64)

    def of(self, picture: Pixels) -> Pixels:
        """Return this part of a picture, as a view."""
        return picture[self.y0 : self.y1, self.x0 : self.x1]
