"""Paints sketches and decals from far to near over a backdrop, at twice the picture's resolution."""

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.plants.backdrop import Backdrop
from handover.plants.sketch import Decal, Pixels, Sketch

_FINE = 2  # canvas pixels a picture pixel, each way: with the blur, edges come out smooth
_SHIFT = 4  # fractional bits of polygon corners
_FAR = 20000.0  # px; beyond, OpenCV's fixed point would overflow
_MARGIN = 4  # px around what is painted; covers the blur


class Canvas:
    """Makes pictures of things before a backdrop; only the part that they touch is painted.

    Args:
        backdrop: what is behind everything, with the lens's blur and the light's gradient.
    """

    def __init__(self, backdrop: Backdrop) -> None:
        self._backdrop = backdrop
        plain = backdrop.plain
        fine = cv2.resize(plain, None, fx=_FINE, fy=_FINE, interpolation=cv2.INTER_NEAREST)
        self._fine = np.asarray(fine, dtype=np.uint8)
        self._size = np.array([plain.shape[1], plain.shape[0]])

    def picture(self, sketches: Sequence[Sketch], decals: Sequence[Decal]) -> Pixels:
        """Return the picture, without noise. What is partly behind the camera is left out."""
        picture = np.array(self._backdrop.seen)
        outlines = [s.outlines.reshape(len(s.depth), -1, 2) for s in sketches] + [d.corners[None] for d in decals]
        seen, low, high = zip(*[self._extent(points) for points in outlines], strict=True)
        low, high = np.concatenate(low), np.concatenate(high)
        if not len(low):
            return picture
        x0, y0 = np.maximum(np.floor(low.min(axis=0)).astype(int) - _MARGIN, 0).tolist()
        x1, y1 = np.minimum(np.ceil(high.max(axis=0)).astype(int) + _MARGIN + 1, self._size).tolist()
        fine = np.array(self._fine[_FINE * y0 : _FINE * y1, _FINE * x0 : _FINE * x1])
        corner = np.array([x0, y0])
        things: list[tuple[float, NDArray[np.int32] | Decal, list[list[float]]]] = []
        for sketch, s in zip(sketches, seen, strict=False):
            on_canvas = np.rint(_on_canvas(sketch.outlines[s], corner) * (1 << _SHIFT)).astype(np.int32)
            things += zip(sketch.depth[s].tolist(), on_canvas, sketch.colours[s].tolist(), strict=True)
        things += [(d.depth, d, []) for d, s in zip(decals, seen[len(sketches) :], strict=True) if s[0]]
        for _, thing, colours in sorted(things, key=lambda x: -x[0]):
            if isinstance(thing, Decal):
                _stick(fine, thing.texture, _on_canvas(thing.corners, corner))
                continue
            for polygon, colour in zip(thing, colours, strict=True):
                cv2.fillConvexPoly(fine, polygon, colour, cv2.LINE_8, _SHIFT)
        coarse = cv2.resize(fine, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)
        picture[y0:y1, x0:x1] = self._backdrop.through_lens(np.asarray(coarse, dtype=np.uint8), x0, y0)
        return picture

    def _extent(self, points: Floats) -> tuple[NDArray[np.bool_], Floats, Floats]:
        """Return which things, of points (m, n, 2), are in the picture, and their smallest and largest pixels."""
        by_axis = np.ascontiguousarray(np.moveaxis(points, 2, 0))  # (2, m, n): much faster to reduce
        low, high = np.transpose(by_axis.min(axis=2)), np.transpose(by_axis.max(axis=2))
        seen = np.all((high >= 0.0) & (low < self._size) & (high < _FAR) & (low > -_FAR), axis=1)
        return seen, low[seen], high[seen]


def _on_canvas(pixels: Floats, corner: NDArray[np.int64]) -> Floats:
    """Return canvas pixels; whole numbers are the middles of pixels on both sides."""
    return (pixels - corner + 0.5) * _FINE - 0.5


def _stick(fine: Pixels, texture: Pixels, corners: Floats) -> None:
    """Warp a texture onto the canvas and blend it in."""
    height, width = fine.shape[:2]
    x0, y0 = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, [width, height]).tolist()
    x1, y1 = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, [width, height]).tolist()
    if x1 <= x0 or y1 <= y0:
        return
    h, w = texture.shape[:2]
    source = np.array([[0, 0], [w, 0], [w, h], [0, h]], dtype=np.float32) - np.float32(0.5)  # of areas, not middles
    H = cv2.getPerspectiveTransform(source, (corners - [x0, y0]).astype(np.float32))
    warped = cv2.warpPerspective(texture, H, (x1 - x0, y1 - y0), flags=cv2.INTER_LINEAR)
    patch = fine[y0:y1, x0:x1]
    through = 255 - np.asarray(warped[..., 3:], dtype=np.uint16)
    patch[:] = (patch * through + 127) // 255 + warped[..., :3]
