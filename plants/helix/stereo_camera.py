"""Two cameras behind the arm and the pictures that they take, after [Vervloet2025] sec. 3.2.1, figs. 3, 4 and 14."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import cv2
import numpy as np
from numpy.random import Generator

from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.cosim.blocks.ports import (
    Picture1280x720,
    Polyline25,
    Vector3,
    Vector4,
    Vector5,
    output,
    parameter,
    port,
)
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Levels, Metre, Number, Pixel, Second
from handover.plants.helix.painting import Backdrop, Canvas
from handover.plants.helix.scene import HandoverScene, MarkerCollar
from handover.plants.helix.shapes import Pixels

_OFFSETS = 1 << 20  # places in the sheet of noise where a picture's part may begin


class SensorNoise:
    """Adds rounded normal noise, drawn once, from an offset that is drawn anew for each picture.

    Drawing 2.8 million normal numbers a picture would cost more than the picture. So a sheet somewhat larger than a
    picture is drawn at the start, and a picture takes a contiguous part of it: pixels of one picture are independent,
    and two pictures are, but for a shift of the sheet against itself. The sheet is kept as what brightens and what
    darkens, so that saturating 8-bit arithmetic does the rest.

    Args:
        sigma: standard deviation in levels.
        shape: of the pictures, (height, width, 3).
        rng: draws the sheet.
    """

    def __init__(self, sigma: float, shape: tuple[int, int, int], rng: Generator) -> None:
        self._shape = shape
        self._size = int(np.prod(shape))
        sheet = rng.standard_normal(self._size + _OFFSETS, dtype=np.float32)
        sheet = np.rint(np.clip(sheet * np.float32(sigma), -255.0, 255.0)).astype(np.int16)
        self._brighter = np.maximum(sheet, 0).astype(np.uint8)
        self._darker = np.maximum(-sheet, 0).astype(np.uint8)

    @staticmethod
    def draw(rng: Generator) -> int:
        """Return an offset into the sheet."""
        return int(rng.integers(_OFFSETS))

    def add(self, picture: Pixels, offset: int) -> None:
        """Add the noise at the offset to the picture."""
        part = slice(offset, offset + self._size)
        cv2.add(picture, self._brighter[part].reshape(self._shape), dst=picture)
        cv2.subtract(picture, self._darker[part].reshape(self._shape), dst=picture)


_WIDTH, _HEIGHT = 1280, 720
_P_WC_LEFT = np.array([-0.95, 0.25, -0.60])
_P_WC_RIGHT = np.array([-0.95, -0.25, -0.60])
_LOOKED_AT = np.array([0.0, 0.0, -0.62])
_DARK = 5  # level of a picture under a cloth
_HANGING = np.array([0.0, 1.0, 0.0, 0.0])  # q_WR of the arm at rest: R_WR = diag(1, -1, -1)


class InvalidCover(ValueError):
    """A camera's cover ends before it begins."""

    is_refusal = True

    def __init__(self, camera: str, start: float, end: float) -> None:
        super().__init__(f"camera {camera!r}: covered from {start} s until {end} s; the end must not come first")
        self.camera, self.start, self.end = camera, start, end


@dataclass(frozen=True, kw_only=True)
class Params:
    """Calibration, optics and the visible things' sizes.

    [Vervloet2025] states where the cameras stand, about: side by side, behind the arm, at the gripper's height, and the
    markers' side. All other values are assumed.
    """

    p_WC_left: Vector3[Metre] = parameter(_P_WC_LEFT, "position of the left camera in the world")
    p_WC_right: Vector3[Metre] = parameter(_P_WC_RIGHT, "position of the right camera in the world")
    q_WC_left: Vector4[Number] = parameter(
        quaternion_of(looking_at(_P_WC_LEFT, _LOOKED_AT)), "orientation of the left camera in the world"
    )
    q_WC_right: Vector4[Number] = parameter(
        quaternion_of(looking_at(_P_WC_RIGHT, _LOOKED_AT)), "orientation of the right camera in the world"
    )
    intrinsics_left: Vector4[Pixel] = parameter(
        np.array([907.0, 906.0, 642.5, 357.0]), "left camera's focal lengths and principal point: fx, fy, cx, cy"
    )
    intrinsics_right: Vector4[Pixel] = parameter(
        np.array([908.5, 907.5, 636.0, 361.5]), "right camera's focal lengths and principal point: fx, fy, cx, cy"
    )
    distortion_left: Vector5[Number] = parameter(
        np.array([0.105, -0.190, 0.0006, -0.0008, 0.060]), "left lens's distortion: k1, k2, p1, p2, k3"
    )
    distortion_right: Vector5[Number] = parameter(
        np.array([0.092, -0.165, -0.0005, 0.0007, 0.045]), "right lens's distortion: k1, k2, p1, p2, k3"
    )
    arm_radius: Metre = parameter(0.030, "radius of the soft arm", minimum=0.001, maximum=0.1)
    apothem: Metre = parameter(0.034, "distance of the markers from the arm's axis", minimum=0.02, maximum=0.1)
    marker: Metre = parameter(0.020, "side of a marker", minimum=0.005, maximum=0.05)
    ball_radius: Metre = parameter(0.025, "radius of the ball", minimum=0.005, maximum=0.1)
    blur: Pixel = parameter(0.7, "standard deviation of the lenses' blur", minimum=0.0, maximum=5.0)
    noise: Levels = parameter(2.2, "standard deviation of the sensors' noise", minimum=0.0, maximum=60.0)
    gradient: Number = parameter(0.22, "relative brightness of lit corner over unlit one", minimum=0.0, maximum=0.5)
    cover_left_from: Second = parameter(0.0, "time at which a cloth covers the left lens", minimum=0.0)
    cover_left_until: Second = parameter(0.0, "time at which the left lens is free again", minimum=0.0)
    cover_right_from: Second = parameter(0.0, "time at which a cloth covers the right lens", minimum=0.0)
    cover_right_until: Second = parameter(0.0, "time at which the right lens is free again", minimum=0.0)
    seed: int = parameter(0, "seed of the noise", minimum=0)


