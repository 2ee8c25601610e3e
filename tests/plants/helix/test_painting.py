"""The canvas paints parts of the picture only: they show what a picture shows that is painted as a whole."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.random import Generator

from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.plants.helix.cameras.painting import Backdrop, Canvas
from handover.plants.helix.cameras.shapes import Decal, Pixels, PolygonLayer, gripper
from handover.plants.helix.gripper_fingers import finger_joints

WIDTH, HEIGHT = 300, 170  # no multiples of a band or of a cell
ROUND = np.linspace(0.0, 2.0 * np.pi, 9)[:-1]


def backdrop(blur: float) -> Backdrop:
    p_WC = np.array([-0.95, 0.25, -0.60])
    q_WC = quaternion_of(looking_at(p_WC, np.array([0.0, 0.0, -0.62])))
    camera = Pinhole("small", p_WC, q_WC, np.array([210.0, 210.0, 150.0, 85.0]), np.zeros(5))
    return Backdrop(camera, WIDTH, HEIGHT, blur, gradient=0.22, light=1.0)


def octagons(rng: Generator, count: int, size: float) -> PolygonLayer:
    middle = rng.uniform([-20.0, -20.0], [WIDTH + 20.0, HEIGHT + 20.0], (count, 2))
    outlines = middle[:, None] + rng.uniform(1.0, size, (count, 1, 1)) * np.column_stack([np.cos(ROUND), np.sin(ROUND)])
    return PolygonLayer(
        rng.uniform(1.0, 2.0, count), outlines, rng.uniform(0.0, 255.0, (count, 3)), np.full(count, True)
    )


def square(x: float, y: float, side: float, opacity: int = 255) -> Decal:
    texture = np.full((12, 12, 4), opacity, dtype=np.uint8)
    corners = np.array([[x, y], [x + side, y], [x + side, y + side], [x, y + side]])
    return Decal(0.5, texture, corners)


def composed(canvas: Canvas, layers: list[PolygonLayer], decals: list[Decal]) -> Pixels:
    picture = np.array(canvas.backdrop.seen)
    for part, pixels in canvas.paint(layers, decals):
        picture[part] = pixels
    return picture


def painted_as_a_whole(behind: Backdrop, layers: list[PolygonLayer]) -> Pixels:
    fine = np.repeat(np.repeat(behind.plain, 2, axis=0), 2, axis=1)
    polygons = [(d, o, c) for x in layers for d, o, c in zip(x.depth, x.outlines, x.colours, strict=True)]
    for _, outline, colour in sorted(polygons, key=lambda x: -x[0]):
        corners = np.rint(16.0 * ((outline + 0.5) * 2.0 - 0.5)).astype(np.int32)
        cv2.fillConvexPoly(fine, corners, colour.tolist(), cv2.LINE_8, 4)
    coarse = cv2.resize(fine, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return behind.through_lens(np.asarray(coarse, dtype=np.uint8), 0, 0)


@pytest.mark.parametrize(("blur", "count", "size"), [(0.7, 1, 3.0), (0.0, 3, 30.0), (4.0, 40, 12.0), (0.7, 5, 200.0)])
def test_parts_show_what_the_whole_would(blur: float, count: int, size: float):
    rng, canvas = np.random.default_rng(count), Canvas(backdrop(blur))
    for _ in range(2):  # one picture leaves nothing to the next
        layers = [octagons(rng, count, size), octagons(rng, 1, 8.0)]
        np.testing.assert_array_equal(composed(canvas, layers, []), painted_as_a_whole(canvas.backdrop, layers))


def test_only_where_things_are_is_painted_and_neither_what_is_out_of_sight_nor_what_is_not_finite():
    canvas = Canvas(backdrop(0.7))
    parts = canvas.paint([], [square(100.0, 60.0, 20.0)])
    assert sum(pixels.size // 3 for _, pixels in parts) < 0.2 * WIDTH * HEIGHT
    assert any(np.any(pixels != canvas.backdrop.seen[part]) for part, pixels in parts)
    layer = octagons(np.random.default_rng(1), 2, 20.0)
    beside, hidden = layer.outlines[0] + 1000.0, layer.outlines[1].copy()
    hidden[3] = np.nan
    assert canvas.paint([replace(layer, outlines=np.array([beside, hidden]))], [square(-90.0, 5.0, 20.0)]) == []
    assert canvas.paint([], []) == []


def test_a_decal_hides_what_is_behind_it_by_its_opacity():
    canvas = Canvas(backdrop(0.0))
    layer = octagons(np.random.default_rng(2), 1, 20.0)
    wide = PolygonLayer(layer.depth, np.array([[[50.0, 50.0], [150.0, 50.0], [150.0, 120.0], [50.0, 120.0]]]),
                        np.array([[100.0, 100.0, 100.0]]), layer.outer)  # fmt: skip
    without = composed(canvas, [wide], [])[85, 100].astype(int)
    texture = np.zeros((12, 12, 4), dtype=np.uint8)
    texture[..., 3] = 128  # half black
    half = composed(canvas, [wide], [replace(square(90.0, 75.0, 20.0), texture=texture)])[85, 100].astype(int)
    np.testing.assert_allclose(half, without * (1.0 - 128.0 / 255.0), atol=1.5)
    behind = composed(canvas, [wide], [replace(square(90.0, 75.0, 20.0), depth=3.0)])[85, 100].astype(int)
    np.testing.assert_array_equal(behind, without)


def test_a_grippers_stem_ends_among_the_roots_of_its_fingers():
    p_WG, R_WG = np.array([0.1, 0.2, -0.6]), np.diag([1.0, -1.0, -1.0])
    stem = gripper(p_WG - 0.1 * R_WG[:, 2], p_WG, R_WG, 0.5).points[0]
    roots = finger_joints(p_WG, R_WG, 0.5)[:, 0]
    np.testing.assert_allclose((stem[-1] - p_WG) @ R_WG, [0.0, 0.0, ((roots - p_WG) @ R_WG)[:, 2].mean()], atol=3e-3)
