"""What there is to paint before each camera: arm, gripper, ball and hand, as polygons and decals with depths.

`Tube` is the ribbed soft arm, `ShadedBall` the glossy green ball, `MarkerCollar` the octagonal collar at the wrist with
one fiducial marker or two on each side; `HandoverScene` puts them together, for all cameras at once: most of the
time goes into calls of numpy with a few numbers each.
"""

import math
from collections.abc import Sequence
from typing import Protocol

import cv2
import numpy as np

from handover.cosim.blocks.geometry import Pinhole, rotation_of, skew
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.cameras.shapes import (
    Decal,
    Light,
    Pixels,
    PolygonLayer,
    ShadedLimbs,
    bowl_layers,
    gripper,
    hand,
    together,
)
from handover.plants.helix.hand.bowl import Bowl

_RIB_LENGTH = 0.008  # m; ribs and gaps alternate
_STRIPS = 7  # across the visible half, each of one shade
_COLOURS = np.array([[172.0, 166.0, 160.0], [92.0, 86.0, 80.0]])  # of a rib, of a gap
_THICKNESS = np.array([1.0, 0.86])  # of a rib, of a gap
_EDGES = np.linspace(-1.0, 1.0, _STRIPS + 1)  # of the strips, from the axis, over the thickness
_MIDDLE = 0.5 * (_EDGES[1:] + _EDGES[:-1])
_REACH = (_THICKNESS[:, None] * _EDGES)[..., None]  # (2, strips + 1, 1)
_OUTERMOST = np.isin(np.arange(_STRIPS), [0, _STRIPS - 1])


