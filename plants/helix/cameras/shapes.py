"""What is painted: polygons and decals in a picture's pixels, with their depths and shades.

`Limbs` are chains of round rods with rounded ends. `hand` and `gripper` are made of them: a person's hand that offers a
ball on its fingers, and a stem with three jointed fingers that close on what is at G. `bowl_layers` makes a bowl.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.gripper_fingers import FINGERS, KNUCKLE, finger_joints
from handover.plants.helix.hand.bowl import Bowl

Pixels = NDArray[np.uint8]
"""Picture or part of one, shape (h, w, 3), blue, green, red; a decal's texture has a fourth channel, its opacity."""


@dataclass(frozen=True)
class PolygonLayer:
    """Convex polygons, p of them with n corners each.

    Attributes:
        depth: shape (p,), in m; a polygon hides what is deeper, and of the same depth what comes before it.
        outlines: shape (p, n, 2), in px; a polygon with a corner that is not finite is left out.
        colours: shape (p, 3), blue, green, red, 0 to 255.
        outer: shape (p,); in every row of the picture, all polygons lie between the outermost of these.
    """

    depth: Floats
    outlines: Floats
    colours: Floats
    outer: NDArray[np.bool_]


@dataclass(frozen=True)
class Decal:
    """A texture (its colours multiplied by its opacity) and the pixels where its corners go.

    Corners, shape (4, 2): upper left, upper right, lower right, lower left of the texture's area, not of its pixels'
    middles.
    """

    depth: float
    texture: Pixels
    corners: Floats


@dataclass(frozen=True)
class Light:
    """A far lamp in the direction `towards`, shape (3,), of unit length; the room reflects the share `ambient`."""

    towards: Floats
    ambient: float

    def shade(self, normals: Floats) -> Floats:
        """Return brightness, 0 to 1, of surfaces with unit normals, shape (..., 3): Lambert's law over the ambient."""
        return self.ambient + (1.0 - self.ambient) * np.clip(normals @ self.towards, 0.0, None)

    def in_camera_frame(self, R_WC: Floats) -> "Light":
        """Return the light in a camera's frame."""
        return Light(self.towards @ R_WC, self.ambient)


@dataclass(frozen=True)
class Limbs:
    """Chains of three points, m of them, each of which has two rods; one that has only one has its last point twice.

    Attributes:
        points: p_WP, shape (m, 3, 3), in m.
        radii: at each point, shape (m, 3), in m.
        colours: shape (m, 3), blue, green, red, 0 to 255.
    """

    points: Floats
    radii: Floats
    colours: Floats


def rods(ends: Floats, radii: Floats, colours: Floats) -> Limbs:
    """Return straight limbs, from their ends, shape (m, 2, 3), in m, and the radii there, shape (m, 2), in m."""
    return Limbs(ends[:, [0, 1, 1]], radii[:, [0, 1, 1]], colours)


def together(*limbs: Limbs) -> Limbs:
    """Return all these limbs."""
    return Limbs(
        np.concatenate([x.points for x in limbs]),
        np.concatenate([x.radii for x in limbs]),
        np.concatenate([x.colours for x in limbs]),
    )


_ARC = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
_HALF_CIRCLE = np.column_stack([np.cos(_ARC), np.sin(_ARC)])
_OFFSETS = np.linspace(0.0, 0.9, 6)  # where the shade changes, from the silhouette to the brightest line
_RIM = 0.62  # brightness of a surface seen edge-on over one seen face-on, under the same light


