"""Paints a camera's picture: polygons and decals, from far to near, before the room, as the lens sees them.

`Backdrop` is the room behind the scene, and what lens and light do to a picture. `Canvas` paints the scene over it, at
twice the picture's resolution.
"""

import functools
import math
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.cameras.polygon_filling import SHIFT, Polygons, fill
from handover.plants.helix.cameras.shapes import Decal, Pixels, PolygonLayer

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
        reach: how far the blur of a pixel reaches, in px.

    Args:
        camera: whose view it is.
        width, height: size of the picture in px.
        blur: standard deviation of the lens's blur, in px.
        gradient: relative difference of brightness between the picture's lit and its unlit corner.
        light: brightness over that of the colours.
    """

    def __init__(self, camera: Pinhole, width: int, height: int, blur: float, gradient: float, light: float) -> None:
        self._light = light
        self.reach = int(np.ceil(2.5 * blur))
        self._blur = blur
        self._gain = _gain(width, height, gradient)
        self.plain = _room(camera, width, height)
        self.seen = self.through_lens(self.plain, 0, 0)

    def through_lens(self, part: Pixels, x0: int, y0: int) -> Pixels:
        """Return a part of a picture, whose upper left pixel is (x0, y0), under the light's gradient, and blurred."""
        h, w = part.shape[:2]
        lit = cv2.multiply(part, self._gain[y0 : y0 + h, x0 : x0 + w], scale=self._light / _FULL_GAIN)
        if self.reach == 0:
            return np.asarray(lit, dtype=np.uint8)
        side = 2 * self.reach + 1
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
_FAR = 20000.0  # px; beyond, OpenCV's fixed point would overflow
_CELL = 4  # px; side of the cells in which it is noted where there are outlines
_BAND = 72  # px; height of the bands, each of which is painted from its leftmost thing to its rightmost
_CELL_SHIFT = SHIFT + (_FINE * _CELL).bit_length() - 1  # fractional bits of polygon corners, in cells
_CELL_OFFSET = ((1 << _CELL_SHIFT) - (1 << SHIFT)) // 2  # from a cell's middle to that of its upper left canvas pixel

Points = NDArray[np.int32]
Part = tuple[slice, slice]
"""Rows and columns of a picture."""