def _evenly_spaced(backbone: Floats, cut: float) -> Floats:
    """Return points on a centre line, as far apart as a rib is long, an even number: there is a rib at either end.

    Args:
        backbone: points p_WP from the mount to the wrist, shape (n, 3), in m.
        cut: length that is missing at the wrist, in m, where another part begins.
    """
    steps = np.linalg.norm(np.diff(backbone, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    whole = max(float(length[-1]) - cut, 1e-3)
    wanted = np.linspace(0.0, whole, 2 * max(1, round(whole / _RIB_LENGTH / 2.0)) + 2)
    return np.column_stack([np.interp(wanted, length, backbone[:, i]) for i in range(3)])


class Tube:
    """Ribs and gaps of a tube as cameras see them.

    Args:
        radius: of the ribs, in m.
        cameras: where the pictures are taken, c of them.
        light: that shines on the tube.
    """

    def __init__(self, radius: float, cameras: Sequence[Pinhole], light: Light) -> None:
        self._radius = radius * np.array([[camera.f[0]] for camera in cameras])  # px m
        self._lights = [light.in_camera_frame(camera.R_WC) for camera in cameras]

    def polygons(self, centre: Floats, depth: Floats) -> list[PolygonLayer]:
        """Return, for each camera, a tube seen at pixels (c, n, 2) and depths (c, n), each where a rib ends."""
        with np.errstate(divide="ignore", invalid="ignore"):
            radius = self._radius / depth
        along = np.empty_like(centre)
        along[:, 1:-1] = centre[:, 2:] - centre[:, :-2]
        along[:, [0, -1]] = centre[:, [1, -1]] - centre[:, [0, -2]]
        along = along / np.maximum(np.sqrt((along**2).sum(axis=2, keepdims=True)), 1e-9)
        across = np.stack([-along[..., 1], along[..., 0]], axis=2)
        rims = centre[:, :, None, None] + _REACH * (radius[..., None] * across)[:, :, None, None]
        i = np.arange(len(centre[0]) - 1)  # rims: (c, n, 2, strips + 1, 2)
        kind = i % 2
        near, far = rims[:, i, kind], rims[:, i + 1, kind]
        quads = np.stack([near[:, :, :-1], near[:, :, 1:], far[:, :, 1:], far[:, :, :-1]], axis=3)
        normals = np.empty((len(centre), len(i), _STRIPS, 3))
        normals[..., :2] = _MIDDLE[:, None] * across[:, :-1, None]
        normals[..., 2] = -np.sqrt(1.0 - _MIDDLE**2)
        depths = np.repeat(0.5 * (depth[:, :-1] + depth[:, 1:]), _STRIPS, axis=1)
        outer = np.tile(_OUTERMOST, len(i))
        colours = [_COLOURS[kind][:, None] * x.shade(n)[..., None] for x, n in zip(self._lights, normals, strict=True)]
        return [
            PolygonLayer(d, q.reshape(-1, 4, 2), c.reshape(-1, 3), outer)
            for d, q, c in zip(depths, quads, colours, strict=True)
        ]


_RADIUS = 48.0  # texture px; about the ball's size on the canvas, so that warping it does not alias
_HALF = 52  # half the texture's side
_GREEN = np.array([58.0, 178.0, 52.0])
_GLOSS = 40.0  # Phong exponent


class ShadedBall:
    """A glossy green ball with an exact outline: the texture's circle lies where rays from the lens touch the sphere.

    Args:
        radius: in m.
        camera: where the pictures are taken.
        light: that shines on it.
    """

    def __init__(self, radius: float, camera: Pinhole, light: Light) -> None:
        self._radius = radius
        self._camera = camera
        self._down = camera.R_WC[:, 1]
        self._across = skew(self._down)  # across @ v is down x v
        self._texture = _texture(light.in_camera_frame(camera.R_WC))

    def decal(self, p_WO: Floats) -> Decal | None:
        """Return the ball with its centre at p_WO; None when the lens is inside it."""
        to_ball = p_WO - self._camera.p_WC
        distance = math.sqrt(to_ball @ to_ball)
        if not distance > self._radius:
            return None
        sine = self._radius / distance
        axis = to_ball / distance
        right, down = self._across @ axis, self._down - (self._down @ axis) * axis
        length = math.sqrt(right @ right)  # of both
        right, down = right / length, down / length
        middle = self._camera.p_WC + to_ball * (1.0 - sine**2)  # of the circle in which the rays touch
        half = self._radius * np.sqrt(1.0 - sine**2) * _HALF / _RADIUS
        corners = np.array([-right - down, right - down, right + down, -right + down])
        pixels = self._camera.project(middle + half * corners)
        return Decal(float(self._camera.depth(p_WO)), self._texture, pixels)


def _texture(light: Light) -> Pixels:
    at = (np.arange(2 * _HALF) + 0.5 - _HALF) / _RADIUS
    x, y = np.meshgrid(at, at)
    rho = np.hypot(x, y)
    inside = np.minimum(rho, 1.0)
    scale = inside / np.maximum(rho, 1e-9)
    normals = np.stack([x * scale, y * scale, -np.sqrt(1.0 - inside**2)], axis=2)
    mirrored = 2.0 * (normals @ light.towards)[..., None] * normals - light.towards
    gloss = np.clip(-mirrored[..., 2], 0.0, None) ** _GLOSS
    colour = light.shade(normals)[..., None] * _GREEN + 150.0 * gloss[..., None]
    opacity = np.clip((1.0 - rho) * _RADIUS + 0.5, 0.0, 1.0)[..., None]
    return np.rint(np.concatenate([np.clip(colour, 0.0, 255.0) * opacity, 255.0 * opacity], axis=2)).astype(np.uint8)


_SIDES = 8
_CELL = 8  # texture px a marker cell
_MARKER = 6 * _CELL  # a marker's width: 4 bits and a border on either side
_PLASTIC = np.array([226.0, 230.0, 232.0])
_TAPE = np.array([132, 156, 170], dtype=np.uint8)
_INK = 0.1  # brightness of black print over the plastic's
_CORNERS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])  # in M: upper left first, clockwise


