"""The soft arm's body: a ribbed tube along its backbone."""

import numpy as np

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.light import Light
from handover.plants.sketch import Sketch

_RIB_LENGTH = 0.008  # m; ribs and gaps alternate
_STRIPS = 7  # across the visible half, each of one shade
_COLOURS = np.array([[172.0, 166.0, 160.0], [92.0, 86.0, 80.0]])  # of a rib, of a gap
_THICKNESS = np.array([1.0, 0.86])  # of a rib, of a gap


def tube(backbone: Floats, radius: float, cut: float, camera: Pinhole, light: Light) -> Sketch:
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
    shades = light.seen_from(camera.R_WC).shade(normals)
    return Sketch(0.5 * (depth[:-1] + depth[1:]), quads, _COLOURS[kind][:, None] * shades[..., None])


def _evenly_spaced(backbone: Floats, cut: float) -> Floats:
    """Return points, an even number, so that there is a rib at either end."""
    steps = np.linalg.norm(np.diff(backbone, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    whole = max(float(length[-1]) - cut, 1e-3)
    wanted = np.linspace(0.0, whole, 2 * max(1, round(whole / _RIB_LENGTH / 2.0)) + 2)
    return np.column_stack([np.interp(wanted, length, backbone[:, i]) for i in range(3)])
