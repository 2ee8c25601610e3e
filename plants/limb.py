"""Chains of round rods with rounded ends: fingers, a stem, a forearm."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.light import Light
from handover.plants.sketch import Sketch

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


def sketched(limbs: Sequence[Limb], camera: Pinhole, light: Light) -> Sketch:
    """Return the limbs, each at the depth of its middle.

    A limb is filled several times, each time smaller, brighter and nearer to the light: a cheap, smooth shading.
    """
    points, radii = np.array([x.points for x in limbs]), np.array([x.radii for x in limbs])
    depth = camera.depth(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        middle, radius = camera.project(points), radii * camera.f[0] / depth  # (m, 3, 2), (m, 3)
    lit = light.seen_from(camera.R_WC)
    side = lit.towards[:2]
    normals = np.column_stack([_OFFSETS[:, None] * side, np.zeros(len(_OFFSETS))])
    normals[:, 2] = -np.sqrt(1.0 - (normals**2).sum(axis=1))
    shades = lit.shade(normals) * (_RIM + (1.0 - _RIM) * np.sqrt(_OFFSETS))
    moved = middle[:, None] + 0.55 * (_OFFSETS[:, None] * radius[:, None])[..., None] * side  # (m, shades, 3, 2)
    outlines = _outlines(moved, radius[:, None] * (1.0 - _OFFSETS)[:, None])
    colours = np.minimum(np.array([x.colour for x in limbs])[:, None] * shades[:, None], 255.0)
    m, k = outlines.shape[:2]
    return Sketch(depth.mean(axis=1), outlines.reshape(m, 2 * k, -1, 2), np.repeat(colours, 2, axis=1))


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
