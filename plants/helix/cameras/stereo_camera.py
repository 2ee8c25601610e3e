"""Two cameras or three and the pictures that they take, after [Vervloet2025] sec. 3.2.1, figs. 3, 4 and 14."""

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.random import Generator

from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Picture1280x720, Polyline25, Vector3, Vector4, output, port
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, Number
from handover.plants.helix.cameras.camera_parameters import InvalidCameraParameters, Params
from handover.plants.helix.cameras.painting import Backdrop, Canvas, Part
from handover.plants.helix.cameras.scene import HandoverScene, MarkerCollar
from handover.plants.helix.cameras.shapes import Decal, Pixels, PolygonLayer
from handover.plants.helix.hand.bowl import Bowl

__all__ = ["Inputs", "InvalidCameraParameters", "Outputs", "Params", "StereoCamera"]

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

    def added(self, picture: Pixels, parts: Sequence[tuple[Part, Pixels]], offset: int) -> Pixels:
        """Return the picture, with other pixels in some parts, and with the noise at the offset."""
        begin, end = offset, offset + self._size
        brighter, darker = (x[begin:end].reshape(self._shape) for x in (self._brighter, self._darker))
        noisy = np.asarray(cv2.add(picture, brighter), dtype=np.uint8)
        for part, pixels in parts:
            noisy[part] = cv2.add(pixels, brighter[part])
        cv2.subtract(noisy, darker, dst=noisy)
        noisy.flags.writeable = False
        return noisy


_WIDTH, _HEIGHT = 1280, 720
_DARK = 5  # level of a picture under a cloth
_FACING = (4, 3, 5, 2, 6, 1, 7, 0)  # markers, from that which faces the cameras as the arm hangs
_HANGING = np.array([0.0, 1.0, 0.0, 0.0])  # q_WR of the arm at rest: R_WR = diag(1, -1, -1)


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
    """Pictures taken at the same time."""

    left: Picture1280x720 = output("picture of the left camera")
    right: Picture1280x720 = output("picture of the right camera")
    third: Picture1280x720 = output("picture of the third camera, if there is one")


