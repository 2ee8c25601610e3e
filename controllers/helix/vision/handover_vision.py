"""Finds ball, wrist and gripper in the pictures of two or three cameras, after [Vervloet2025] sec. 3.2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.controllers.helix.vision.ball_fit import BallFit
from handover.controllers.helix.vision.joint_detector import Bounds, JointDetector
from handover.controllers.helix.vision.markers import MarkerReader, MarkerRing
from handover.controllers.helix.vision.published_detector import PublishedDetector
from handover.controllers.helix.vision.ring_fit import RingFit
from handover.controllers.helix.vision.stereo import Pixels
from handover.controllers.helix.vision.vision_parameters import Detector, Params
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import (
    BLACK_1280X720,
    Matrix3,
    Picture1280x720,
    Vector3,
    output,
    port,
)
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.terminals import Terminal, TerminalKind, terminal
from handover.cosim.blocks.units import Metre, SquareMetre

__all__ = ["Detector", "HandoverVision", "Inputs", "Outputs", "Params"]

_UNKNOWN = np.eye(3)  # m^2; covariance of what is not seen


@dataclass(kw_only=True)
class Inputs:
    """Pictures taken at the same time."""

    left: Picture1280x720 = port(BLACK_1280X720, "picture of the left camera")
    right: Picture1280x720 = port(BLACK_1280X720, "picture of the right camera")
    third: Picture1280x720 = port(BLACK_1280X720, "picture of the third camera, if there is one")


@dataclass(kw_only=True)
class Outputs:
    """What is seen and where; what is not repeats the last measurement (zeros before any), with a large covariance."""

    p_WO_meas: Vector3[Metre] = output("measured position of the ball in the world")
    p_WR_meas: Vector3[Metre] = output("measured position of the wrist in the world")
    p_WG_meas: Vector3[Metre] = output("measured position of the gripper in the world")
    cov_O: Matrix3[SquareMetre] = output("covariance of the ball's measured position")
    cov_R: Matrix3[SquareMetre] = output("covariance of the wrist's measured position")
    cov_G: Matrix3[SquareMetre] = output("covariance of the gripper's measured position")
    seen_O: bool = output("whether the ball is seen")
    seen_R: bool = output("whether the wrist's markers are seen")


class HandoverVision:
    """Measures ball, wrist and gripper: p_WG = p_WR + d_gripper z_R, eqs. (12)-(13).

    Two detectors do it. `JointDetector` fits one pose to all marker corners in all pictures, and a sphere to the ball's
    outlines. `PublishedDetector` averages single markers and triangulates circles, as the thesis has it. A step that
    looks at no pictures (decimation) repeats the last measurement.

    The state is the last measurement, and the detector's.

    Raises:
        InvalidCalibration: a quaternion is not of unit length or a focal length not positive.
        InvalidVisionParameters: a parameter is out of range.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("p_WO_meas", "p_WR_meas", "p_WG_meas", "cov_O", "cov_R", "cov_G", "seen_O", "seen_R"),
        ("left", "right", "third"),
    )
    terminals: ClassVar[tuple[Terminal, ...]] = (
        terminal("pictures", TerminalKind.PICTURES, "left", "right", "third"),
        terminal(
            "measurements",
            TerminalKind.MEASUREMENTS,
            *("p_WO_meas", "p_WR_meas", "p_WG_meas"),
            *("cov_O", "cov_R", "cov_G", "seen_O", "seen_R"),
        ),
    )
    period: ClassVar[Fraction | None] = Fraction(1, 30)

    def __init__(self, params: Params) -> None:
        params.check()
        self.params = params
        self._cameras = _cameras(params)
        self._detector = _detector(params, self._cameras)
        self._ticks = 0
        self._seen: Outputs | None = None

    def outputs(self, t: float, u: Inputs) -> Outputs:
        """Return what is seen at the start."""
        state = self.get_state()
        seen = self.step(t, 0.0, u)
        self.set_state(state)
        return seen

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return what is seen in the pictures, or was seen in the last ones that were looked at."""
        is_due = self._ticks % self.params.decimation == 0
        self._ticks += 1
        if is_due or self._seen is None:
            self._seen = self._look(t, (u.left, u.right, u.third)[: len(self._cameras)], self._seen)
        return self._seen

    def get_state(self) -> bytes:
        """Return the last measurement and the detector's state."""
        seen = None if self._seen is None else tuple(vars(self._seen).values())
        return pack_state((self._detector.get_state(), self._ticks, seen))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        found, self._ticks, seen = unpack_state(state)
        self._detector.set_state(found)
        names = [f.name for f in fields(Outputs)]
        self._seen = None if seen is None else Outputs(**dict(zip(names, seen, strict=True)))

    def _look(self, t: float, pictures: Sequence[Pixels], last: Outputs | None) -> Outputs:
        ball, wrist = self._detector.find_ball(pictures), self._detector.find_wrist(t, pictures)
        p_WO, p_WR, p_WG = (last.p_WO_meas, last.p_WR_meas, last.p_WG_meas) if last else np.zeros((3, 3))
        return Outputs(
            p_WO_meas=np.array(ball.p_WO if ball else p_WO),
            p_WR_meas=np.array(wrist.p_WR if wrist else p_WR),
            p_WG_meas=np.array(wrist.p_WG if wrist else p_WG),
            cov_O=np.array(ball.covariance if ball else _UNKNOWN),
            cov_R=np.array(wrist.cov_R if wrist else _UNKNOWN),
            cov_G=np.array(wrist.cov_G if wrist else _UNKNOWN),
            seen_O=ball is not None,
            seen_R=wrist is not None,
        )


def _cameras(p: Params) -> Sequence[Pinhole]:
    cameras = [
        Pinhole("left", p.p_WC_left, p.q_WC_left, p.intrinsics_left, p.distortion_left),
        Pinhole("right", p.p_WC_right, p.q_WC_right, p.intrinsics_right, p.distortion_right),
    ]
    if p.has_third:
        cameras.append(Pinhole("third", p.p_WC_third, p.q_WC_third, p.intrinsics_third, p.distortion_third))
    return cameras


def _detector(p: Params, cameras: Sequence[Pinhole]) -> JointDetector | PublishedDetector:
    ring = MarkerRing(p.apothem, p.marker, p.rings)
    if p.detector is Detector.PUBLISHED:
        return PublishedDetector(cameras, ring, p.d_gripper)
    return JointDetector(
        cameras,
        ring,
        MarkerReader(p.corner_shift, p.rings),
        RingFit(ring, cameras, p.corner_tolerance),
        BallFit(cameras, p.ball_radius, p.outline_noise, (p.edge_shift, p.edge_doubt), p.ray_tolerance),
        Bounds(p.largest_speed, p.largest_turn, p.largest_deviation),
        corner_noise=p.corner_noise,
        ball_radius=p.ball_radius,
        d_gripper=p.d_gripper,
    )
