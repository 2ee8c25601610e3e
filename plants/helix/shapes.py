"""What is painted: polygons and decals in a picture's pixels, with their depths and shades.

`Limb`s are chains of round rods with rounded ends. `hand` and `gripper` are made of them: a person's hand that offers a
ball on its fingers, and a stem with three jointed fingers that close on what is at G.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats

Pixels = NDArray[np.uint8]
"""Picture or part of one, shape (h, w, 3), blue, green, red; a decal's texture has a fourth channel, its opacity."""


@dataclass(frozen=True)
class PolygonLayer:
    """Things made of convex polygons: m things, each of k polygons with n corners, painted in this order.

    Attributes:
        depth: shape (m,), in m; a thing hides what is deeper.
        outlines: shape (m, k, n, 2), in px; a thing with a point that is not finite is left out.
        colours: shape (m, k, 3), blue, green, red, 0 to 255.
    """

    depth: Floats
    outlines: Floats
    colours: Floats


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


_ARC = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)
_OFFSETS = np.linspace(0.0, 0.9, 6)  # where the shade changes, from the silhouette to the brightest line
_RIM = 0.62  # brightness of a surface seen edge-on over one seen face-on, under the same light


@dataclass(frozen=True)
class Limb:
    """Three points p_WP, shape (3, 3), and the radius at each, shape (3,), in m; blue, green, red, 0 to 255."""

    points: Floats
    radii: Floats
    colour: tuple[float, float, float]


def rod(start: Floats, end: Floats, radii: tuple[float, float], colour: tuple[float, float, float]) -> Limb:
    """Return a straight limb."""
    return Limb(np.array([start, end, end]), np.array([radii[0], radii[1], radii[1]]), colour)