class ShadedLimbs:
    """Limbs as cameras see them.

    A limb is filled several times, each time smaller, brighter and nearer to the light: a cheap, smooth shading.

    Args:
        cameras: where the pictures are taken, c of them.
        light: that shines on them.
    """

    def __init__(self, cameras: Sequence[Pinhole], light: Light) -> None:
        self._focal_length = np.array([[[camera.f[0]]] for camera in cameras])
        lights = [light.in_camera_frame(camera.R_WC) for camera in cameras]
        side = np.array([x.towards[:2] for x in lights])
        self._aside = 0.55 * _OFFSETS[:, None] * side[:, None, None]  # (c, 1, shades, 2), in radii
        normals = np.empty((len(cameras), len(_OFFSETS), 3))
        normals[..., :2] = _OFFSETS[:, None] * side[:, None]
        normals[..., 2] = -np.sqrt(1.0 - (normals[..., :2] ** 2).sum(axis=2))
        rim = _RIM + (1.0 - _RIM) * np.sqrt(_OFFSETS)
        self._shades = np.array([x.shade(n) * rim for x, n in zip(lights, normals, strict=True)])

    def polygons(self, limbs: Limbs, pixels: Floats, depth: Floats) -> list[PolygonLayer]:
        """Return, for each camera, limbs each at the depth of its middle.

        A rod without length is left out: it would be a disc, with which the limb's other rod ends anyway.

        Args:
            limbs: m of them.
            pixels: at which their points are seen, shape (c, m, 3, 2).
            depth: of these, shape (c, m, 3), in m.
        """
        limb, rod = np.nonzero(np.any(limbs.points[:, 1:] != limbs.points[:, :-1], axis=2))
        with np.errstate(divide="ignore", invalid="ignore"):
            radius = limbs.radii * self._focal_length / depth
        ends: list[Floats] = []
        for k in (0, 1):
            r = radius[:, limb, rod + k, None]
            ends += [pixels[:, limb, rod + k, None] + r[..., None] * self._aside, r * (1.0 - _OFFSETS)]
        outlines = _outlines(*ends)  # (c, rods, shades, 18, 2)
        n = len(_OFFSETS)
        of, shade = np.repeat(limb, n), np.tile(np.arange(n), len(limb))
        order = np.lexsort((shade, of))  # both rods of a limb in one shade, then in the next
        of, shade = of[order], shade[order]
        outlines = outlines.reshape(len(outlines), -1, *outlines.shape[3:])[:, order]
        colours = np.minimum(limbs.colours[of] * self._shades[:, shade, None], 255.0)
        depths = depth.mean(axis=2)[:, of]
        return [PolygonLayer(d, o, c, shade == 0) for d, o, c in zip(depths, outlines, colours, strict=True)]


def _outlines(start: Floats, r_start: Floats, end: Floats, r_end: Floats) -> Floats:
    """Return the outlines, shape (..., 18, 2), of rods with ends of shape (..., 2): half a circle about either end."""
    along = end - start
    length = np.sqrt((along**2).sum(axis=-1, keepdims=True))
    x = np.where(length > 0.0, along / np.where(length > 0.0, length, 1.0), [1.0, 0.0])[..., None, :]
    y = np.stack([-x[..., 1], x[..., 0]], axis=-1)
    out = _HALF_CIRCLE[:, :1] * x + _HALF_CIRCLE[:, 1:] * y  # (..., 9, 2), from the end
    outlines = [end[..., None, :] + r_end[..., None, None] * out, start[..., None, :] - r_start[..., None, None] * out]
    return np.concatenate(outlines, axis=-2)


_SKIN = (138.0, 164.0, 212.0)
_SLEEVE = (112.0, 84.0, 62.0)
_ELBOW = np.array([0.46, 0.56, -1.32])  # p_WE, m: out of the picture; the person stands opposite, to the left
_UP = np.array([0.0, 0.0, 1.0])

# In the hand's frame at H: along the fingers, across, out of the palm; m.
_WRIST = np.array([-0.072, 0.0, -0.010])
_PALM = [
    [[-0.066, 0.45 * across, -0.008], [-0.030, across, -0.002], [0.028, across, -0.001]]
    for across in (-0.031, -0.011, 0.010, 0.029)
]
_FINGERS = {
    "index": [[0.028, -0.033, 0.000], [0.056, -0.038, 0.006], [0.076, -0.038, 0.018]],
    "middle": [[0.032, -0.011, 0.000], [0.063, -0.012, 0.006], [0.085, -0.012, 0.019]],
    "ring": [[0.030, 0.011, 0.000], [0.059, 0.013, 0.006], [0.080, 0.014, 0.018]],
    "little": [[0.024, 0.031, 0.000], [0.047, 0.037, 0.005], [0.062, 0.039, 0.014]],
    "thumb": [[-0.034, -0.036, 0.000], [-0.012, -0.060, 0.006], [0.014, -0.064, 0.016]],
}
_HAND = np.array([*_PALM, *_FINGERS.values()])
_HAND_RADII = np.array([[0.016, 0.014, 0.011]] * len(_PALM) + [[0.0105, 0.0092, 0.0078]] * len(_FINGERS))
_HAND_COLOURS = np.array([_SKIN] * len(_HAND))


