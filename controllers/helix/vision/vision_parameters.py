"""Parameters of the Helix's vision; apart from its detectors, which take OpenCV, so that they are listed at once."""

import enum
from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.block import InvalidParameters
from handover.cosim.blocks.geometry import looking_at, quaternion_of
from handover.cosim.blocks.origins import assumed, derived, stated
from handover.cosim.blocks.ports import Vector3, Vector4, Vector5, parameter
from handover.cosim.blocks.start_values import parameter_faults
from handover.cosim.blocks.units import Metre, MetrePerSecond, Number, Pixel, RadianPerSecond

_AIMED = assumed("point in W that all cameras look at")
_INTRINSICS = assumed(
    "f_x, f_y, c_x, c_y of left, right and third camera: focal lengths from the 78 degrees of "
    "diagonal field of view that the Logitech Brio of sec. 3.2.1 has at 1280x720; principal "
    "points some px off the middle, as real ones are"
)
_DISTORTION = assumed("k_1, k_2, p_1, p_2, k_3 of left, right and third camera; a webcam's size of distortion")

_P_WC_LEFT = np.array([-0.95, 0.25, -0.60])
_P_WC_RIGHT = np.array([-0.95, -0.25, -0.60])
_P_WC_THIRD = np.array([-0.55, 0.0, 0.1])
_LOOKED_AT = np.array([0.0, 0.0, -0.62])
_CORNER_SHIFT, _EDGE_SHIFT = 0.24, -0.005  # px; as scenarios/helix/calibrate_detector.py estimates them from pictures


class InvalidVisionParameters(InvalidParameters):
    """Parameters out of range; `faults` lists all of them."""

    block = "HandoverVision"


class Detector(enum.IntEnum):
    """How ball and wrist are found."""

    JOINT = 0
    PUBLISHED = 1


@dataclass(frozen=True, kw_only=True)
class Params:
    """Calibration of the cameras, sizes of what is looked for, and noise."""

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
    has_third: bool = parameter(False, "whether there is a third camera", origin=stated("sec. 3.2.1: two cameras"))
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
    detector: Detector = parameter(
        Detector.JOINT,
        "one fit to all that the cameras see, or the thesis's averages",
        origin=assumed(
            "one fit to all that both cameras see; the thesis's own (sec. 3.2.3 and 3.2.4) is detector=published"
        ),
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
    d_gripper: Metre = parameter(
        0.10,
        "distance of the gripper from the wrist, eq. (13)",
        minimum=0.0,
        maximum=0.5,
        origin=stated("sec. 3.2.4, appendix A"),
    )
    corner_noise: Pixel = parameter(
        0.2,
        "standard deviation of a marker's corners",
        minimum=0.001,
        maximum=5.0,
        origin=assumed("own choice: of refined corners in pictures with such noise and blur"),
    )
    corner_shift: Pixel = parameter(
        _CORNER_SHIFT,
        "how far refined corners lie inside of the printed ones, along the diagonal",
        minimum=-2.0,
        maximum=2.0,
        origin=derived("python -m handover.scenarios.helix.calibrate_detector"),
    )
    outline_noise: Pixel = parameter(
        0.08,
        "standard deviation of the ball's outline",
        minimum=0.001,
        maximum=10.0,
        origin=assumed("own choice: of the ball's outline in pictures with such noise and blur"),
    )
    edge_shift: Pixel = parameter(
        _EDGE_SHIFT,
        "mean shift of the ball's edge outwards",
        minimum=-3.0,
        maximum=3.0,
        origin=derived("python -m handover.scenarios.helix.calibrate_detector"),
    )
    edge_doubt: Pixel = parameter(
        0.04,
        "standard deviation of the edge's shift",
        minimum=0.001,
        maximum=3.0,
        origin=assumed("own choice: by light and surroundings the edge's shift differs so much"),
    )
    corner_tolerance: Pixel = parameter(
        1.2,
        "RMS misfit beyond which a marker is left out",
        minimum=0.1,
        maximum=20.0,
        origin=assumed("own choice: six times corner_noise"),
    )
    ray_tolerance: Metre = parameter(
        0.012,
        "largest distance between the cameras' rays to the ball",
        minimum=0.0,
        origin=assumed("own choice: half of the ball's radius"),
    )
    largest_speed: MetrePerSecond = parameter(
        0.5,
        "speed of the wrist beyond which a pose contradicts the last one",
        minimum=0.0,
        maximum=100.0,
        origin=assumed("own choice: faster than the arm swings"),
    )
    largest_turn: RadianPerSecond = parameter(
        2.0,
        "rate of turn of the wrist beyond which a pose contradicts the last one",
        minimum=0.0,
        maximum=1000.0,
        origin=assumed("own choice: faster than the arm turns the wrist"),
    )
    largest_deviation: Metre = parameter(
        0.005,
        "expected error of the wrist beyond which a pose is worth nothing",
        minimum=0.0,
        maximum=10.0,
        origin=assumed("own choice: a fifth of the ball's radius"),
    )
    decimation: int = parameter(
        1,
        "of 30 pairs of pictures a second, every so many-th is looked at",
        minimum=1,
        maximum=300,
        origin=assumed("every picture is taken; scenarios set it"),
    )

    def check(self) -> None:
        """Raise InvalidVisionParameters, with all faults, if values are out of range."""
        faults = parameter_faults(self)
        if faults:
            raise InvalidVisionParameters(faults)
