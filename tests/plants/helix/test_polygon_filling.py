"""Filling convex polygons: the compiled kernel and the same as plain Python, against OpenCV, bit by bit."""

import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.random import Generator
from numpy.typing import NDArray

from handover.plants.helix.cameras.polygon_filling import SHIFT, Polygons, fill_by_opencv
from handover.plants.helix.cameras.polygon_kernel import fill_by_kernel

HOUSE = Path(__file__).parents[3]
HEIGHT, WIDTH = 60, 90
COLOUR = (10, 20, 30)


def convex(rng: Generator, size: float) -> NDArray[np.int32]:
    """Return the corners of a polygon in an ellipse about a point on the canvas or somewhat beside it."""
    angle = np.sort(rng.uniform(0.0, 2.0 * np.pi, int(rng.integers(3, 20))))
    middle = rng.uniform([-20.0, -20.0], [WIDTH + 20.0, HEIGHT + 20.0])
    corners = middle + rng.uniform(0.1, size, 2) * np.column_stack([np.cos(angle), np.sin(angle)])
    ways = corners if rng.random() < 0.5 else corners[::-1]
    return np.rint(ways * (1 << SHIFT)).astype(np.int32)


def together(polygons: list[NDArray[np.int32]]) -> Polygons:
    first = np.cumsum([0, *(len(p) for p in polygons)])
    colours = np.arange(3 * len(polygons)).reshape(-1, 3) % 251 + 1
    return Polygons(np.concatenate(polygons), first, colours.astype(np.uint8))


def differing(seed: int, size: float, count: int) -> list[list[list[int]]]:
    """Return those of random polygons that the kernel fills otherwise than OpenCV does."""
    rng = np.random.default_rng(seed)
    faulty: list[list[list[int]]] = []
    for _ in range(count):
        corners = convex(rng, size)
        expected, filled = np.zeros((2, HEIGHT, WIDTH, 3), dtype=np.uint8)
        cv2.fillConvexPoly(expected, corners, COLOUR, cv2.LINE_8, SHIFT)
        one = Polygons(corners, np.array([0, len(corners)]), np.array([COLOUR], dtype=np.uint8))
        fill_by_kernel(filled, one, np.array([0]))
        if not np.array_equal(filled, expected):
            faulty.append(corners.tolist())
    return faulty


@pytest.mark.parametrize("size", [1.0, 8.0, 40.0, 300.0])
def test_a_polygon_is_filled_as_opencv_does_inside_and_over_the_borders(size: float):
    assert differing(1, size, 400) == []


def test_plain_python_fills_as_opencv_does():
    code = f"import sys; sys.path[:0] = [{str(HOUSE)!r}, {str(Path(__file__).parent)!r}]\n"
    code += "import test_polygon_filling as t\n"
    code += "from handover.plants.helix.compiled import IS_COMPILED\n"
    code += "print(IS_COMPILED, t.differing(2, 25.0, 60) + t.differing(3, 200.0, 20))"
    plain = {**os.environ, "HANDOVER_COMPILE": "0"}
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, env=plain)
    assert done.stdout.strip() == "False []", done.stderr


def test_later_polygons_of_the_order_hide_earlier_ones():
    rng = np.random.default_rng(4)
    polygons, order = together([convex(rng, 30.0) for _ in range(200)]), rng.permutation(200)[:150]
    by_kernel, by_opencv = np.zeros((2, HEIGHT, WIDTH, 3), dtype=np.uint8)
    fill_by_kernel(by_kernel, polygons, order)
    fill_by_opencv(by_opencv, polygons, order)
    np.testing.assert_array_equal(by_kernel, by_opencv)
    backwards = np.zeros_like(by_kernel)
    fill_by_kernel(backwards, polygons, order[::-1])
    assert np.any(backwards != by_kernel)
    canvas = by_kernel.copy()
    fill_by_kernel(canvas, polygons, np.array([], dtype=np.int64))
    np.testing.assert_array_equal(canvas, by_kernel)
