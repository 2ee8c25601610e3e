"""What there is to paint before one camera: arm, gripper, ball and hand, as polygons and decals with depths.

`tube` is the ribbed soft arm, `ShadedBall` the glossy green ball, `MarkerCollar` the octagonal collar at the wrist with
a fiducial marker on each side; `HandoverScene` puts them together.
"""

from typing import Protocol

import cv2
import numpy as np

from handover.cosim.blocks.geometry import Pinhole, rotation_of
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.shapes import Decal, Light, Pixels, PolygonLayer, gripper, hand, polygons

_RIB_LENGTH = 0.008  # m; ribs and gaps alternate
_STRIPS = 7  # across the visible half, each of one shade
_COLOURS = np.array([[172.0, 166.0, 160.0], [92.0, 86.0, 80.0]])  # of a rib, of a gap
_THICKNESS = np.array([1.0, 0.86])  # of a rib, of a gap


def tube(backbone: Floats, radius: float, cut: float, camera: Pinhole, light: Light) -> PolygonLayer:
    """Return the ribs and gaps of a tube.

    Args:
        backbone: centre line p_WP from the mount to the wrist, shape (n, 3), in m.
        radius: of the ribs, in m.
        cut: length that is missing at the wrist, in m, where another part begins.
        camera: where the picture is taken.
        light: that shines on the tube.
    """
    points = _evenly_spaced(backbone, cut)
    depth = camera.depth(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        centre, r = camera.project(points), radius * camera.f[0] / depth
    along = np.gradient(centre, axis=0)
    along = along / np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    s = np.linspace(-1.0, 1.0, _STRIPS + 1)
    kind = np.arange(len(points) - 1) % 2
    reach = _THICKNESS[kind, None, None] * s[:, None]  # (m, strips + 1, 1)
    near = centre[:-1, None] + reach * (r[:-1, None] * across[:-1])[:, None]
    far = centre[1:, None] + reach * (r[1:, None] * across[1:])[:, None]
    quads = np.stack([near[:, :-1], near[:, 1:], far[:, 1:], far[:, :-1]], axis=2)
    middle = 0.5 * (s[1:] + s[:-1])
    normals = np.empty((len(kind), _STRIPS, 3))
    normals[..., :2] = middle[:, None] * across[:-1, None]
    normals[..., 2] = -np.sqrt(1.0 - middle**2)
    shades = light.in_camera_frame(camera.R_WC).shade(normals)
    return PolygonLayer(0.5 * (depth[:-1] + depth[1:]), quads, _COLOURS[kind][:, None] * shades[..., None])


def _evenly_spaced(backbone: Floats, cut: float) -> Floats:
    """Return points, an even number, so that there is a rib at either end."""
    steps = np.linalg.norm(np.diff(backbone, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    whole = max(float(length[-1]) - cut, 1e-3)
    wanted = np.linspace(0.0, whole, 2 * max(1, round(whole / _RIB_LENGTH / 2.0)) + 2)
    return np.column_stack([np.interp(wanted, length, backbone[:, i]) for i in range(3)])


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
        self._texture = _texture(light.in_camera_frame(camera.R_WC))

    def decal(self, p_WO: Floats) -> Decal | None:
        """Return the ball with its centre at p_WO; None when the lens is inside it."""
        to_ball = p_WO - self._camera.p_WC
        distance = float(np.linalg.norm(to_ball))
        if not distance > self._radius:
            return None
        sine = self._radius / distance
        axis = to_ball / distance
        right = np.cross(self._camera.R_WC[:, 1], axis)
        right = right / np.linalg.norm(right)
        down = np.cross(axis, right)
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
_INK = 0.1  # brightness of black print over the plastic's
_CORNERS = np.array([[-1.0, 1.0], [1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]])  # in M: upper left first, clockwise


class MarkerCollar:
    """Eight square sides around z_R; the middle of side i lies at i * 45 degrees from x_R towards y_R.

    On side i sits ArUco marker i of DICT_4X4_50. Its frame M has z out of the face, y along z_R, that is towards the
    gripper, and x = y x z; the marker's printed top is at +y_M, so that a hanging arm's markers stand on their heads.

    Args:
        apothem: distance of the sides from the axis, in m.
        marker: side of a marker's black square, in m.
    """

    def __init__(self, apothem: float, marker: float) -> None:
        self.width = 2.0 * apothem * np.tan(np.pi / _SIDES)
        margin = max(1, round(_MARKER * 0.5 * (self.width / marker - 1.0)))
        self._faces = [_face(i, margin) for i in range(_SIDES)]
        printed = marker * (1.0 + 2.0 * margin / _MARKER)  # the texture's width
        angle = np.arange(_SIDES) * 2.0 * np.pi / _SIDES
        self._z_RM = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_SIDES)])
        x_RM = np.column_stack([-np.sin(angle), np.cos(angle), np.zeros(_SIDES)])
        square = _CORNERS[:, :1] * x_RM[:, None] + _CORNERS[:, 1:] * np.array([0.0, 0.0, 1.0])  # (8, 4, 3)
        middle = apothem * self._z_RM[:, None]
        self._corners = np.stack([middle + 0.5 * self.width * square, middle + 0.5 * printed * square])

    def polygons(self, p_WR: Floats, R_WR: Floats, camera: Pinhole, light: Light) -> tuple[PolygonLayer, list[Decal]]:
        """Return the body with the sides and ends that face the camera, and the prints on these sides."""
        R_RW = np.transpose(R_WR)
        corners = p_WR + self._corners @ R_RW
        faces, prints = camera.project(corners)
        ends = [faces[:, 0], faces[:, 3]]
        quads = np.repeat(faces, 2, axis=1)  # as many corners as an end has
        z_R = R_WR[:, 2]
        normals = np.concatenate([[z_R, -z_R], self._z_RM @ R_RW])
        middles = np.concatenate([corners[0, :, [0, 3]].mean(axis=1), corners[0].mean(axis=1)])
        facing = np.einsum("ij,ij->i", camera.p_WC - middles, normals) > 0.0
        shades = light.shade(normals)
        shades[:2] *= 0.8
        depth = float(camera.depth(p_WR))
        outlines = np.concatenate([ends, quads])[facing]
        body = PolygonLayer(np.array([depth]), outlines[None], (shades[facing, None] * _PLASTIC)[None])
        lit = np.flatnonzero(facing[2:])
        return body, [Decal(depth - 1e-6, _shaded(self._faces[i], float(shades[2 + i])), prints[i]) for i in lit]


