"""What is painted: polygons and decals in a picture's pixels, with their depths."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats

Pixels = NDArray[np.uint8]
"""Picture or part of one, shape (h, w, 3), blue, green, red; a decal's texture has a fourth channel, its opacity."""


@dataclass(frozen=True)
class Sketch:
    """Things made of convex polygons: m things, each of k polygons with n corners, painted in this order.

    Attributes:
        depth: shape (m,), in m; a thing hides what is deeper.
        outlines: shape (m, k, n, 2), in px; a thing with a point that is not finite is left out.
        colours: shape (m, k, 3), blue, green, red, 0 to 255.
    """

    depth: Floats
    outlines: Floats
    colours: Floats


@dataclass(frozen=True)
class Decal:
    """A texture (its colours multiplied by its opacity) and the pixels where its corners go.

    Corners, shape (4, 2): upper left, upper right, lower right, lower left of the texture's area, not of its pixels'
    middles.
    """

    depth: float
    texture: Pixels
    corners: Floats
