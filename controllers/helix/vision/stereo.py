"""Two calibrated cameras, regions of their pictures, and least squares, after [Vervloet2025] sec. 3.2.2."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

Pixels = NDArray[np.uint8]
"""A picture, shape (h, w, 3), blue, green, red, or one channel, shape (h, w)."""


@dataclass(frozen=True)
class StereoRig:
    """The left and the right camera."""

    left: Pinhole
    right: Pinhole

    @property
    def cameras(self) -> tuple[Pinhole, Pinhole]:
        """Both cameras, the left one first."""
        return self.left, self.right

    def triangulate(self, pixel_left: Floats, pixel_right: Floats) -> tuple[Floats, float]:
        """Return the point p_WP, shape (3,), nearest to the rays of two pixels, shape (2,), and the rays' distance.

        It is the middle of the shortest line between the rays a + s d and b + t e; |a + s d - b - t e| is least for
        s = (c.d - (d.e) c.e) / (1 - (d.e)^2) and t = ((d.e) c.d - c.e) / (1 - (d.e)^2), with c = b - a. NaN if the rays
        are parallel.
        """
        a, b = self.left.p_WC, self.right.p_WC
        d, e = self.left.rays(pixel_left[None])[0], self.right.rays(pixel_right[None])[0]
        along, along_d, along_e = float(d @ e), float((b - a) @ d), float((b - a) @ e)
        squared = 1.0 - along * along
        if squared < 1e-12:
            return np.full(3, np.nan), float("inf")
        on_left = a + (along_d - along * along_e) / squared * d
        on_right = b + (along * along_d - along_e) / squared * e
        return 0.5 * (on_left + on_right), float(np.linalg.norm(on_left - on_right))


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
        """Whether it is too small to find anything in it."""
        return self.x1 - self.x0 < 8 or self.y1 - self.y0 < 8

    @property
    def origin(self) -> Floats:
        """Upper left pixel, shape (2,)."""
        return np.array([self.x0, self.y0], dtype=np.float64)

    def of(self, picture: Pixels) -> Pixels:
        """Return this part of a picture, as a view."""
        return picture[self.y0 : self.y1, self.x0 : self.x1]


def least_squares(J: Floats, e: Floats) -> tuple[Floats, Floats]:
    """Return x, shape (n,), that minimises |e - J x|, and J^T J, shape (n, n), of J, shape (m, n), and e, shape (m,).

    The sums avoid BLAS: its threads cost more than they save on a few hundred rows, and their number would show in
    the last digits.

    Raises:
        numpy.linalg.LinAlgError: J^T J is singular.
    """
    information = np.asarray(np.einsum("ij,ik->jk", J, J), dtype=np.float64)
    slope = np.asarray(np.einsum("ij,i->j", J, e), dtype=np.float64)
    return np.asarray(np.linalg.solve(information, slope), dtype=np.float64), information


def covariance(information: Floats, sigma: float) -> Floats:
    """Return the covariance, shape (n, n), of least squares on rows with noise of standard deviation sigma."""
    return sigma**2 * np.asarray(np.linalg.inv(information), dtype=np.float64)
