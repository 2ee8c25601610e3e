"""Fills convex polygons on a picture, by OpenCV or by a compiled kernel that gives the same pictures bit by bit.

A picture of the Helix has some 500 polygons, most of them smaller than 20 px: that OpenCV is called for each from
Python takes longer than that it fills them. The kernel (`polygon_kernel`) fills all in one call.
"""

import functools
import sys
from collections.abc import Callable
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

SHIFT = 4
"""Fractional bits of corners."""


class Polygons(NamedTuple):
    """Polygons of any numbers of corners, one after another.

    Attributes:
        corners: x and y in px, with SHIFT fractional bits, of all polygons, shape (n, 2).
        first: where in `corners` each polygon begins, and the last one ends, shape (p + 1,).
        colours: shape (p, 3), blue, green, red.
    """

    corners: NDArray[np.int32]
    first: NDArray[np.int64]
    colours: NDArray[np.uint8]


def fill_by_opencv(canvas: NDArray[np.uint8], polygons: Polygons, order: NDArray[np.int64]) -> None:
    """Fill the polygons with these numbers, in this order, by OpenCV."""
    corners, starts, stops = polygons.corners, polygons.first[order].tolist(), polygons.first[order + 1].tolist()
    for start, stop, colour in zip(starts, stops, polygons.colours[order].tolist(), strict=True):
        cv2.fillConvexPoly(canvas, corners[start:stop], colour, cv2.LINE_8, SHIFT)


def fill(canvas: NDArray[np.uint8], polygons: Polygons, order: NDArray[np.int64]) -> None:
    """Fill the polygons with these numbers, in this order, on a canvas of shape (height, width, 3).

    The kernel does it if Numba is loaded anyway, by another unit of this process (`TendonArmFast`): to load Numba for
    this alone, 0.7 s and 130 MB, would take longer than it saves in 300 pairs of pictures.
    """
    (_kernel() if "numba" in sys.modules else fill_by_opencv)(canvas, polygons, order)


@functools.cache
def _kernel() -> Callable[[NDArray[np.uint8], Polygons, NDArray[np.int64]], None]:
    # modules, not names in them: to look a name up when an FMU is built would import the module, and so Numba
    from handover.plants.helix import compiled
    from handover.plants.helix.cameras import polygon_kernel

    return polygon_kernel.fill_by_kernel if compiled.IS_COMPILED else fill_by_opencv
