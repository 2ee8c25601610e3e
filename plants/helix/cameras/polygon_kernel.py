"""A compiled kernel that fills convex polygons as OpenCV's `fillConvexPoly` does, bit by bit.

That is: the outline as 8-connected lines, then the rows between the two chains of edges that lead down from the topmost
corner, all in OpenCV's fixed point. Follows `FillConvexPoly`, `Line2` and `clipLine` in OpenCV's drawing.cpp.
"""

import numpy as np
from numpy.typing import NDArray

from handover.plants.helix import compiled as kernels  # a module: see `polygon_filling`
from handover.plants.helix.cameras import polygon_filling
from handover.plants.helix.cameras.polygon_filling import SHIFT, Polygons

_ONE = 1 << 16  # OpenCV's fixed point, in which lines and edges are followed
_HALF = _ONE >> 1
_FINER = 16 - SHIFT


@kernels.compiled
def _beyond(x: int, y: int, right: int, bottom: int) -> int:
    """Return on which sides a point is beyond: 1 left, 2 right, 4 above, 8 below."""
    return (1 if x < 0 else 0) | (2 if x > right else 0) | (4 if y < 0 else 0) | (8 if y > bottom else 0)


@kernels.compiled
def _clip(x0: int, y0: int, x1: int, y1: int, right: int, bottom: int) -> tuple[bool, int, int, int, int]:
    """Return whether a line is visible, and its ends on the canvas. OpenCV: `clipLine`."""
    c0, c1 = _beyond(x0, y0, right, bottom), _beyond(x1, y1, right, bottom)
    if c0 & c1 == 0 and c0 | c1 != 0:
        if c0 & 12:
            a = 0 if c0 < 8 else bottom
            x0, y0 = x0 + int(float(a - y0) * (x1 - x0) / (y1 - y0)), a
            c0 = _beyond(x0, y0, right, bottom)
        if c1 & 12:
            a = 0 if c1 < 8 else bottom
            x1, y1 = x1 + int(float(a - y1) * (x1 - x0) / (y1 - y0)), a
            c1 = _beyond(x1, y1, right, bottom)
        if c0 & c1 == 0 and c0 | c1 != 0:
            if c0:
                a = 0 if c0 == 1 else right
                x0, y0 = a, y0 + int(float(a - x0) * (y1 - y0) / (x1 - x0))
                c0 = 0
            if c1:
                a = 0 if c1 == 1 else right
                x1, y1 = a, y1 + int(float(a - x1) * (y1 - y0) / (x1 - x0))
                c1 = 0
    return c0 | c1 == 0, x0, y0, x1, y1


@kernels.compiled
def _draw_line(canvas: NDArray[np.uint8], x0: int, y0: int, x1: int, y1: int, colour: NDArray[np.uint8]) -> None:
    """Draw an 8-connected line between points in OpenCV's fixed point. OpenCV: `Line2`."""
    height, width = canvas.shape[:2]
    is_visible, x0, y0, x1, y1 = _clip(x0, y0, x1, y1, width * _ONE - 1, height * _ONE - 1)
    if not is_visible:
        return
    dx, dy = x1 - x0, y1 - y0
    steep = abs(dx) <= abs(dy)
    if (dy if steep else dx) < 0:
        x0, y0, x1, y1, dx, dy = x1, y1, x0, y0, -dx, -dy
    long, short = (dy, dx) if steep else (dx, dy)
    # the quotient is rounded towards zero, as in C
    size = abs(short) * _ONE // (long | 1)
    slope = size if short >= 0 else -size
    count = (y1 - y0 if steep else x1 - x0) >> 16
    x, y = x0 + _HALF, y0 + _HALF
    b, g, r = colour[0], colour[1], colour[2]
    for k in range(count + 2):
        row, column = y >> 16, x >> 16
        if k > count:  # the end, which the slope may have missed
            row, column = (y1 + _HALF) >> 16, (x1 + _HALF) >> 16
        if 0 <= row < height and 0 <= column < width:
            canvas[row, column, 0] = b
            canvas[row, column, 1] = g
            canvas[row, column, 2] = r
        if steep:
            y += _ONE
            x += slope
        else:
            x += _ONE
            y += slope


