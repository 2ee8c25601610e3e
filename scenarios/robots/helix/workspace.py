"""Where the Helix can take a ball: what its cameras see of the place, and how far its arm reaches.

[Vervloet2025] sec. 5.4.1 and fig. 14: the workspace was limited by what both cameras see.
"""

import math
from collections.abc import Sequence

import numpy as np

from handover.controllers.helix.vision.markers import MarkerRing
from handover.cosim.blocks.cameras import CamerasAndMarkers
from handover.cosim.blocks.geometry import Pinhole
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.tendon_parameters import Params as ArmParams
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.robots.helix.cameras import MIN_MARKER_SIDE, PICTURE, CameraPlaces, pinholes

_OUTSIDE = "ball or markers lie outside of the picture"
_TOO_SMALL = f"markers are less than {MIN_MARKER_SIDE:g} px wide"


def cameras_that_see(p_WO: Floats, places: CameraPlaces = CameraPlaces.BEHIND) -> int:
    """Return in how many pictures ball and marker ring are whole, with the gripper at the ball and pointing down.

    What hides them from a camera, such as the arm itself, does not count, since it moves.

    Args:
        p_WO: the ball in W, shape (3,), m.
        places: of the cameras.
    """
    return sum(_sees(camera, p_WO) for camera in pinholes(places=places).values())


def _sees(camera: Pinhole, p_WO: Floats, marker: float | None = None) -> bool:
    """Return whether a camera sees ball and ring whole, with markers of this side, m, or the usual one."""
    return not _hidden(camera, p_WO, marker)


def _hidden(camera: Pinhole, p_WO: Floats, marker: float | None) -> str:
    """Return why a camera does not see ball and ring whole; "" if it does."""
    usual, d_gripper = CamerasAndMarkers(), float(ArmParams().d_gripper)
    p_WR = p_WO + np.array([0.0, 0.0, d_gripper])
    depth_O, depth_R = (float(camera.depth(p)) for p in (p_WO, p_WR))
    if min(depth_O, depth_R) <= 0.0:
        return _OUTSIDE
    side_length = usual.marker if marker is None else marker
    ring = p_WR + MarkerRing(usual.apothem, side_length).outline
    edge = float(camera.f.max()) * usual.ball_radius / depth_O
    side = float(camera.f.min()) * side_length / depth_R
    if not (_is_inside(camera.project(p_WO)[None], edge) and _is_inside(camera.project(ring), 0.0)):
        return _OUTSIDE
    return "" if side >= MIN_MARKER_SIDE else _TOO_SMALL


def _is_inside(pixels: Floats, margin: float) -> bool:
    low, high = pixels.min(axis=0), pixels.max(axis=0)
    return bool((low >= margin).all() and (high <= PICTURE - 1.0 - margin).all())


def reach(height: float) -> float:
    """Return how far from its axis the arm reaches at a height of the gripper in W, m, in every direction; 0: nowhere.

    Between the heights of `paper.toml`, which `handover paper helix-workspace` found, it is interpolated.
    """
    found = paper_values("helix", "reach")
    heights, radii = (np.array(found[name], dtype=np.float64) for name in ("height", "radius"))
    return float(np.interp(height, heights, radii, left=0.0, right=0.0))


def random_place(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return azimuth, rad, radius and height, m, of a place within reach that both cameras see.

    It is drawn evenly over the height, and at each height over the area.
    """
    known: list[float] = paper_values("helix", "reach")["height"]
    heights = [h for h in known if reach(h) > 0.0]
    while True:
        height, azimuth = float(rng.uniform(min(heights), max(heights))), float(rng.uniform(-np.pi, np.pi))
        radius = reach(height) * math.sqrt(rng.uniform())
        if cameras_that_see(np.array([radius * np.cos(azimuth), radius * np.sin(azimuth), height])) == 2:
            return azimuth, radius, height


def notes_on_place(
    p_WO: Floats, places: CameraPlaces = CameraPlaces.BEHIND, marker: float | None = None
) -> Sequence[str]:
    """Return why a handover at a place will hardly succeed, a line for each reason; none where nothing is known.

    Args:
        p_WO: the ball in W, shape (3,), m.
        places: of the cameras.
        marker: side of a marker, m; None: the usual one.
    """
    r, height = float(np.hypot(p_WO[0], p_WO[1])), float(p_WO[2])
    place = f"the ball is offered {r:.2f} m from the arm's axis at a height of {height:.2f} m"
    notes = [f"{place}, but the arm {short}"] if (short := short_of_reach(p_WO)) else []
    cameras = pinholes(places=places)
    hidden = {name: why for name, camera in cameras.items() if (why := _hidden(camera, p_WO, marker))}
    if len(cameras) - len(hidden) < 2:
        seen = "no camera sees" if len(hidden) == len(cameras) else "one camera alone sees"
        reasons = "; ".join(f"{name}: {why}" for name, why in hidden.items())
        notes.append(f"{place}, where {seen} ball and markers whole ({reasons})")
    return notes


def short_of_reach(p_WG: Floats, margin: float = 0.0) -> str:
    """Return how far the arm is sure to reach at a place's height, if the place is farther; "" if it is not.

    Args:
        p_WG: where the gripper is to be in W, pointing down, shape (3,), m.
        margin: how much farther the place may be, m: in most directions the arm reaches farther than it is sure to.
    """
    far, r = reach(float(p_WG[2])), float(np.hypot(p_WG[0], p_WG[1]))
    if far > 0.0 and r <= far + margin:
        return ""
    where = f"is sure to reach {far:.2f} m far there" if far > 0.0 else "is not known to reach that height"
    return f"{where}, whatever the direction"