def _face(i: int, margin: int) -> Pixels:
    """Return marker i in a margin of the collar's colour, as a decal's texture."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    white = np.asarray(cv2.aruco.generateImageMarker(dictionary, i, _MARKER), dtype=np.float64) / 255.0
    paper = np.pad(_INK + (1.0 - _INK) * white, margin, constant_values=1.0)
    face = np.full((*paper.shape, 4), 255, dtype=np.uint8)
    face[..., :3] = np.rint(paper[:, :, None] * _PLASTIC)
    return face


def _shaded(texture: Pixels, brightness: float) -> Pixels:
    return (texture * np.array([brightness, brightness, brightness, 1.0])).astype(np.uint8)


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
    """The scene before one camera, as things whose depths give what hides what.

    Args:
        camera: that sees the scene.
        arm_radius: of the soft arm's ribs, in m.
        ball_radius: in m.
        collar: with the markers, at the wrist.
    """

    def __init__(self, camera: Pinhole, arm_radius: float, ball_radius: float, collar: MarkerCollar) -> None:
        towards = np.array([-0.50, 0.34, 0.80])
        self._light = Light(towards / np.linalg.norm(towards), ambient=0.48)
        self._camera = camera
        self._arm_radius = arm_radius
        self._collar = collar
        self._ball = ShadedBall(ball_radius, camera, self._light)

    def project(self, x: Postures) -> tuple[list[PolygonLayer], list[Decal]]:
        """Return what there is to paint, in no order."""
        camera, light = self._camera, self._light
        arm = tube(x.backbone, self._arm_radius, 0.5 * self._collar.width, camera, light)
        body, prints = self._collar.polygons(x.p_WR, rotation_of(x.q_WR), camera, light)
        limbs = polygons(gripper(x.p_WR, x.p_WG, rotation_of(x.q_WG), x.grip) + hand(x.p_WH), camera, light)
        ball = self._ball.decal(x.p_WO)
        return [arm, body, limbs], prints if ball is None else [*prints, ball]
