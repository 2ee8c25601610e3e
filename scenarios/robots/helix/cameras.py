"""The two cameras of the experiment, or three: where they are, and where the calibration finds them.

As in the thesis ([Vervloet2025] sec. 3.2.2), somebody clicks on six corners of a box in each picture, and the detector
gets the poses that follow from these clicks alone. Lenses are calibrated separately, which is taken as perfect (an
assumption).
"""

import enum
from collections.abc import Mapping
from typing import Any

import numpy as np

from handover.cosim.blocks.cameras import LOOKED_AT, CamerasAndMarkers
from handover.cosim.blocks.geometry import Pinhole, looking_at, quaternion_of, rotation_by
from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.paper import paper_values


class CameraPlaces(enum.IntEnum):
    """Where the cameras are: two behind the arm, or as [Vervloet2025] sec. 5.4.1 suggests.

    Either the right one is above or at the side, or a third one is above.
    """

    BEHIND = 0
    TOP = 1
    SIDE = 2
    THREE = 3

    @property
    def sides(self) -> tuple[str, ...]:
        """The cameras' names, as the units' parameters end with them."""
        return ("left", "right", "third") if self is CameraPlaces.THREE else ("left", "right")

    @property
    def above(self) -> tuple[str, ...]:
        """Those of the cameras that look down."""
        return {CameraPlaces.TOP: ("right",), CameraPlaces.THREE: ("third",)}.get(self, ())


PICTURE = np.array([1280.0, 720.0])
"""Width and height of a picture, px."""
MIN_MARKER_SIDE = 14.0
"""Side of a marker in a picture from which the ring is found nearly always, px (all of 42 poses at 14.5 px and more, 11
of 14 at 13, 2 of 14 at 11.7)."""
_MARGIN = 1.0 / 12.0  # of a marker's side, on each side of it: half a cell of white


def camera_parameters(turned: float = 0.0, places: CameraPlaces = CameraPlaces.BEHIND) -> dict[str, Any]:
    """Return the cameras' true poses and lenses under the names of the units' parameters.

    Args:
        turned: angle by which the right camera was turned to its left about its upright axis, rad.
        places: of the cameras.
    """
    usual = CamerasAndMarkers()
    parameters: dict[str, Any] = {"has_third": True} if places is CameraPlaces.THREE else {}
    elsewhere = {
        (CameraPlaces.TOP, "right"): usual.p_WC_third,
        (CameraPlaces.SIDE, "right"): np.array(paper_values("helix", "camera")["p_WC_side"]),
    }
    for side in places.sides:
        p_WC = elsewhere.get((places, side), getattr(usual, f"p_WC_{side}"))
        turn = rotation_by(np.array([0.0, -turned if side == "right" else 0.0, 0.0]))
        parameters[f"p_WC_{side}"] = p_WC
        parameters[f"q_WC_{side}"] = quaternion_of(looking_at(p_WC, LOOKED_AT) @ turn)
        for lens in (f"intrinsics_{side}", f"distortion_{side}"):
            parameters[lens] = getattr(usual, lens)
    return parameters


def pinholes(turned: float = 0.0, places: CameraPlaces = CameraPlaces.BEHIND) -> dict[str, Pinhole]:
    """Return the cameras as they are, by their names; the arguments are those of `camera_parameters`."""
    parameters = camera_parameters(turned, places)
    return {side: camera_of(side, parameters) for side in places.sides}


def camera_of(side: str, parameters: Mapping[str, Any]) -> Pinhole:
    """Return the camera `left`, `right` or `third` of what `camera_parameters` or `calibrated` returned."""
    return Pinhole(side, *(parameters[f"{what}_{side}"] for what in ("p_WC", "q_WC", "intrinsics", "distortion")))


def box_corners(height: float) -> Floats:
    """Return the corners of the calibration box that are clicked on, shape (6, 3), in W, m.

    They are those of the side that faces the cameras, and the two far ones of the top.

    Args:
        height: of the box's middle, m; it stands below the mount.
    """
    x, y, z = (0.5 * np.array(paper_values("helix", "calibration")["box_size"])).tolist()
    near = [[-x, y, z], [-x, -y, z], [-x, -y, -z], [-x, y, -z]]
    return np.array([0.0, 0.0, height]) + np.array([*near, [x, y, z], [x, -y, z]])


def calibrated(
    click_noise: float, seed: int, box_height: float, places: CameraPlaces = CameraPlaces.BEHIND
) -> dict[str, Any]:
    """Return what the calibration finds, under the names of the detector's parameters.

    Args:
        click_noise: standard deviation of a click along an axis of the picture, px.
        seed: draws the clicks.
        box_height: height of the box's middle, m.
        places: of the cameras; a corner that the box itself hides from one of them is not clicked on.

    Raises:
        TooFewCorners: a camera sees fewer than four of the corners.
    """
    from handover.controllers.helix.vision.calibration import (
        camera_pose,  # OpenCV is slow to import, and lists import this
    )

    rng = np.random.default_rng(seed)
    found, corners = camera_parameters(places=places), box_corners(box_height)
    outwards = np.sign(corners - np.array([0.0, 0.0, box_height]))
    for side in places.sides:
        camera = camera_of(side, found)
        pixels = camera.project(corners)
        seen = np.all((pixels >= 0.0) & (pixels <= PICTURE - 1.0), axis=1)
        seen &= np.any(outwards * (camera.p_WC - corners) > 0.0, axis=1)
        clicked = np.where(seen[:, None], pixels + click_noise * rng.standard_normal(pixels.shape), np.nan)
        lens = (found[f"{what}_{side}"] for what in ("intrinsics", "distortion"))
        pose = camera_pose(side, clicked, corners, *lens)
        found[f"p_WC_{side}"], found[f"q_WC_{side}"] = pose.p_WC, pose.q_WC
    return found


def marker_fault(marker: float) -> str | None:
    """Return what is wrong with markers of a size, and which would do; None if the cameras resolve them.

    At the place within reach that is farthest from the two cameras a marker's side is f marker / depth wide, f being
    the larger focal length. It must also leave white around itself on the collar's side, which is 2 apothem tan(22.5
    degrees) wide.

    Args:
        marker: side of a marker, m.
    """
    two, reach = pinholes().values(), paper_values("helix", "reach")
    f = max(float(camera.f.max()) for camera in two)
    farthest = [np.array([r, 0.0, z]) for z, r in zip(reach["height"], reach["radius"], strict=True)]
    depth = max(float(camera.depth(p_WG)) for camera in two for p_WG in farthest)
    side_of_collar = 2.0 * CamerasAndMarkers().apothem * np.tan(np.pi / 8.0)
    least, most = MIN_MARKER_SIDE * depth / f, side_of_collar / (1.0 + 2.0 * _MARGIN)
    would_do = f"{np.ceil(1e4 * least) / 1e4:g} to {np.floor(1e4 * most) / 1e4:g} m would do"
    if marker < least:
        return (
            f"no camera resolves it: its side is {f * marker / depth:.1f} px wide where the arm is farthest from the "
            f"cameras, at {depth:.2f} m, and markers below {MIN_MARKER_SIDE:g} px are often not read; {would_do}"
        )
    if marker > most:
        return f"it leaves no white around itself on the sides of the collar; {would_do}"
    return None
