"""What a unit that takes pictures of an arm and one that looks at them declare alike: cameras, markers, ball.

They stand here, as plants and controllers do not import each other. [Vervloet2025] sec. 3.2.
"""

from dataclasses import dataclass

import numpy as np

from handover.cosim.blocks.geometry import looking_at, quaternion_of
from handover.cosim.blocks.origins import Origin, assumed, stated
from handover.cosim.blocks.ports import Floats, Vector3, Vector4, Vector5, parameter
from handover.cosim.blocks.units import Metre, Number, Pixel

_AIMED = assumed("point in W that all cameras look at")
_INTRINSICS = assumed(
    "f_x, f_y, c_x, c_y of left, right and third camera. Focal lengths follow from the 78 degrees of diagonal field "
    "of view of the Logitech Brio of sec. 3.2.1 at 1280x720. Principal points are some px off the middle"
)
_DISTORTION = assumed("k_1, k_2, p_1, p_2, k_3 of left, right and third camera; a webcam's size of distortion")
_BEHIND = assumed(
    "left and right camera; sec. 3.2.1 and 5.4.1 say behind the arm, at about the gripper's "
    "height, 0.5 m (of what, is open)"
)
_ABOVE = assumed(
    "sec. 5.4.1: one of the cameras looking down from the top, also beside the other two as a third. Where is "
    "open: 50 degrees down on what all look at"
)

_P_WC_LEFT = np.array([-0.95, 0.25, -0.60])
_P_WC_RIGHT = np.array([-0.95, -0.25, -0.60])
_P_WC_THIRD = np.array([-0.55, 0.0, 0.1])
LOOKED_AT = np.array([0.0, 0.0, -0.62])
"""Point in W that all cameras look at, m."""


def _position(camera: str, p_WC: Floats, origin: Origin) -> Floats:
    return parameter(p_WC, f"position of the {camera} camera in the world", origin=origin)


def _orientation(camera: str, p_WC: Floats) -> Floats:
    q_WC = quaternion_of(looking_at(p_WC, LOOKED_AT))
    return parameter(q_WC, f"orientation of the {camera} camera in the world", origin=_AIMED)


def _intrinsics(camera: str, *values: float) -> Floats:
    text = f"{camera} camera's focal lengths and principal point: fx, fy, cx, cy"
    return parameter(np.array(values), text, origin=_INTRINSICS)


def _distortion(camera: str, *values: float) -> Floats:
    return parameter(np.array(values), f"{camera} lens's distortion: k1, k2, p1, p2, k3", origin=_DISTORTION)


@dataclass(frozen=True, kw_only=True)
class CamerasAndMarkers:
    """Calibration of two cameras or three, and sizes of what they see."""

    p_WC_left: Vector3[Metre] = _position("left", _P_WC_LEFT, _BEHIND)
    p_WC_right: Vector3[Metre] = _position("right", _P_WC_RIGHT, _BEHIND)
    q_WC_left: Vector4[Number] = _orientation("left", _P_WC_LEFT)
    q_WC_right: Vector4[Number] = _orientation("right", _P_WC_RIGHT)
    intrinsics_left: Vector4[Pixel] = _intrinsics("left", 907.0, 906.0, 642.5, 357.0)
    intrinsics_right: Vector4[Pixel] = _intrinsics("right", 908.5, 907.5, 636.0, 361.5)
    distortion_left: Vector5[Number] = _distortion("left", 0.105, -0.190, 0.0006, -0.0008, 0.060)
    distortion_right: Vector5[Number] = _distortion("right", 0.092, -0.165, -0.0005, 0.0007, 0.045)
    has_third: bool = parameter(
        False, "whether there is a third camera; its picture is black without", origin=stated("sec. 3.2.1: two cameras")
    )
    p_WC_third: Vector3[Metre] = _position("third", _P_WC_THIRD, _ABOVE)
    q_WC_third: Vector4[Number] = _orientation("third", _P_WC_THIRD)
    intrinsics_third: Vector4[Pixel] = _intrinsics("third", 906.0, 905.5, 639.0, 358.5)
    distortion_third: Vector5[Number] = _distortion("third", 0.098, -0.178, 0.0002, 0.0004, 0.052)
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
    marker: Metre = parameter(
        0.020, "side of the wrist's markers", minimum=0.005, maximum=0.05, origin=stated("sec. 3.2.4")
    )
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
