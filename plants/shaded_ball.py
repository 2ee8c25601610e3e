"""A glossy green ball."""

import numpy as np

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.light import Light
from handover.plants.sketch import Decal, Pixels

_RADIUS = 48.0  # texture px; about the ball's size on the canvas, so that warping it does not alias
_HALF = 52  # half the texture's side
_GREEN = np.array([58.0, 178.0, 52.0])
_GLOSS = 40.0  # Phong exponent


class ShadedBall:
    """Its outline is exact: the texture's circle goes where the rays from the lens touch the sphere.

    Args:
        radius: in m.
        camera: where the pictures are taken.
        light: that shines on it.
    """

    def __init__(self, radius: float, camera: Pinhole, light: Light) -> None:
        self._radius = radius
        self._camera = camera
        self._texture = _texture(light.seen_from(camera.R_WC))

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