@kernels.compiled
def _row(corners: NDArray[np.int32], i: int) -> int:
    """Return the row of the canvas in which a corner is."""
    return (int(corners[i, 1]) + (1 << SHIFT >> 1)) >> SHIFT


@kernels.compiled
def _next_edge(
    corners: NDArray[np.int32], start: int, n: int, at: int, step: int, left: int, y: int
) -> tuple[int, int, int, int, int]:
    """Return the edge of a chain that goes on below row y.

    Args:
        corners: of all polygons.
        start: where the polygon begins.
        n: how many corners it has.
        at: corner at which the chain is.
        step: 1 or n - 1, the chain's direction.
        left: edges of the polygon that are in neither chain.
        y: row of the canvas.

    Returns:
        The corner where the edge ends, the row where it does, its x in row y, x a row, and the edges left, -1 if the
        chain has ended.
    """
    while left > 0:
        left -= 1
        to = (at + step) % n
        row = _row(corners, start + to)
        if row > y:
            x0, x1 = int(corners[start + at, 0]) << _FINER, int(corners[start + to, 0]) << _FINER
            rise = 2 * (x1 - x0) + (row - y)
            rows = 2 * (row - y)
            size = abs(rise) // rows  # rounded towards zero, as in C
            return to, row, x0, size if rise >= 0 else -size, left
        at = to
    return at, y, 0, 0, -1


@kernels.compiled
def _fill_rows(
    canvas: NDArray[np.uint8], corners: NDArray[np.int32], start: int, n: int, colour: NDArray[np.uint8]
) -> None:
    """Fill the rows between the chains of edges that go down from the topmost corner."""
    top, bottom = 0, 0
    for i in range(1, n):
        if corners[start + i, 1] < corners[start + top, 1]:
            top = i
        if corners[start + i, 1] > corners[start + bottom, 1]:
            bottom = i
    y0, y1 = _row(corners, start + top), _row(corners, start + bottom)
    at_a, at_b, end_a, end_b, x_a, x_b, dx_a, dx_b = top, top, y0, y0, -_ONE, -_ONE, 0, 0
    left = n
    bytes_of_canvas, width = canvas.reshape(-1), canvas.shape[1]
    b, g, r = colour[0], colour[1], colour[2]
    for y in range(y0, min(y1, canvas.shape[0] - 1) + 1):
        if y >= end_a:
            to, row, x, dx, left = _next_edge(corners, start, n, at_a, 1, left, y)
            if left >= 0:
                at_a, end_a, x_a, dx_a = to, row, x, dx
        if left >= 0 and y >= end_b:
            to, row, x, dx, left = _next_edge(corners, start, n, at_b, n - 1, left, y)
            if left >= 0:
                at_b, end_b, x_b, dx_b = to, row, x, dx
        if left < 0:
            return
        begin, end = max((min(x_a, x_b) + _HALF) >> 16, 0), min(((max(x_a, x_b) + _HALF) >> 16) + 1, width)
        if y >= 0 and begin < end:
            line = bytes_of_canvas[3 * (y * width + begin) : 3 * (y * width + end)]  # much faster than canvas[y, x]
            for j in range(end - begin):
                line[3 * j] = b
                line[3 * j + 1] = g
                line[3 * j + 2] = r
        x_a += dx_a
        x_b += dx_b


@kernels.compiled_once(__name__, polygon_filling.__name__)
def _fill(
    canvas: NDArray[np.uint8],
    corners: NDArray[np.int32],
    first: NDArray[np.int64],
    colours: NDArray[np.uint8],
    order: NDArray[np.int64],
) -> None:
    for i in order:
        start, stop = int(first[i]), int(first[i + 1])
        x0, y0 = int(corners[stop - 1, 0]) << _FINER, int(corners[stop - 1, 1]) << _FINER
        for j in range(start, stop):
            x1, y1 = int(corners[j, 0]) << _FINER, int(corners[j, 1]) << _FINER
            _draw_line(canvas, x0, y0, x1, y1, colours[i])
            x0, y0 = x1, y1
        _fill_rows(canvas, corners, start, stop - start, colours[i])


def fill_by_kernel(canvas: NDArray[np.uint8], polygons: Polygons, order: NDArray[np.int64]) -> None:
    """Fill the polygons with these numbers, in this order, by the kernel."""
    _fill(canvas, *polygons, order)
