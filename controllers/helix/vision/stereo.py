"""What both detectors share: points by pictures of calibrated cameras, regions, and what a detector measures.

[Vervloet2025] sec. 3.2.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

Pixels = NDArray[np.uint8]
"""A picture, shape (h, w, 3), blue, green, red, or one channel, shape (h, w)."""

_PARALLEL = 1e-12  # squared angle, rad^2, about, within which all rays are parallel


@dataclass(frozen=True)
class BallPosition:
    """Centre p_WO, shape (3,), in m, its covariance, shape (3, 3), in m^2, and how far its edge is found outwards.

    The shift is in px, with its variance in px^2; a detector that estimates none leaves both at 0.
    """

    p_WO: Floats
    covariance: Floats
    shift: float = 0.0
    shift_variance: float = 0.0


@dataclass(frozen=True)
class WristPosition:
    """Wrist p_WR and gripper p_WG, shape (3,), in m, and their covariances, shape (3, 3), in m^2."""

    p_WR: Floats
    p_WG: Floats
    cov_R: Floats
    cov_G: Floats


def triangulate(cameras: Sequence[Pinhole], pixels: Sequence[Floats]) -> tuple[Floats, float]:
    """Return the point p_WP, shape (3,), nearest to the rays of pixels, one a camera, and how far they pass each other.

    It minimises the sum of squared distances from the rays a_i + s d_i: sum (1 - d_i d_i^T) (p - a_i) = 0; for two rays
    it is the middle of the shortest line between them. The rays pass each other at twice the largest of these
    distances, m, which for two rays is the length of that line. NaN and infinity if all rays are parallel.

    Args:
        cameras: two or more.
        pixels: in each camera's picture, shape (2,) each.
    """
    across: list[Floats] = []  # 1 - d d^T
    for camera, pixel in zip(cameras, pixels, strict=True):
        d = camera.rays(pixel[None])[0]
        across.append(np.eye(3) - np.outer(d, d))
    total = np.sum(across, axis=0)
    if float(np.linalg.eigvalsh(total)[0]) < _PARALLEL:
        return np.full(3, np.nan), float("inf")
    towards = np.sum([P @ camera.p_WC for P, camera in zip(across, cameras, strict=True)], axis=0)
    p_WP = np.asarray(np.linalg.solve(total, towards), dtype=np.float64)
    distances = [float(np.linalg.norm(P @ (p_WP - c.p_WC))) for P, c in zip(across, cameras, strict=True)]
    return p_WP, 2.0 * max(distances)


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