@dataclass(kw_only=True)
class Inputs:
    """Where the visible things are."""

    backbone: Polyline25[Metre] = port(
        np.linspace([0.0, 0.0, 0.0], [0.0, 0.0, -0.6], 25), "points on the arm's centre line from mount to wrist"
    )
    p_WR: Vector3[Metre] = port(np.array([0.0, 0.0, -0.6]), "position of the marker ring in the world")
    q_WR: Vector4[Number] = port(_HANGING, "orientation of the marker ring in the world")
    p_WG: Vector3[Metre] = port(np.array([0.0, 0.0, -0.7]), "position of the gripper in the world")
    q_WG: Vector4[Number] = port(_HANGING, "orientation of the gripper in the world")
    grip: Number = port(0.0, "closure of the gripper: 0 open, 1 closed")
    p_WO: Vector3[Metre] = port(np.array([0.18, 0.0, -0.62]), "position of the ball in the world")
    p_WH: Vector3[Metre] = port(np.array([0.18, 0.0, -0.66]), "position of the palm in the world")


@dataclass(kw_only=True)
class Outputs:
    """A pair of pictures taken at the same time."""

    left: Picture1280x720 = output("picture of the left camera")
    right: Picture1280x720 = output("picture of the right camera")


class StereoCamera:
    """Takes a pair of pictures of the arm, its marker ring and gripper, the ball and the hand.

    Pictures are synthesised: solids are projected through either lens's distortion and painted from far to near, then
    blurred, lit unevenly and given sensor noise. A step shows the scene at its start, as the inputs give it.

    The state is that of the noise: the generator and where the last pair's noise was taken from.

    Raises:
        InvalidCalibration: a quaternion is not of unit length or a focal length not positive.
        InvalidCover: a cover ends before it begins.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("left", "right"), ("backbone", "p_WR", "q_WR", "p_WG", "q_WG", "grip", "p_WO", "p_WH")
    )
    period: ClassVar[Fraction | None] = Fraction(1, 30)

    def __init__(self, params: Params) -> None:
        p = self.params = params
        collar = MarkerCollar(p.apothem, p.marker)
        self._left = _View(p, Pinhole("left", p.p_WC_left, p.q_WC_left, p.intrinsics_left, p.distortion_left), collar)
        self._right = _View(
            p, Pinhole("right", p.p_WC_right, p.q_WC_right, p.intrinsics_right, p.distortion_right), collar
        )
        for camera, start, end in self._covers():
            if end < start:
                raise InvalidCover(camera, start, end)
        self._rng = np.random.default_rng(p.seed)
        self._noise = SensorNoise(p.noise, (_HEIGHT, _WIDTH, 3), self._rng)
        self._offsets = self._draw()

    def outputs(self, t: float, u: Inputs) -> Outputs:
        """Return the pictures at the start."""
        left, right = (start <= t < end for _, start, end in self._covers())
        return Outputs(left=self._take(self._left, u, left, 0), right=self._take(self._right, u, right, 1))

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the pictures taken at t."""
        self._offsets = self._draw()
        return self.outputs(t, u)

    def get_state(self) -> bytes:
        """Return the noise generator's state and the offsets of the last pair's noise."""
        return pack_state((self._rng.bit_generator, self._offsets))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        self._rng.bit_generator.state, self._offsets = unpack_state(state)

    def _covers(self) -> list[tuple[str, float, float]]:
        p = self.params
        return [
            ("left", p.cover_left_from, p.cover_left_until),
            ("right", p.cover_right_from, p.cover_right_until),
        ]

    def _draw(self) -> tuple[int, int]:
        return self._noise.draw(self._rng), self._noise.draw(self._rng)

    def _take(self, view: "_View", u: Inputs, covered: bool, side: int) -> Pixels:
        picture = np.full((_HEIGHT, _WIDTH, 3), _DARK, dtype=np.uint8) if covered else view.picture(u)
        self._noise.add(picture, self._offsets[side])
        return picture


class _View:
    """One camera's scene and canvas."""

    def __init__(self, p: Params, camera: Pinhole, collar: MarkerCollar) -> None:
        self._scene = HandoverScene(camera, p.arm_radius, p.ball_radius, collar)
        self._canvas = Canvas(Backdrop(camera, _WIDTH, _HEIGHT, p.blur, p.gradient))

    def picture(self, u: Inputs) -> Pixels:
        return self._canvas.picture(*self._scene.project(u))