def hand(p_WH: Floats) -> Limbs:
    """Return the limbs of a hand with the middle of its palm at H, palm up, and of its forearm."""
    reach = p_WH - _ELBOW
    level = np.array([reach[0], reach[1], 0.0])
    forwards = level / max(math.hypot(*level), 1e-6)
    R_HW = np.array([forwards, [-forwards[1], forwards[0], 0.0], _UP])
    wrist = p_WH + _WRIST @ R_HW
    cuff = wrist + 0.11 * (_ELBOW - wrist)
    forearm = np.array([[_ELBOW, _ELBOW, wrist]])  # its middle lies nearer to the elbow: it ends inside the sleeve
    return together(
        Limbs(forearm, np.array([[0.036, 0.036, 0.024]]), np.array([_SKIN])),
        rods(np.array([[_ELBOW, cuff]]), np.array([[0.066, 0.038]]), np.array([_SLEEVE])),
        Limbs(p_WH + _HAND @ R_HW, _HAND_RADII, _HAND_COLOURS),
    )


_METAL = (86.0, 82.0, 78.0)
_FINGER = (52.0, 50.0, 50.0)
_TIP = (50.0, 96.0, 196.0)
_GRIPPER_RADII = np.array(
    [[0.007, 0.006], [0.0125, 0.0125]] + [[0.0048, 0.0042], [0.0042, 0.0038], [0.0046, 0.0042]] * FINGERS
)
_GRIPPER_COLOURS = np.array([_METAL, _METAL] + [_FINGER, _FINGER, _TIP] * FINGERS)


def gripper(p_WR: Floats, p_WG: Floats, R_WG: Floats, grip: float) -> Limbs:
    """Return the limbs of a gripper at G on a wrist at R; grip is 0 when open, 1 when closed."""
    z_G = R_WG[:, 2]
    knuckle = p_WG - KNUCKLE * z_G
    stem = [[p_WR + 0.021 * z_G, knuckle], [knuckle - 0.004 * z_G, knuckle + 0.002 * z_G]]
    points = finger_joints(p_WG, R_WG, grip)  # (FINGERS, 3, 3): root, joint, tip
    pad = 0.5 * (points[:, 1] + points[:, 2])
    fingers = np.stack([points[:, 0], points[:, 1], points[:, 1], pad, pad, points[:, 2]], axis=1)
    return rods(np.concatenate([stem, fingers.reshape(-1, 2, 3)]), _GRIPPER_RADII, _GRIPPER_COLOURS)


BOWL_WALL = 0.004
"""Thickness of the bowl as it is drawn, m; touching, it has none."""
_PORCELAIN = np.array([150.0, 176.0, 196.0])
_RINGS, _SEGMENTS = 5, 24
_POST_LENGTH, _POST_RADIUS = 0.6, 0.012  # m; of the post on which the bowl stands


def bowl_layers(bowl: Bowl, camera: Pinhole, light: Light) -> list[PolygonLayer]:
    """Return a bowl's inside and its outside as far as they face a camera: what lies in it is painted between."""
    profile = bowl.profile(_RINGS + 1)
    angle = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS + 1)
    round_z = np.stack([np.cos(angle), np.sin(angle), np.zeros(_SEGMENTS + 1)], axis=1)
    depth = float(camera.depth(bowl.p_WD))
    foot = np.array([*bowl.p_WD[:2], float(profile[0, 1])])
    post = rods(np.array([[foot, foot - _POST_LENGTH * _UP]]), np.array([[_POST_RADIUS] * 2]), np.array([_METAL]))
    pixels, depths = camera.project(post.points), camera.depth(post.points)
    layers = ShadedLimbs([camera], light).polygons(post, pixels[None], depths[None])
    for facing, wall in ((-1.0, 0.0), (1.0, BOWL_WALL)):
        radii = profile[:, 0] * (1.0 + wall / bowl.radius)
        heights = profile[:, 1] - wall * (1.0 - profile[:, 0] / bowl.radius)
        points = radii[:, None, None] * round_z + heights[:, None, None] * _UP
        points = points + np.array([bowl.p_WD[0], bowl.p_WD[1], 0.0])
        quads = np.stack([points[:-1, :-1], points[:-1, 1:], points[1:, 1:], points[1:, :-1]], axis=2).reshape(-1, 4, 3)
        middles = quads.mean(axis=1)
        normals = facing * (middles - bowl.p_WS)
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        seen = np.einsum("ij,ij->i", camera.p_WC - middles, normals) > 0.0
        depths = np.full(np.count_nonzero(seen), depth - facing * bowl.radius)
        colours = light.shade(normals[seen])[:, None] * _PORCELAIN
        layers.append(PolygonLayer(depths, camera.project(quads[seen]), colours, np.full(len(depths), True)))
    return layers
