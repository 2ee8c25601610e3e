"""Noise of a camera's sensor, cheap enough for every picture."""

import cv2
import numpy as np
from numpy.random import Generator

from handover.plants.sketch import Pixels

_SPARE = 1 << 20  # offsets to choose from


class SensorNoise:
    """Adds rounded normal noise, drawn once, from an offset that is drawn anew for each picture.

    Drawing 2.8 million normal numbers a picture would cost more than the picture. So a sheet somewhat larger than a
    picture is drawn at the start, and a picture takes a contiguous part of it: pixels of one picture are independent,
    and two pictures are, but for a shift of the sheet against itself. The sheet is kept as what brightens and what
    darkens, so that saturating 8-bit arithmetic does the rest.

    Args:
        sigma: standard deviation in levels.
        shape: of the pictures, (height, width, 3).
        rng: draws the sheet.
    """

    def __init__(self, sigma: float, shape: tuple[int, int, int], rng: Generator) -> None:
        self._shape = shape
        self._size = int(np.prod(shape))
        sheet = rng.standard_normal(self._size + _SPARE, dtype=np.float32)
        sheet = np.rint(np.clip(sheet * np.float32(sigma), -255.0, 255.0)).astype(np.int16)
        self._brighter = np.maximum(sheet, 0).astype(np.uint8)
        self._darker = np.maximum(-sheet, 0).astype(np.uint8)

    @staticmethod
    def draw(rng: Generator) -> int:
        """Return an offset into the sheet."""
        return int(rng.integers(_SPARE))

    def add(self, picture: Pixels, offset: int) -> None:
        """Add the noise at the offset to the picture."""
        part = slice(offset, offset + self._size)
        cv2.add(picture, self._brighter[part].reshape(self._shape), dst=picture)
        cv2.subtract(picture, self._darker[part].reshape(self._shape), dst=picture)
