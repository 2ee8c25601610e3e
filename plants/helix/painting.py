"""Paints a camera's picture: polygons and decals, from far to near, before the room, as the lens sees them.

`Backdrop` is the room behind the scene, and what lens and light do to a picture. `Canvas` paints the scene over it, at
twice the picture's resolution.
"""

import functools
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.shapes import Decal, Pixels, PolygonLayer

_WALL = 1.7  # m; x of a wall opposite the cameras
_FLOOR = -1.35  # m; its z
_TEXTURE = 450.0  # texture px a metre
_FULL_GAIN = 200.0  # level of the gain map that leaves a colour as it is
_GRID = 8  # px between the rays that are computed; those between are interpolated


class Backdrop:
    """A plain wall with a darker panel above a wooden floor, lit from the upper left.

    Attributes:
        plain: the room as a sharp lens under even light would show it, shape (height, width, 3).
        seen: the same through the lens.

    Args:
        camera: whose view it is.
        width, height: size of the picture in px.
        blur: standard deviation of the lens's blur, in px.
        gradient: relative difference of brightness between the picture's lit and its unlit corner.
    """

    def __init__(self, camera: Pinhole, width: int, height: int, blur: float, gradient: float) -> None:
        self._blur = blur
        self._gain = _gain(width, height, gradient)
        self.plain = _room(camera, width, height)
        self.seen = self.through_lens(self.plain, 0, 0)

    def through_lens(self, part: Pixels, x0: int, y0: int) -> Pixels:
        """Return a part of a picture, whose upper left pixel is (x0, y0), under the light's gradient, and blurred."""
        h, w = part.shape[:2]
        lit = cv2.multiply(part, self._gain[y0 : y0 + h, x0 : x0 + w], scale=1.0 / _FULL_GAIN)
        if self._blur == 0.0:
            return np.asarray(lit, dtype=np.uint8)
        side = 2 * int(np.ceil(2.5 * self._blur)) + 1
        return np.asarray(cv2.GaussianBlur(lit, (side, side), self._blur), dtype=np.uint8)


def _gain(width: int, height: int, gradient: float) -> Pixels:
    across = np.linspace(0.5, -0.5, width) + np.linspace(0.5, -0.5, height)[:, None]
    gain = np.clip(np.rint(_FULL_GAIN * (1.0 + 0.5 * gradient * across)), 0.0, 255.0).astype(np.uint8)
    return np.repeat(gain[:, :, None], 3, axis=2)


def _room(camera: Pinhole, width: int, height: int) -> Pixels:
    us, vs = np.arange(0, width + _GRID, _GRID), np.arange(0, height + _GRID, _GRID)
    grid = np.stack(np.meshgrid(us, vs), axis=2).reshape(-1, 2).astype(np.float64)
    rays = camera.rays(grid)
    to_wall = (_WALL - camera.p_WC[0]) / np.where(rays[:, 0] > 1e-3, rays[:, 0], 1e-3)
    on_wall = camera.p_WC + to_wall[:, None] * rays
    to_floor = (_FLOOR - camera.p_WC[2]) / np.where(rays[:, 2] < -1e-6, rays[:, 2], -1e-6)
    on_floor = camera.p_WC + to_floor[:, None] * rays
    shape = (len(vs), len(us))
    wall = _look_up(_wall_texture(), on_wall[:, [1, 2]].reshape(*shape, 2), (2.5, 0.6), width, height)
    floor = _look_up(_floor_texture(), on_floor[:, [1, 0]].reshape(*shape, 2), (2.5, _WALL), width, height)
    height_on_wall = np.clip(on_wall[:, 2], -5.0, 5.0).reshape(shape)
    below = _fine(height_on_wall, width, height) < _FLOOR
    return np.where(below[:, :, None], floor, wall)


def _look_up(texture: Pixels, metres: Floats, origin: tuple[float, float], width: int, height: int) -> Pixels:
    """Return the texture as seen; metres, shape (h, w, 2), lie on its plane, and count against its axes."""
    rows, columns = texture.shape[:2]
    at = np.clip((np.array(origin) - metres) * _TEXTURE, 0, [columns - 1, rows - 1])
    u, v = _fine(at[..., 0], width, height), _fine(at[..., 1], width, height)
    return np.asarray(cv2.remap(texture, u, v, cv2.INTER_LINEAR), dtype=np.uint8)


def _fine(coarse: Floats, width: int, height: int) -> NDArray[np.float32]:
    """Return values on every pixel from those on the grid."""
    u, v = np.meshgrid(np.arange(width, dtype=np.float32) / _GRID, np.arange(height, dtype=np.float32) / _GRID)
    return np.asarray(cv2.remap(coarse.astype(np.float32), u, v, cv2.INTER_LINEAR), dtype=np.float32)


@functools.cache
def _wall_texture() -> Pixels:
    """Return plaster, 5 m wide and 1.8 m high, with a skirting of panels; drawn from a fixed seed."""
    rows, columns = int(1.8 * _TEXTURE), int(5.0 * _TEXTURE)
    shade = _mottled(rows, columns, (260, 60), 3.0, seed=11)
    wall = np.array([186.0, 192.0, 196.0]) + shade[:, :, None]
    top = int(1.05 * _TEXTURE)
    wall[top:] = np.array([128.0, 134.0, 140.0]) + shade[top:, :, None]
    wall[top - 5 : top] = (104.0, 110.0, 114.0)
    for joint in range(int(0.25 * _TEXTURE), columns, int(0.8 * _TEXTURE)):
        wall[top:, joint : joint + 3] -= 30.0
    return np.clip(wall, 0.0, 255.0).astype(np.uint8)


