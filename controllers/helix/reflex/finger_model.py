"""What the controller expects its infrared sensors to read of a ball at a place: its own model of fingers and beams.

[Luberto] eq. (11) for the characteristic; the gripper's fingers and their beams as designed (assumed).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from handover.cosim.blocks.ports import Floats

SENSORS = 6
"""Two in each of three fingertips: those that look across first, then those that look ahead."""
_OPEN = np.array([[0.042, -0.026], [0.050, 0.008]])  # middle joint and tip: distance from the axis, along z of G; m
_CLOSED = np.array([[0.031, -0.018], [0.026, 0.014]])
_AZIMUTHS = np.radians([60.0, 180.0, 300.0])
_WINDOW = 0.0042  # from the middle of the fingertip, m
_FULL_SCALE = 4095
_RINGS = ((0.0, 1), (0.5, 6), (0.9, 12))  # rays of a beam: part of its half angle, how many
"""The gripper's design, assumed as the plant's: [Vervloet2025] gives no dimensions of fingers with sensors."""


@dataclass(frozen=True, kw_only=True)
class FingerModel:
    """Sensors of one characteristic y = a e^(bx) + c e^(dx), eq. (11), whose beams are bundles of rays.

    A reading is the mean over the rays of the ticks x(y) cos(theta), y being the way to the ball along the ray and
    theta the angle from the ball's normal. Nearer than `nearest` it falls evenly to the share `contact` at contact
    (assumed). Lengths are in m, angles in rad, ticks of a 12-bit converter.
    """

    a: float
    b: float
    c: float
    d: float
    nearest: float
    farthest: float
    contact: float
    beam: float
    across: float
    ahead: float
    ball_radius: float
    palm_radius: float

    @cached_property
    def _curve(self) -> tuple[Floats, Floats]:
        """Distances, rising, and the ticks that stand for them."""
        ticks = np.arange(_FULL_SCALE, -1.0, -1.0)
        return self.a * np.exp(self.b * ticks) + self.c * np.exp(self.d * ticks), ticks

    def beams(self, grip: float) -> tuple[Floats, Floats]:
        """Return windows, shape (6, 1, 3), m, and unit vectors along the rays, shape (6, rays, 3), in G.

        Args:
            grip: closure of the gripper, 0 to 1, by its encoder.
        """
        outwards = np.stack([np.cos(_AZIMUTHS), np.sin(_AZIMUTHS), np.zeros(3)], axis=1)
        z = np.array([0.0, 0.0, 1.0])
        middle, tip = _OPEN + grip * (_CLOSED - _OPEN)
        r, h = ((tip - middle) / np.linalg.norm(tip - middle)).tolist()
        along, normal = r * outwards + h * z, r * z - h * outwards
        axis = np.concatenate([np.cos(x) * normal + np.sin(x) * along for x in (self.across, self.ahead)])
        side = np.tile(np.cross(along, normal), (2, 1))
        up = np.cross(axis, side)
        rays = [
            np.cos(part * self.beam) * axis + np.sin(part * self.beam) * (np.cos(turn) * side + np.sin(turn) * up)
            for part, count in _RINGS
            for turn in (2.0 * np.pi * np.arange(count) / count).tolist()
        ]
        window = np.tile(tip[0] * outwards + tip[1] * z, (2, 1)) + _WINDOW * axis
        return window[:, None], np.stack(rays, axis=1)

    def readings(self, beams: tuple[Floats, Floats], p_GO: Floats) -> Floats:
        """Return the ticks expected of a ball as bright as the reference, at places p_GO (..., 3): shape (..., 6)."""
        distance, cosine = self._ball(beams, p_GO)
        return (self._ticks(distance) * cosine).mean(axis=-1)

    def of_palm(self, beams: tuple[Floats, Floats], p_GO: Floats, down: Floats) -> Floats:
        """Return the ticks that a palm as bright as the reference adds, on which the ball lies: shape (..., 6).

        It is a flat disc about the ball's lowest point, and rays that meet the ball do not get there.

        Args:
            beams: as `beams` gives them.
            p_GO: places of the ball, shape (..., 3), m.
            down: unit vector down, in G.
        """
        window, rays = beams
        from_ball = window - p_GO[..., None, None, :]
        height, fall = self.ball_radius - from_ball @ down, rays @ down
        falls = (fall > 1e-9) & (height > 0.0) & ~np.isfinite(self._ball(beams, p_GO)[0])
        distance = np.where(falls, height / np.where(fall > 1e-9, fall, 1.0), 1.0)
        at = from_ball + distance[..., None] * rays
        beside = np.sum(at**2, axis=-1) - (at @ down) ** 2
        is_met = falls & (beside < self.palm_radius**2)
        return (self._ticks(np.where(is_met, distance, np.inf)) * np.where(is_met, fall, 0.0)).mean(axis=-1)

    def _ball(self, beams: tuple[Floats, Floats], p_GO: Floats) -> tuple[Floats, Floats]:
        """Return where rays meet a ball, m (inf: nowhere), and the cosines of incidence: shapes (..., 6, rays)."""
        window, rays = beams
        from_ball = window - p_GO[..., None, None, :]
        ahead = -np.sum(rays * from_ball, axis=-1)
        square = ahead**2 - np.sum(from_ball**2, axis=-1) + self.ball_radius**2
        meets = (ahead > 0.0) & (square > 0.0)
        half_chord = np.sqrt(np.where(meets, square, 0.0))
        return np.where(meets, ahead - half_chord, np.inf), half_chord / self.ball_radius

    def _ticks(self, distance: Floats) -> Floats:
        """Return the inverted characteristic; nothing is seen beyond `farthest`."""
        far, nearness = np.maximum(distance, self.nearest), np.clip(distance / self.nearest, 0.0, 1.0)
        share = self.contact + (1.0 - self.contact) * nearness
        return np.where(distance <= self.farthest, share * np.interp(far, *self._curve), 0.0)