class MarkerCollar:
    """Eight square sides around z_R; the middle of side i lies at i * 45 degrees from x_R towards y_R.

    On side i sits ArUco marker i of DICT_4X4_50. Its frame M has z out of the face, y along z_R, that is towards the
    gripper, and x = y x z; the marker's printed top is at +y_M, so that a hanging arm's markers stand on their heads.
    With two rings, the sides are twice as long, and marker i + 8 sits above marker i, one width along -z_R.

    Args:
        apothem: distance of the sides from the axis, in m.
        marker: side of a marker's black square, in m.
        taped: sides with tape over their markers.
        rings: of markers, 1 or 2.

    Attributes:
        width: of a side, in m.
        above: how far the collar reaches from the wrist along -z_R, in m.
    """

    def __init__(self, apothem: float, marker: float, taped: Sequence[int] = (), rings: int = 1) -> None:
        self.width = 2.0 * apothem * np.tan(np.pi / _SIDES)
        self.above = (rings - 0.5) * self.width
        self._rings = rings
        margin = max(1, round(_MARKER * 0.5 * (self.width / marker - 1.0)))
        self._prints = [_taped(margin) if i % _SIDES in taped else _face(i, margin) for i in range(rings * _SIDES)]
        printed = marker * (1.0 + 2.0 * margin / _MARKER)  # the texture's width
        angle = np.arange(_SIDES) * 2.0 * np.pi / _SIDES
        self._z_RM = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_SIDES)])
        x_RM = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(_SIDES)])
        square = _CORNERS[:, :1] * x_RM[:, None] + _CORNERS[:, 1:] * np.array([0.0, 0.0, 1.0])  # (8, 4, 3)
        middle = apothem * self._z_RM[:, None]
        up = np.array([0.0, 0.0, -self.width])
        sides = middle + 0.5 * self.width * square  # corners 2 and 3 are at -z_R
        sides[:, 2:] += (rings - 1) * up
        self._corners = np.stack([sides, *(middle + 0.5 * printed * square + k * up for k in range(rings))])

    def placed(self, p_WR: Floats, R_WR: Floats, light: Light) -> "PlacedCollar":
        """Return the collar in the world, under a light."""
        R_RW = np.transpose(R_WR)
        corners = p_WR + self._corners @ R_RW
        normals = np.concatenate([[R_WR[:, 2], -R_WR[:, 2]], self._z_RM @ R_RW])
        middles = np.concatenate([corners[0, :, [0, 3]].mean(axis=1), corners[0].mean(axis=1)])
        shades = light.shade(normals)
        shades[:2] *= 0.8
        return PlacedCollar(corners, normals, middles, shades, self._prints)


class PlacedCollar:
    """A collar in the world: its two ends, then its eight sides.

    Args:
        corners: p_WP of the sides' corners, then of those of the prints of each ring, shape (1 + rings, 8, 4, 3), in m.
        normals: of ends and sides in W, shape (10, 3).
        middles: p_WP of ends and sides, shape (10, 3), in m.
        shades: of ends and sides, shape (10,).
        prints: textures under full light, of each ring's sides.
    """

    def __init__(self, corners: Floats, normals: Floats, middles: Floats, shades: Floats, prints: list[Pixels]) -> None:
        self.corners = corners
        self._normals, self._middles, self._shades = normals, middles, shades
        self._prints = prints
        self._shaded: dict[int, Pixels] = {}  # prints that were seen

    def polygons(self, pixels: Floats, depth: float, p_WC: Floats) -> tuple[PolygonLayer, list[Decal]]:
        """Return the body with the sides and ends that face a camera, and the prints on these sides.

        Args:
            pixels: at which the corners are seen, shape (1 + rings, 8, 4, 2).
            depth: of the wrist, in m.
            p_WC: position of the camera, in m.
        """
        faces, *prints = pixels
        ends = [faces[:, 0], faces[:, 3]]
        quads = np.repeat(faces, 2, axis=1)  # as many corners as an end has
        facing = ((p_WC - self._middles) * self._normals).sum(axis=1) > 0.0
        outlines = np.concatenate([ends, quads])[facing]
        n = len(outlines)
        body = PolygonLayer(np.full(n, depth), outlines, self._shades[facing, None] * _PLASTIC, np.full(n, True))
        return body, [
            Decal(depth - 1e-6, self._print(k * _SIDES + i, i), corners[i])
            for k, corners in enumerate(prints)
            for i in np.flatnonzero(facing[2:]).tolist()
        ]

    def _print(self, texture: int, side: int) -> Pixels:
        if texture not in self._shaded:
            self._shaded[texture] = _shaded(self._prints[texture], float(self._shades[2 + side]))
        return self._shaded[texture]


def _face(i: int, margin: int) -> Pixels:
    """Return marker i in a margin of the collar's colour, as a decal's texture."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    white = np.asarray(cv2.aruco.generateImageMarker(dictionary, i, _MARKER), dtype=np.float64) / 255.0
    paper = np.pad(_INK + (1.0 - _INK) * white, margin, constant_values=1.0)
    face = np.full((*paper.shape, 4), 255, dtype=np.uint8)
    face[..., :3] = np.rint(paper[:, :, None] * _PLASTIC)
    return face


def _taped(margin: int) -> Pixels:
    """Return tape over a marker and its margin, as a decal's texture."""
    side = _MARKER + 2 * margin
    face = np.full((side, side, 4), 255, dtype=np.uint8)
    face[..., :3] = _TAPE
    return face