class Canvas:
    """Makes pictures of things before a backdrop; only where things are, anything is painted.

    Args:
        backdrop: what is behind everything, with the lens's blur and the light's gradient.
    """

    def __init__(self, backdrop: Backdrop) -> None:
        self.backdrop = backdrop
        plain = backdrop.plain
        height, width = plain.shape[:2]
        self._behind = np.repeat(plain, _FINE, axis=1)[:, None]  # rows are repeated as they are copied
        self._fine = np.empty((_FINE * height, _FINE * width, 3), dtype=np.uint8)
        self._by_row = self._fine.reshape(height, _FINE, _FINE * width, 3)
        self._size = np.array([plain.shape[1], plain.shape[0]])
        # what the blur reaches, and one cell more: a line may miss a cell of which it cuts a corner
        side = 2 * (1 + math.ceil((backdrop.reach + 1) / _CELL)) + 1
        self._around = np.ones((side, side), dtype=np.uint8)

    def paint(self, layers: Sequence[PolygonLayer], decals: Sequence[Decal]) -> list[tuple[Part, Pixels]]:
        """Return the parts of the picture where it is not the backdrop, as the lens sees them, without noise.

        What is partly behind the camera is left out.
        """
        squares = PolygonLayer(
            np.array([d.depth for d in decals]),
            np.array([d.corners for d in decals]).reshape(-1, 4, 2),
            np.empty((0, 3)),
            np.full(len(decals), True),
        )
        things = [*layers, squares]
        counts = [np.full(len(x.depth), x.outlines.shape[1]) for x in things]
        first = np.cumsum(np.concatenate([[0], *counts]))
        with np.errstate(invalid="ignore"):  # what is not finite is not in sight, either
            corners = np.rint(_on_canvas(np.concatenate([x.outlines.reshape(-1, 2) for x in things])) * (1 << SHIFT))
            fixed = corners.astype(np.int32)
            colours = np.rint(np.concatenate([x.colours for x in things])).astype(np.uint8)
        seen, inside = self._in_sight([x.outlines for x in things])
        outer = np.concatenate([x.outer for x in things]) & seen
        in_cells = fixed - _CELL_OFFSET
        painted = self._parts(
            [in_cells[first[i] : first[i + 1]] for i in np.flatnonzero(outer & inside).tolist()],
            [in_cells[first[i] : first[i + 1]] for i in np.flatnonzero(outer & ~inside).tolist()],
        )
        wide = [self._widened(part) for part in painted]
        for rows, columns in wide:
            fine = slice(_FINE * columns.start, _FINE * columns.stop)
            self._by_row[rows, :, fine] = self._behind[rows, :, fine]
        polygons, n = Polygons(fixed, first, colours), len(colours)
        depths = np.concatenate([x.depth for x in things])
        shown = np.flatnonzero(seen)
        order = shown[np.argsort(-depths[shown], kind="stable")]
        start = 0
        for place in np.flatnonzero(order >= n).tolist():
            fill(self._fine, polygons, order[start:place])
            decal = decals[int(order[place]) - n]
            _paint_decal(self._fine, decal.texture, _on_canvas(decal.corners))
            start = place + 1
        fill(self._fine, polygons, order[start:])
        return [(part, self._exposed(part, *area)) for part, area in zip(painted, wide, strict=True)]

    def _exposed(self, part: Part, rows: slice, columns: slice) -> Pixels:
        """Return a part of the picture, from that part of the canvas on which it depends."""
        fine = self._fine[_FINE * rows.start : _FINE * rows.stop, _FINE * columns.start : _FINE * columns.stop]
        size = (columns.stop - columns.start, rows.stop - rows.start)
        coarse = np.asarray(cv2.resize(fine, size, interpolation=cv2.INTER_AREA), dtype=np.uint8)
        seen = self.backdrop.through_lens(coarse, columns.start, rows.start)
        top, left = part[0].start - rows.start, part[1].start - columns.start
        return seen[top : top + part[0].stop - part[0].start, left : left + part[1].stop - part[1].start]

    def _in_sight(self, outlines: Sequence[Floats]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return which outlines, of shapes (p, n, 2) one after another, are in the picture in part, which wholly."""
        corners = [np.ascontiguousarray(np.swapaxes(x, 0, 1)) for x in outlines]  # (n, p, 2): much faster to reduce
        low, high = np.concatenate([x.min(axis=0) for x in corners]), np.concatenate([x.max(axis=0) for x in corners])
        seen = (high > -1.0) & (low < self._size) & (high < _FAR) & (low > -_FAR)
        inside = (low >= 0.0) & (high < self._size)
        return seen[:, 0] & seen[:, 1], inside[:, 0] & inside[:, 1]

    def _parts(self, inside: list[Points], crossing: list[Points]) -> list[Part]:
        """Return the parts of the picture that things touch or lie between: one of each band, with what the blur adds.

        Args:
            inside: outlines in the picture.
            crossing: outlines that a border of the picture cuts.
        """
        width, height = self._size.tolist()
        bands = -(-height // _BAND)
        cells = np.zeros((bands * _BAND // _CELL, -(-width // _CELL)), dtype=np.uint8)
        cv2.polylines(cells, inside, True, (1,), 1, cv2.LINE_8, _CELL_SHIFT)
        for outline in crossing:
            cv2.fillConvexPoly(cells, outline, (1,), cv2.LINE_8, _CELL_SHIFT)
        dilated = np.asarray(cv2.dilate(cells, self._around), dtype=np.uint8)
        columns = cells.shape[1]
        touched = np.any(dilated.reshape(bands, -1, columns), axis=1).reshape(bands, columns)
        start = (_CELL * touched.argmax(axis=1)).tolist()
        stop = (_CELL * (columns - touched[:, ::-1].argmax(axis=1))).tolist()
        return [
            (slice(_BAND * i, min(_BAND * (i + 1), height)), slice(start[i], min(stop[i], width)))
            for i in np.flatnonzero(np.any(touched, axis=1)).tolist()
        ]

    def _widened(self, part: Part) -> Part:
        """Return a part with all that its blur depends on."""
        width, height = self._size.tolist()
        rows, columns = part
        reach = self.backdrop.reach
        return (
            slice(max(rows.start - reach, 0), min(rows.stop + reach, height)),
            slice(max(columns.start - reach, 0), min(columns.stop + reach, width)),
        )


def _on_canvas(pixels: Floats) -> Floats:
    """Return canvas pixels; whole coordinates are centres of pixels in both pictures."""
    return (pixels + 0.5) * _FINE - 0.5


def _paint_decal(fine: Pixels, texture: Pixels, corners: Floats) -> None:
    """Warp a texture onto the canvas and blend it in."""
    height, width = fine.shape[:2]
    us, vs = np.transpose(corners).tolist()
    x0, y0 = max(math.floor(min(us)), 0), max(math.floor(min(vs)), 0)
    x1, y1 = min(math.ceil(max(us)) + 1, width), min(math.ceil(max(vs)) + 1, height)
    if x1 <= x0 or y1 <= y0:
        return
    H = cv2.getPerspectiveTransform(_texture_corners(*texture.shape[:2]), (corners - (x0, y0)).astype(np.float32))
    warped = cv2.warpPerspective(texture, H, (x1 - x0, y1 - y0), flags=cv2.INTER_LINEAR)
    through = cv2.cvtColor(cv2.bitwise_not(cv2.extractChannel(warped, 3)), cv2.COLOR_GRAY2BGR)
    patch = fine[y0:y1, x0:x1]
    behind = cv2.multiply(patch, through, scale=1.0 / 255.0)
    patch[:] = cv2.add(behind, cv2.cvtColor(warped, cv2.COLOR_BGRA2BGR))


@functools.cache
def _texture_corners(height: int, width: int) -> NDArray[np.float32]:
    """Return the corners of a texture's area, not the middles of its pixels."""
    return np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=np.float32) - np.float32(0.5)
