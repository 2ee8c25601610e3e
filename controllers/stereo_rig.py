"""Two calibrated cameras, and where what both see lies in space, after [Vervloet2025] sec. 3.2.2."""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats


@dataclass(frozen=True)
class StereoRig:
    """The left and the right camera."""

    left: Pinhole
    right: Pinhole

    @property
    def cameras(self) -> tuple[Pinhole, Pinhole]:
        """Both cameras, the left one first."""
        return self.left, self.right

    def meeting_point(self, pixel_left: Floats, pixel_right: Floats) -> tuple[Floats, float]:
        """Return the point p_WP, shape (3,), closest to the rays of two pixels, shape (2,), and the rays' distance.

        It is the middle of the shortest line between the rays. NaN if the rays are parallel.
        """
        a, b = self.left.p_WC, self.right.p_WC
        d, e = self.left.rays(pixel_left[None])[0], self.right.rays(pixel_right[None])[0]
        normal = np.cross(d, e)
        squared = float(normal @ normal)
        if squared < 1e-12:
            return np.full(3, np.nan), float("inf")
        s = np.cross(b - a, e) @ normal / squared
        t = np.cross(b - a, d) @ normal / squared
        on_left, on_right = a + s * d, b + t * e
        return 0.5 * (on_left + on_right), float(np.linalg.norm(on_left - on_right))