class StereoCamera:
    """Takes pictures of the arm, its marker ring and gripper, the ball and the hand, with two cameras or three.

    Pictures are synthesised: solids are projected through either lens's distortion and painted from far to near, then
    blurred, lit unevenly and given sensor noise. A step shows the scene at its start, as the inputs give it; one that
    takes no pictures (decimation) repeats the last ones.

    What may be wrong: the left or the right lens is covered for a while, light is poor, or pictures get lost (each by
    itself). Tape may cover markers, and a card may hide the ball from the left and the right camera. A gripper that
    hides the ball as it comes near, as a bulkier one than is painted here would, is `hide_ball_within`; one behind
    which nothing is seen any more, `cover_within`.

    The state is that of the noise, how near gripper and ball came, and the scene of the last pictures. They are painted
    again from it, unless they are those that were painted last. Pictures cannot be written to, since they may be handed
    out again.

    Raises:
        InvalidCalibration: a quaternion is not of unit length or a focal length not positive.
        InvalidCameraParameters: a parameter is out of range, or a cover ends before it begins.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("left", "right", "third"), ("backbone", "p_WR", "q_WR", "p_WG", "q_WG", "grip", "p_WO", "p_WH")
    )
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("wrist", TerminalKind.POSE, "p_WR", "q_WR"),
        terminal("gripper", TerminalKind.POSE, "p_WG", "q_WG"),
        terminal("pictures", TerminalKind.PICTURES, "left", "right", "third"),
    )
    period: ClassVar[Fraction | None] = Fraction(1, 30)

    def __init__(self, params: Params) -> None:
        params.check()
        p = self.params = params
        cameras = [
            Pinhole("left", p.p_WC_left, p.q_WC_left, p.intrinsics_left, p.distortion_left),
            Pinhole("right", p.p_WC_right, p.q_WC_right, p.intrinsics_right, p.distortion_right),
        ]
        if p.has_third:
            cameras.append(Pinhole("third", p.p_WC_third, p.q_WC_third, p.intrinsics_third, p.distortion_third))
        collar = MarkerCollar(p.apothem, p.marker, _FACING[: p.covered_markers], p.rings)
        bowl = Bowl(p.p_WD, p.bowl_radius, p.bowl_depth, p.ball_radius) if p.bowl_radius > 0.0 else None
        self._scene = HandoverScene(cameras, p.arm_radius, p.ball_radius, collar, bowl)
        self._canvases = [Canvas(Backdrop(camera, _WIDTH, _HEIGHT, p.blur, p.gradient, p.light)) for camera in cameras]
        self._black, self._dark = (np.full((_HEIGHT, _WIDTH, 3), level, dtype=np.uint8) for level in (0, _DARK))
        self._black.flags.writeable = False
        self._between = 0.5 * (p.p_WC_left + p.p_WC_right)
        self._rng = np.random.default_rng(p.seed)
        self._noise = SensorNoise(p.noise, (_HEIGHT, _WIDTH, 3), self._rng)
        self._offsets = self._draw()
        self._lost = self._lose()
        self._ticks = 0
        self._nearest = math.inf  # distance of gripper and ball in pictures that were taken, m
        self._taken: tuple[float, Inputs] | None = None  # when the last pictures were taken, and of what
        self._pictures, self._picture_shows = Outputs(left=self._black, right=self._black, third=self._black), b""
        self._is_current = False  # whether the pictures are the last ones that were taken

    def outputs(self, t: float, u: Inputs) -> Outputs:
        """Return the pictures at the start."""
        p = self.params
        left_is_covered, right_is_covered, hidden = (start <= t < end for start, end in p.covers.values())
        all_are_covered, hidden = self._nearest < p.cover_within, hidden or self._nearest < p.hide_ball_within
        views = self._scene.project(u, self._between if hidden else None)
        covered = (left_is_covered or all_are_covered, right_is_covered or all_are_covered, all_are_covered)
        taken = [self._take(i, *view, covered[i]) for i, view in enumerate(views)]
        return Outputs(left=taken[0], right=taken[1], third=taken[2] if p.has_third else self._black)

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return the pictures taken at t, or the last ones."""
        is_due = self._ticks % self.params.decimation == 0
        self._ticks += 1
        if is_due or self._taken is None:
            self._offsets, self._lost = self._draw(), self._lose()
            self._nearest = min(self._nearest, float(np.linalg.norm(u.p_WG - u.p_WO)))
            self._taken = t, Inputs(**{name: copy.copy(value) for name, value in vars(u).items()})
            self._is_current = False
        if not self._is_current:
            shows = pack_state(self._shown())
            if shows != self._picture_shows:
                self._pictures, self._picture_shows = self.outputs(*self._taken), shows
            self._is_current = True
        return self._pictures

    def get_state(self) -> bytes:
        """Return the noise generator's state, how near gripper and ball came, and what the last pictures depend on."""
        offsets, lost, nearest, taken = self._shown()
        return pack_state((self._rng.bit_generator, offsets, lost, self._ticks, nearest, taken))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        drawn, self._offsets, self._lost, self._ticks, self._nearest, taken = unpack_state(state)
        self._rng.bit_generator.state = drawn
        names = [f.name for f in fields(Inputs)]
        self._taken = None if taken is None else (taken[0], Inputs(**dict(zip(names, taken[1], strict=True))))
        self._is_current = False

    def _shown(self) -> tuple[Any, ...]:
        """Return on what the last pictures depend: noise, which are lost, how near the gripper was, time and scene."""
        taken = None if self._taken is None else (self._taken[0], tuple(vars(self._taken[1]).values()))
        return self._offsets, self._lost, self._nearest, taken

    def _draw(self) -> tuple[int, ...]:
        return tuple(self._noise.draw(self._rng) for _ in self._canvases)

    def _lose(self) -> tuple[bool, ...]:
        """Draw whether the pictures get lost."""
        part = self.params.lost_pictures
        return tuple(part > 0.0 and bool(self._rng.random() < part) for _ in self._canvases)

    def _take(self, i: int, layers: list[PolygonLayer], decals: list[Decal], is_covered: bool) -> Pixels:
        """Return camera i's picture of these things: that of the left one (0), the right one (1), or the third one."""
        if self._lost[i]:
            return self._black
        if is_covered:
            return self._noise.added(self._dark, (), self._offsets[i])
        canvas = self._canvases[i]
        return self._noise.added(canvas.backdrop.seen, canvas.paint(layers, decals), self._offsets[i])