def polygons(limbs: Sequence[Limb], camera: Pinhole, light: Light) -> PolygonLayer:
    """Return the limbs, each at the depth of its middle.

    A limb is filled several times, each time smaller, brighter and nearer to the light: a cheap, smooth shading.
    """
    points, radii = np.array([x.points for x in limbs]), np.array([x.radii for x in limbs])
    depth = camera.depth(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        middle, radius = camera.project(points), radii * camera.f[0] / depth  # (m, 3, 2), (m, 3)
    lit = light.in_camera_frame(camera.R_WC)
    side = lit.towards[:2]
    normals = np.column_stack([_OFFSETS[:, None] * side, np.zeros(len(_OFFSETS))])
    normals[:, 2] = -np.sqrt(1.0 - (normals**2).sum(axis=1))
    shades = lit.shade(normals) * (_RIM + (1.0 - _RIM) * np.sqrt(_OFFSETS))
    moved = middle[:, None] + 0.55 * (_OFFSETS[:, None] * radius[:, None])[..., None] * side  # (m, shades, 3, 2)
    outlines = _outlines(moved, radius[:, None] * (1.0 - _OFFSETS)[:, None])
    colours = np.minimum(np.array([x.colour for x in limbs])[:, None] * shades[:, None], 255.0)
    m, k = outlines.shape[:2]
    return PolygonLayer(depth.mean(axis=1), outlines.reshape(m, 2 * k, -1, 2), np.repeat(colours, 2, axis=1))


def _outlines(points: Floats, radius: Floats) -> Floats:
    """Return the outlines, shape (m, k, 2, 18, 2), of the rods between neighbours: half a circle about either end."""
    along = points[..., 1:, :] - points[..., :-1, :]
    angle = np.arctan2(along[..., 1], along[..., 0])[..., None]
    angle, radius = np.concatenate([angle + _ARC, angle + np.pi + _ARC], axis=-1), radius[..., None]
    n = len(_ARC)
    r = np.concatenate([np.repeat(radius[..., 1:, :], n, axis=-1), np.repeat(radius[..., :-1, :], n, axis=-1)], axis=-1)
    ends = [points[..., 1:, None, :], points[..., :-1, None, :]]
    centres = np.concatenate([np.repeat(end, n, axis=-2) for end in ends], axis=-2)
    return centres + r[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


_SKIN = (138.0, 164.0, 212.0)
_SLEEVE = (112.0, 84.0, 62.0)
_ELBOW = np.array([0.46, 0.56, -1.32])  # p_WE, m: out of the picture; the person stands opposite, to the left

# In the hand's frame at H: along the fingers, across, out of the palm; m.
_FINGERS = {
    "index": [[0.028, -0.033, 0.000], [0.056, -0.038, 0.006], [0.076, -0.038, 0.018]],
    "middle": [[0.032, -0.011, 0.000], [0.063, -0.012, 0.006], [0.085, -0.012, 0.019]],
    "ring": [[0.030, 0.011, 0.000], [0.059, 0.013, 0.006], [0.080, 0.014, 0.018]],
    "little": [[0.024, 0.031, 0.000], [0.047, 0.037, 0.005], [0.062, 0.039, 0.014]],
    "thumb": [[-0.034, -0.036, 0.000], [-0.012, -0.060, 0.006], [0.014, -0.064, 0.016]],
}


def hand(p_WH: Floats) -> list[Limb]:
    """Return the limbs of a hand with the middle of its palm at H, palm up, and of its forearm."""
    reach = p_WH - _ELBOW
    level = np.array([reach[0], reach[1], 0.0])
    forwards = level / max(float(np.linalg.norm(level)), 1e-6)
    up = np.array([0.0, 0.0, 1.0])
    R_HW = np.array([forwards, np.cross(up, forwards), up])

    def world(points: list[list[float]]) -> Floats:
        return p_WH + np.array(points) @ R_HW

    wrist = world([[-0.072, 0.0, -0.010]])[0]
    cuff = wrist + 0.11 * (_ELBOW - wrist)
    forearm = np.array([_ELBOW, _ELBOW, wrist])  # its middle lies nearer to the elbow: it ends inside the sleeve
    limbs = [Limb(forearm, np.array([0.036, 0.036, 0.024]), _SKIN), rod(_ELBOW, cuff, (0.066, 0.038), _SLEEVE)]
    for across in (-0.031, -0.011, 0.010, 0.029):
        palm = world([[-0.066, 0.45 * across, -0.008], [-0.030, across, -0.002], [0.028, across, -0.001]])
        limbs.append(Limb(palm, np.array([0.016, 0.014, 0.011]), _SKIN))
    fingers = [Limb(world(finger), np.array([0.0105, 0.0092, 0.0078]), _SKIN) for finger in _FINGERS.values()]
    return limbs + fingers


_METAL = (86.0, 82.0, 78.0)
_FINGER = (52.0, 50.0, 50.0)
_TIP = (50.0, 96.0, 196.0)
_OPEN = np.array([[0.012, -0.048], [0.042, -0.026], [0.050, 0.008]])  # from G: distance from the axis, along z_G; m
_CLOSED = np.array([[0.012, -0.048], [0.031, -0.018], [0.026, 0.014]])
_AZIMUTHS = np.radians([60.0, 180.0, 300.0])


def gripper(p_WR: Floats, p_WG: Floats, R_WG: Floats, grip: float) -> list[Limb]:
    """Return the limbs of a gripper at G on a wrist at R; grip is 0 when open, 1 when closed."""
    z_G = R_WG[:, 2]
    knuckle = p_WG - 0.050 * z_G
    limbs = [
        rod(p_WR + 0.021 * z_G, knuckle, (0.007, 0.006), _METAL),
        rod(knuckle - 0.004 * z_G, knuckle + 0.002 * z_G, (0.0125, 0.0125), _METAL),
    ]
    joints = _OPEN + min(max(grip, 0.0), 1.0) * (_CLOSED - _OPEN)
    for azimuth in _AZIMUTHS:
        outwards = R_WG @ np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        root, joint, tip = p_WG + joints[:, :1] * outwards + joints[:, 1:] * z_G
        pad = joint + 0.5 * (tip - joint)
        limbs.append(rod(root, joint, (0.0048, 0.0042), _FINGER))
        limbs.append(rod(joint, pad, (0.0042, 0.0038), _FINGER))
        limbs.append(rod(pad, tip, (0.0046, 0.0042), _TIP))
    return limbs