def _shaded(texture: Pixels, brightness: float) -> Pixels:
    levels = (np.arange(256)[:, None] * np.array([brightness, brightness, brightness, 1.0])).astype(np.uint8)
    return np.asarray(cv2.LUT(texture, levels[None]), dtype=np.uint8)


_CARD_SIDE, _CARD_DISTANCE = 0.16, 0.06  # m; from the ball
_CARD_COLOUR = [92.0, 134.0, 172.0]  # cardboard


class Postures(Protocol):
    """Where everything is, in W, in m; orientations as quaternions, scalar first; grip 0 (open) to 1 (closed)."""

    backbone: Floats
    p_WR: Floats
    q_WR: Floats
    p_WG: Floats
    q_WG: Floats
    grip: float
    p_WO: Floats
    p_WH: Floats


class HandoverScene:
    """The scene before cameras, as things whose depths give what hides what.

    Args:
        cameras: that see the scene.
        arm_radius: of the soft arm's ribs, in m.
        ball_radius: in m.
        collar: with the markers, at the wrist.
        bowl: that stands there, if one does.
    """

    def __init__(
        self,
        cameras: Sequence[Pinhole],
        arm_radius: float,
        ball_radius: float,
        collar: MarkerCollar,
        bowl: Bowl | None = None,
    ) -> None:
        towards = np.array([-0.50, 0.34, 0.80])
        light = self._light = Light(towards / np.linalg.norm(towards), ambient=0.48)
        self._cameras = cameras
        self._collar = collar
        self._arm = Tube(arm_radius, cameras, light)
        self._limbs = ShadedLimbs(cameras, light)
        self._balls = [ShadedBall(ball_radius, camera, light) for camera in cameras]
        self._bowls = [[] if bowl is None else bowl_layers(bowl, camera, light) for camera in cameras]

    def project(self, x: Postures, card_before: Floats | None = None) -> list[tuple[list[PolygonLayer], list[Decal]]]:
        """Return what there is to paint, in no order, for each camera.

        Args:
            x: where everything is.
            card_before: point, shape (3,), in m, between which and the ball a card is held, if it is.
        """
        ribs = _evenly_spaced(x.backbone, self._collar.above)
        collar = self._collar.placed(x.p_WR, rotation_of(x.q_WR), self._light)
        limbs = together(gripper(x.p_WR, x.p_WG, rotation_of(x.q_WG), x.grip), hand(x.p_WH))
        points = np.concatenate([ribs, collar.corners.reshape(-1, 3), limbs.points.reshape(-1, 3)])
        a, b = len(ribs), len(points) - limbs.radii.size
        pixels = np.array([camera.project(points) for camera in self._cameras])
        depth = np.array([camera.depth(points) for camera in self._cameras])
        arms = self._arm.polygons(pixels[:, :a], depth[:, :a])
        seen_at, depths = (
            pixels[:, b:].reshape(-1, *limbs.points.shape[:2], 2),
            depth[:, b:].reshape(-1, *limbs.radii.shape),
        )
        fingers = self._limbs.polygons(limbs, seen_at, depths)
        things: list[tuple[list[PolygonLayer], list[Decal]]] = []
        for k, camera in enumerate(self._cameras):
            corners = pixels[k, a:b].reshape(*collar.corners.shape[:-1], 2)
            body, prints = collar.polygons(corners, float(camera.depth(x.p_WR)), camera.p_WC)
            ball = self._balls[k].decal(x.p_WO)
            card = [] if card_before is None else [_card(x.p_WO, card_before, camera)]
            things.append(
                ([*self._bowls[k], arms[k], body, fingers[k], *card], prints if ball is None else [*prints, ball])
            )
        return things


def _card(p_WO: Floats, seen_from: Floats, camera: Pinhole) -> PolygonLayer:
    """Return an upright card, held squarely between the ball and a point."""
    towards = np.array([seen_from[0] - p_WO[0], seen_from[1] - p_WO[1], 0.0])
    towards = towards / max(float(np.linalg.norm(towards)), 1e-9)
    across = np.array([-towards[1], towards[0], 0.0])
    square = _CORNERS[:, :1] * across + _CORNERS[:, 1:] * np.array([0.0, 0.0, 1.0])
    corners = p_WO + _CARD_DISTANCE * towards + 0.5 * _CARD_SIDE * square
    depth = camera.depth(corners).min(keepdims=True)
    return PolygonLayer(depth, camera.project(corners)[None], np.array([_CARD_COLOUR]), np.array([True]))
