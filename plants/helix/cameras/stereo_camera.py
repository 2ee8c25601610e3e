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

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.cosim.blocks.origins import assumed, derived, stated
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
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Levels, Metre, Number, Pixel, Second
from handover.plants.helix.cameras.painting import Backdrop, Canvas, Part
from handover.plants.helix.cameras.scene import HandoverScene, MarkerCollar
from handover.plants.helix.cameras.shapes import Decal, Pixels, PolygonLayer
from handover.plants.helix.hand.bowl import Bowl

_AIMED = assumed("point in W that all cameras look at")
_INTRINSICS = assumed(
    "f_x, f_y, c_x, c_y of left, right and third camera: focal lengths from the 78 degrees of "
    "diagonal field of view that the Logitech Brio of sec. 3.2.1 has at 1280x720; principal "
    "points some px off the middle, as real ones are"
)
_DISTORTION = assumed("k_1, k_2, p_1, p_2, k_3 of left, right and third camera; a webcam's size of distortion")
_UNCOVERED = derived("undisturbed: no lens is covered")

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
_P_WC_LEFT = np.array([-0.95, 0.25, -0.60])
_P_WC_RIGHT = np.array([-0.95, -0.25, -0.60])
_P_WC_THIRD = np.array([-0.55, 0.0, 0.1])
_LOOKED_AT = np.array([0.0, 0.0, -0.62])
_DARK = 5  # level of a picture under a cloth
_FACING = (4, 3, 5, 2, 6, 1, 7, 0)  # markers, from that which faces the cameras as the arm hangs
_HANGING = np.array([0.0, 1.0, 0.0, 0.0])  # q_WR of the arm at rest: R_WR = diag(1, -1, -1)


class InvalidCameraParameters(InvalidParameters):
    """Parameters out of range, or of what is taken away before it is there; `faults` lists all of them."""

    block = "StereoCamera"