@functools.cache
def _floor_texture() -> Pixels:
    """Return grained wood, the grain along y."""
    rows, columns = int(2.7 * _TEXTURE), int(5.0 * _TEXTURE)
    grain = np.random.default_rng(12).normal(0.0, 14.0, (rows, 40)).astype(np.float32)
    grain = np.asarray(cv2.resize(cv2.GaussianBlur(grain, (0, 0), 2.0), (columns, rows)), dtype=np.float64)
    shade = grain + _mottled(rows, columns, (100,), 5.0, seed=13)
    return np.clip(np.array([84.0, 112.0, 142.0]) + shade[:, :, None], 0.0, 255.0).astype(np.uint8)


def _mottled(rows: int, columns: int, scales: tuple[int, ...], amplitude: float, seed: int) -> Floats:
    rng = np.random.default_rng(seed)
    shade = np.zeros((rows, columns))
    for scale in scales:
        knots = rng.normal(0.0, amplitude, (rows // scale + 2, columns // scale + 2)).astype(np.float32)
        shade += cv2.resize(knots, (columns, rows), interpolation=cv2.INTER_CUBIC)
    return shade


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

    def picture(self, layers: Sequence[PolygonLayer], decals: Sequence[Decal]) -> Pixels:
        """Return the picture, without noise. What is partly behind the camera is left out."""
        picture = np.array(self._backdrop.seen)
        outlines = [s.outlines.reshape(len(s.depth), -1, 2) for s in layers] + [d.corners[None] for d in decals]
        seen, low, high = zip(*[self._extent(points) for points in outlines], strict=True)
        low, high = np.concatenate(low), np.concatenate(high)
        if not len(low):
            return picture
        x0, y0 = np.maximum(np.floor(low.min(axis=0)).astype(int) - _MARGIN, 0).tolist()
        x1, y1 = np.minimum(np.ceil(high.max(axis=0)).astype(int) + _MARGIN + 1, self._size).tolist()
        fine = np.array(self._fine[_FINE * y0 : _FINE * y1, _FINE * x0 : _FINE * x1])
        corner = np.array([x0, y0])
        things: list[tuple[float, NDArray[np.int32] | Decal, list[list[float]]]] = []
        for layer, s in zip(layers, seen, strict=False):
            on_canvas = np.rint(_on_canvas(layer.outlines[s], corner) * (1 << _SHIFT)).astype(np.int32)
            things += zip(layer.depth[s].tolist(), on_canvas, layer.colours[s].tolist(), strict=True)
        things += [(d.depth, d, []) for d, s in zip(decals, seen[len(layers) :], strict=True) if s[0]]
        for _, thing, colours in sorted(things, key=lambda x: -x[0]):
            if isinstance(thing, Decal):
                _paint_decal(fine, thing.texture, _on_canvas(thing.corners, corner))
                continue
            for polygon, colour in zip(thing, colours, strict=True):
                cv2.fillConvexPoly(fine, polygon, colour, cv2.LINE_8, _SHIFT)
        coarse = cv2.resize(fine, (x1 - x0, y1 - y0), interpolation=cv2.INTER_AREA)
        picture[y0:y1, x0:x1] = self._backdrop.through_lens(np.asarray(coarse, dtype=np.uint8), x0, y0)
        return picture

    def _extent(self, points: Floats) -> tuple[NDArray[np.bool_], Floats, Floats]:
        """Return which things, with points (m, n, 2), are in the picture, and their smallest and largest pixels."""
        by_axis = np.ascontiguousarray(np.moveaxis(points, 2, 0))  # (2, m, n): much faster to reduce
        low, high = np.transpose(by_axis.min(axis=2)), np.transpose(by_axis.max(axis=2))
        seen = np.all((high >= 0.0) & (low < self._size) & (high < _FAR) & (low > -_FAR), axis=1)
        return seen, low[seen], high[seen]


def _on_canvas(pixels: Floats, corner: NDArray[np.int64]) -> Floats:
    """Return canvas pixels; whole coordinates are centres of pixels in both pictures."""
    return (pixels - corner + 0.5) * _FINE - 0.5


def _paint_decal(fine: Pixels, texture: Pixels, corners: Floats) -> None:
    """Warp a texture onto the canvas and blend it in."""
    height, width = fine.shape[:2]
    x0, y0 = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, [width, height]).tolist()
    x1, y1 = np.clip(np.ceil(corners.max(axis=0)).astype(int) + 1, 0, [width, height]).tolist()
    if x1 <= x0 or y1 <= y0:
        return
    h, w = texture.shape[:2]
    source = np.array([[0, 0], [w, 0], [w, h], [0, h]], dtype=np.float32) - np.float32(
        0.5
    )  # corners of the area, not centres of pixels
    H = cv2.getPerspectiveTransform(source, (corners - [x0, y0]).astype(np.float32))
    warped = cv2.warpPerspective(texture, H, (x1 - x0, y1 - y0), flags=cv2.INTER_LINEAR)
    patch = fine[y0:y1, x0:x1]
    through = 255 - np.asarray(warped[..., 3:], dtype=np.uint16)
    patch[:] = (patch * through + 127) // 255 + warped[..., :3]
