"""Finds ball, wrist and gripper in a pair of pictures, after [Vervloet2025] sec. 3.2."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.controllers.helix.ball import BallFinder, BallFit, BallOutline, BallPosition
from handover.controllers.helix.markers import MarkerReader, MarkerRing
from handover.controllers.helix.ring_fit import RingFit, RingPose
from handover.controllers.helix.stereo import Pixels, Region, StereoRig, covariance
from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of
from handover.cosim.blocks.ports import (
    BLACK_1280X720,
    Floats,
    Matrix3,
    Picture1280x720,
    Vector3,
    Vector4,
    Vector5,
    output,
    parameter,
    port,
)
from handover.cosim.blocks.state import pack_state, unpack_state
from handover.cosim.blocks.units import Metre, Number, Pixel, SquareMetre

_P_WC_LEFT = np.array([-0.95, 0.25, -0.60])
_P_WC_RIGHT = np.array([-0.95, -0.25, -0.60])
_LOOKED_AT = np.array([0.0, 0.0, -0.62])
_UNKNOWN = np.eye(3)  # m^2; covariance of what is not seen
_BALL_MARGIN = 22.0  # px around where the ball was; a hand moves 10 px a picture at 0.3 m/s
_RING_MARGIN = 16.0  # px


@dataclass(frozen=True, kw_only=True)
class Params:
    """Calibration of the cameras, sizes of what is looked for, and noise."""

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
    apothem: Metre = parameter(0.034, "distance of the markers from the arm's axis", minimum=0.02, maximum=0.1)
    marker: Metre = parameter(0.020, "side of a marker", minimum=0.005, maximum=0.05)
    ball_radius: Metre = parameter(0.025, "radius of the ball", minimum=0.005, maximum=0.1)
    d_gripper: Metre = parameter(0.10, "distance of the gripper from the wrist, eq. (13)", minimum=0.0, maximum=0.5)
    corner_noise: Pixel = parameter(0.2, "standard deviation of a marker's corners", minimum=0.001, maximum=5.0)
    corner_shift: Pixel = parameter(
        0.21, "how far refined corners lie inside of the printed ones, along the diagonal", minimum=-2.0, maximum=2.0
    )
    outline_noise: Pixel = parameter(0.6, "standard deviation of the ball's outline", minimum=0.001, maximum=10.0)
    edge_shift: Pixel = parameter(0.0, "mean shift of the ball's edge outwards", minimum=-3.0, maximum=3.0)
    edge_doubt: Pixel = parameter(0.12, "standard deviation of the edge's shift", minimum=0.001, maximum=3.0)
    corner_tolerance: Pixel = parameter(1.2, "RMS misfit beyond which a marker is left out", minimum=0.1, maximum=20.0)
    ray_tolerance: Metre = parameter(0.012, "largest distance between both cameras' rays to the ball", minimum=0.0)


@dataclass(kw_only=True)
class Inputs:
    """A pair of pictures taken at the same time."""

    left: Picture1280x720 = port(BLACK_1280X720, "picture of the left camera")
    right: Picture1280x720 = port(BLACK_1280X720, "picture of the right camera")


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

    The ball is what is green and round; the wrist is the pose that best explains all marker corners in both pictures.
    Either is searched for where it was last, and everywhere if it is not there. One camera is enough for both, at a
    larger covariance.

    The state is the last measurement, and whether it is fresh.

    Raises:
        InvalidCalibration: a quaternion is not of unit length or a focal length not positive.
    """

    feedthrough: ClassVar[Mapping[str, tuple[str, ...]]] = dict.fromkeys(
        ("p_WO_meas", "p_WR_meas", "p_WG_meas", "cov_O", "cov_R", "cov_G", "seen_O", "seen_R"), ("left", "right")
    )
    period: ClassVar[Fraction | None] = Fraction(1, 30)

    def __init__(self, params: Params) -> None:
        p = self.params = params
        self._rig = StereoRig(
            Pinhole("left", p.p_WC_left, p.q_WC_left, p.intrinsics_left, p.distortion_left),
            Pinhole("right", p.p_WC_right, p.q_WC_right, p.intrinsics_right, p.distortion_right),
        )
        self._ring = MarkerRing(p.apothem, p.marker)
        self._reader = MarkerReader(p.corner_shift)
        self._ring_fit = RingFit(self._ring, self._rig.cameras, p.corner_tolerance)
        self._finder = BallFinder()
        self._ball_fit = BallFit(
            self._rig, p.ball_radius, p.outline_noise, (p.edge_shift, p.edge_doubt), p.ray_tolerance
        )
        self._p_WO = np.zeros(3)
        self._wrist = np.zeros(3), np.eye(3)  # p_WR, R_WR
        self._p_WG = np.zeros(3)
        self._fresh_O = self._fresh_R = False

    def outputs(self, t: float, u: Inputs) -> Outputs:
        """Return what is seen at the start."""
        state = self.get_state()
        seen = self.step(t, 0.0, u)
        self.set_state(state)
        return seen

    def step(self, t: float, dt: float, u: Inputs) -> Outputs:  # noqa: ARG002
        """Return what is seen in the pictures."""
        pictures = (u.left, u.right)
        ball, pose = self._find_ball(pictures), self._find_ring(pictures)
        self._fresh_O, self._fresh_R = ball is not None, pose is not None
        cov_R, cov_G = np.array(_UNKNOWN), np.array(_UNKNOWN)
        if ball:
            self._p_WO = ball.p_WO
        if pose:
            self._wrist = pose.p_WR, pose.R_WR
            self._p_WG = pose.p_WR + self.params.d_gripper * pose.R_WR[:, 2]
            cov_R, cov_G = self._covariances(pose)
        return Outputs(
            p_WO_meas=np.array(self._p_WO),
            p_WR_meas=np.array(self._wrist[0]),
            p_WG_meas=np.array(self._p_WG),
            cov_O=ball.covariance if ball else np.array(_UNKNOWN),
            cov_R=cov_R,
            cov_G=cov_G,
            seen_O=self._fresh_O,
            seen_R=self._fresh_R,
        )

    def get_state(self) -> bytes:
        """Return the last measurement and whether it is fresh."""
        return pack_state((self._p_WO, self._wrist, self._p_WG, self._fresh_O, self._fresh_R))

    def set_state(self, state: bytes) -> None:
        """Restore a state that `get_state` gave."""
        self._p_WO, self._wrist, self._p_WG, self._fresh_O, self._fresh_R = unpack_state(state)

    def _find_ball(self, pictures: tuple[Pixels, Pixels]) -> BallPosition | None:
        if self._fresh_O:
            ball = self._ball_fit.fit(
                *self._outlines(
                    pictures,
                    [
                        self._ball_region(camera, picture)
                        for camera, picture in zip(self._rig.cameras, pictures, strict=True)
                    ],
                )
            )
            if ball:
                return ball
        return self._ball_fit.fit(*self._outlines(pictures, [self._finder.search(p) for p in pictures]))

    def _outlines(
        self, pictures: tuple[Pixels, Pixels], regions: list[Region]
    ) -> tuple[BallOutline | None, BallOutline | None]:
        left, right = (self._finder.find(p, r) for p, r in zip(pictures, regions, strict=True))
        return left, right

    def _ball_region(self, camera: Pinhole, picture: Pixels) -> Region:
        depth = max(float(camera.depth(self._p_WO)), self.params.ball_radius)
        radius = float(camera.f.max()) * self.params.ball_radius / depth
        return Region.around(camera.project(self._p_WO)[None], radius + _BALL_MARGIN, picture)

    def _find_ring(self, pictures: tuple[Pixels, Pixels]) -> RingPose | None:
        if self._fresh_R:
            p_WR, R_WR = self._wrist
            outline = p_WR + self._ring.outline @ np.transpose(R_WR)
            regions = [
                Region.around(camera.project(outline), _RING_MARGIN, picture)
                for camera, picture in zip(self._rig.cameras, pictures, strict=True)
            ]
            seen = [self._reader.read(p, r) for p, r in zip(pictures, regions, strict=True)]
            pose = self._ring_fit.fit(seen, self._wrist)
            if pose:
                return pose
        return self._ring_fit.fit([self._reader.read(p, self._reader.search(p)) for p in pictures], None)

    def _covariances(self, pose: RingPose) -> tuple[Floats, Floats]:
        """Return the covariances of wrist and gripper; d p_WG / d w = d_gripper R [w]x e_z for a turn w in R."""
        cov = covariance(pose.information, self.params.corner_noise)
        lever = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
        J = np.concatenate([np.eye(3), self.params.d_gripper * pose.R_WR @ lever], axis=1)
        return cov[:3, :3], J @ cov @ np.transpose(J)