@dataclass(frozen=True, kw_only=True)
class Params:
    """Calibration, optics and the visible things' sizes.

    [Vervloet2025] states where the cameras stand, about: side by side, behind the arm, at the gripper's height, and the
    markers' side. All other values are assumed.
    """

    p_WC_left: Vector3[Metre] = parameter(
        _P_WC_LEFT,
        "position of the left camera in the world",
        origin=assumed(
            "left and right camera; sec. 3.2.1 and 5.4.1 say behind the arm, at about the gripper's "
            "height, 0.5 m (of what, is open)"
        ),
    )
    p_WC_right: Vector3[Metre] = parameter(
        _P_WC_RIGHT,
        "position of the right camera in the world",
        origin=assumed(
            "left and right camera; sec. 3.2.1 and 5.4.1 say behind the arm, at about the gripper's "
            "height, 0.5 m (of what, is open)"
        ),
    )
    q_WC_left: Vector4[Number] = parameter(
        quaternion_of(looking_at(_P_WC_LEFT, _LOOKED_AT)),
        "orientation of the left camera in the world",
        origin=_AIMED,
    )
    q_WC_right: Vector4[Number] = parameter(
        quaternion_of(looking_at(_P_WC_RIGHT, _LOOKED_AT)),
        "orientation of the right camera in the world",
        origin=_AIMED,
    )
    intrinsics_left: Vector4[Pixel] = parameter(
        np.array([907.0, 906.0, 642.5, 357.0]),
        "left camera's focal lengths and principal point: fx, fy, cx, cy",
        origin=_INTRINSICS,
    )
    intrinsics_right: Vector4[Pixel] = parameter(
        np.array([908.5, 907.5, 636.0, 361.5]),
        "right camera's focal lengths and principal point: fx, fy, cx, cy",
        origin=_INTRINSICS,
    )
    distortion_left: Vector5[Number] = parameter(
        np.array([0.105, -0.190, 0.0006, -0.0008, 0.060]),
        "left lens's distortion: k1, k2, p1, p2, k3",
        origin=_DISTORTION,
    )
    distortion_right: Vector5[Number] = parameter(
        np.array([0.092, -0.165, -0.0005, 0.0007, 0.045]),
        "right lens's distortion: k1, k2, p1, p2, k3",
        origin=_DISTORTION,
    )
    has_third: bool = parameter(
        False, "whether there is a third camera; its picture is black without", origin=stated("sec. 3.2.1: two cameras")
    )
    p_WC_third: Vector3[Metre] = parameter(
        _P_WC_THIRD,
        "position of the third camera in the world",
        origin=assumed(
            "sec. 5.4.1: one of the cameras looking down from the top, also beside the other two as a "
            "third; where, is open: 50 degrees down on what all look at"
        ),
    )
    q_WC_third: Vector4[Number] = parameter(
        quaternion_of(looking_at(_P_WC_THIRD, _LOOKED_AT)),
        "orientation of the third camera in the world",
        origin=_AIMED,
    )
    intrinsics_third: Vector4[Pixel] = parameter(
        np.array([906.0, 905.5, 639.0, 358.5]),
        "third camera's focal lengths and principal point: fx, fy, cx, cy",
        origin=_INTRINSICS,
    )
    distortion_third: Vector5[Number] = parameter(
        np.array([0.098, -0.178, 0.0002, 0.0004, 0.052]),
        "third lens's distortion: k1, k2, p1, p2, k3",
        origin=_DISTORTION,
    )
    arm_radius: Metre = parameter(
        0.030,
        "radius of the soft arm",
        minimum=0.001,
        maximum=0.1,
        origin=assumed("somewhat less than apothem: figs. 4 and 5 show an octagonal ring somewhat wider than the arm"),
    )
    apothem: Metre = parameter(
        0.034,
        "distance of the markers from the arm's axis",
        minimum=0.02,
        maximum=0.1,
        origin=assumed(
            "distance of the markers from the arm's axis; figs. 4 and 5 show an octagonal ring somewhat "
            "wider than the arm"
        ),
    )
    marker: Metre = parameter(0.020, "side of a marker", minimum=0.005, maximum=0.05, origin=stated("sec. 3.2.4"))
    rings: int = parameter(
        1,
        "rings of markers: a second one sits above the first",
        minimum=1,
        maximum=2,
        origin=stated("sec. 3.2.4: a ring of markers around the wrist"),
    )
    ball_radius: Metre = parameter(
        0.025, "radius of the ball", minimum=0.005, maximum=0.1, origin=assumed("figs. 4 and 6")
    )
    blur: Pixel = parameter(
        0.7,
        "standard deviation of the lenses' blur",
        minimum=0.0,
        maximum=5.0,
        origin=assumed("own choice: a webcam's size of blur"),
    )
    noise: Levels = parameter(
        2.2,
        "standard deviation of the sensors' noise",
        minimum=0.0,
        maximum=60.0,
        origin=assumed("own choice: a webcam's size of noise, of 255 levels"),
    )
    gradient: Number = parameter(
        0.22,
        "relative brightness of lit corner over unlit one",
        minimum=0.0,
        maximum=0.5,
        origin=assumed("own choice: a room is not lit evenly"),
    )
    cover_left_from: Second = parameter(
        0.0, "time at which a cloth covers the left lens", minimum=0.0, origin=_UNCOVERED
    )
    cover_left_until: Second = parameter(
        0.0, "time at which the left lens is free again", minimum=0.0, origin=_UNCOVERED
    )
    cover_right_from: Second = parameter(
        0.0, "time at which a cloth covers the right lens", minimum=0.0, origin=_UNCOVERED
    )
    cover_right_until: Second = parameter(
        0.0, "time at which the right lens is free again", minimum=0.0, origin=_UNCOVERED
    )
    light: Number = parameter(
        1.0,
        "brightness of the scene over the usual one",
        minimum=0.0,
        maximum=5.0,
        origin=derived("the usual brightness, by definition"),
    )
    lost_pictures: Number = parameter(
        0.0,
        "part of the pictures that arrive black",
        minimum=0.0,
        maximum=1.0,
        origin=derived("undisturbed: every picture arrives"),
    )
    decimation: int = parameter(
        1,
        "of 30 pictures a second, every so many-th is taken",
        minimum=1,
        maximum=300,
        origin=assumed("every picture is taken; scenarios set it"),
    )
    covered_markers: int = parameter(
        0,
        "markers of each ring with tape over them, those that face the cameras as the arm hangs first",
        minimum=0,
        maximum=8,
        origin=derived("undisturbed: no tape"),
    )
    hide_ball_from: Second = parameter(
        0.0,
        "time at which a card is held between the ball and the cameras",
        minimum=0.0,
        origin=derived("undisturbed: no card"),
    )
    hide_ball_until: Second = parameter(
        0.0, "time at which the card is taken away", minimum=0.0, origin=derived("undisturbed: no card")
    )
    cover_within: Metre = parameter(
        0.0,
        "distance of gripper and ball from which on, once it came so near, cloths cover all lenses; 0: never",
        minimum=0.0,
        maximum=1.0,
        origin=_UNCOVERED,
    )
    hide_ball_within: Metre = parameter(
        0.0,
        "distance of gripper and ball from which on a card hides the ball; 0: never",
        minimum=0.0,
        maximum=1.0,
        origin=derived("undisturbed: no card"),
    )
    p_WD: Vector3[Metre] = parameter(
        np.array([0.0, -0.16, -0.78]),
        "middle of the bowl's rim in the world, where there is a bowl",
        origin=assumed(
            "own choice for the unit by itself, of no effect while bowl_radius is 0; helix_use_case sets it"
        ),
    )
    bowl_radius: Metre = parameter(
        0.0,
        "radius of the bowl's rim; 0: there is no bowl",
        minimum=0.0,
        maximum=1.0,
        origin=derived("secs. 3.5.1 and 3.5.3: only the third experiment has a bowl"),
    )
    bowl_depth: Metre = parameter(
        0.06, "depth of the bowl", minimum=0.001, maximum=1.0, origin=assumed("size of a bowl")
    )
    seed: int = parameter(0, "seed of the noise", minimum=0)

    def check(self) -> None:
        """Raise InvalidCameraParameters, with all faults, if values are out of range or contradict each other."""
        faults = parameter_faults(self) or [
            f"{what}_until = {end:g} s must not be before {what}_from = {start:g} s"
            for what, (start, end) in self.covers.items()
            if end < start
        ]
        if faults:
            raise InvalidCameraParameters(faults)

    @property
    def covers(self) -> dict[str, tuple[float, float]]:
        """From when until when the left and the right lens are covered and the ball is hidden, s, by parameter."""
        return {
            "cover_left": (self.cover_left_from, self.cover_left_until),
            "cover_right": (self.cover_right_from, self.cover_right_until),
            "hide_ball": (self.hide_ball_from, self.hide_ball_until),
        }


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

    What may be wrong: the left or the right lens is covered for a while, light is poor, pictures get lost (each by
    itself), tape covers markers, a card hides the ball from the left and the right camera. A gripper that hides the
    ball as it comes near, as a bulkier one than is painted here would, is `hide_ball_within`; one behind which nothing
    is seen any more, `cover_within`.

    The state is that of the noise, how near gripper and ball came, and the scene of the last pictures: they are painted
    again from these, unless they are those that were painted last. Pictures cannot be written to, since they may be
    handed out again.

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
