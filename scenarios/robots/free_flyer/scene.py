"""The free-flyer's scene as solids, drawn to scale from the side and from above: cube, arm, gripper, hand, object."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgb

from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.free_flyer.hand.gripper_contact import JAW_SIDES, PALM_THICKNESS
from handover.plants.free_flyer.hand.hand_kinematics import FINGERS, PALM, PALM_SIDES, RADIUS, joint_places
from handover.plants.free_flyer.hand.parameters import Params as PersonParams
from handover.plants.free_flyer.large_object.parameters import Params as LargeObjectParams
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import figure
from handover.scenarios.robots.free_flyer.parameters import Hands

_CUBE, _ARM, _JAW, _SKIN, _THING = "#c9d3df", "#8793a3", "#2f6db5", "#e3b591", "#d1602b"

EDGE = 0.305
"""Edge of the robot's cube, m."""
OBJECT = (0.021, 0.195, 0.017)
"""Sides of the object, m."""
PALM_DEPTH = 0.03
"""How far the gripper's palm lies behind G, m."""
_ARM_WIDTH, _PALM_SIDES = 0.04, (PALM_THICKNESS, 0.05, 0.075)
FINGER_WIDTH = 2 * RADIUS
"""Thickness of a person's fingers, m."""

_NEAR = np.array([0.20, 0.20, 0.20])
"""Half the sides of a window for pictures from near, m."""

_MARGIN, _MAX_SIDE = 0.05, 3.0
"""Margin around a scene, and the longest side up to which it is shown as a whole, m."""

_CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
_FACES = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]])


@dataclass(frozen=True)
class _View:
    """The axes of W to the right and upwards, and the direction from the scene to the eye."""

    caption: str
    axes: tuple[int, int]
    to_eye: Floats


_VIEWS = (
    _View("from the side", (0, 2), np.array([0.0, -1.0, 0.0])),
    _View("from above", (0, 1), np.array([0.0, 0.0, 1.0])),
)


@dataclass(frozen=True)
class Solid:
    """A box: its corners in W, shape (8, 3), m, and its colour."""

    corners: Floats
    colour: str


def jaw_gap(record: Record, suffix: str = "") -> Floats:
    """Return the room between the jaws of the gripper, or of a robot's with a suffix, over time, shape (rows,), m."""
    g, angle = vars(PersonParams()), record[f"person.gripper_angle{suffix}"]
    return g["aperture"] * (angle - g["angle_empty"]) / (g["angle_open"] - g["angle_empty"])


def robot_at(record: Record, row: int, gap: float, robot: str = "robot") -> list[Solid]:
    """Return cube, arm, palm and jaws of a robot at one row of a record; `gap` is the room between the jaws, m."""
    R_WB = rotation_of(_at(record, f"{robot}.q_WB", row))
    p_WB, p_WG = _at(record, f"{robot}.p_WB", row), _at(record, f"{robot}.p_WG", row)
    p_BG: Floats = np.transpose(R_WB) @ (p_WG - p_WB)
    face, palm = np.array([-EDGE / 2, 0.0, 0.0]), p_BG + np.array([PALM_DEPTH + _PALM_SIDES[0] / 2, 0.0, 0.0])
    arm = (float(np.linalg.norm(palm - face)), _ARM_WIDTH, _ARM_WIDTH)
    apart = np.array([0.0, 0.0, (gap + JAW_SIDES[2]) / 2])
    parts: tuple[tuple[Floats, tuple[float, float, float], str], ...] = (
        (np.zeros(3), (EDGE, EDGE, EDGE), _CUBE),
        ((face + palm) / 2, arm, _ARM),
        (palm, _PALM_SIDES, _JAW),
        (p_BG + apart, JAW_SIDES, _JAW),
        (p_BG - apart, JAW_SIDES, _JAW),
    )
    return [_box(p_WB + R_WB @ p_BX, R_WB, sides, colour) for p_BX, sides, colour in parts]


def _at(record: Record, signal: str, row: int) -> Floats:
    return record[signal][row]


def person_at(record: Record, row: int) -> list[Solid]:
    """Return object, palm and fingers at one row of a record."""
    thing = _box(_at(record, "person.p_WO", row), rotation_of(_at(record, "person.q_WO", row)), OBJECT, _THING)
    return [thing, *hand_at(record, row)]


def hand_at(record: Record, row: int, suffix: str = "") -> list[Solid]:
    """Return palm and fingers of the hand, or of one with a suffix, at one row of a record."""
    p_WH, q_WH, finger = (_at(record, f"person.{name}{suffix}", row) for name in ("p_WH", "q_WH", "finger"))
    R_WH = rotation_of(q_WH)
    palm = p_WH + R_WH @ np.array(PALM)
    return [_box(palm, R_WH, PALM_SIDES, _SKIN), *_fingers(p_WH, R_WH, finger)]


def large_object_at(record: Record, row: int, hands: Hands) -> list[Solid]:
    """Return a large object, and then its handles, where they are for the hands that hold it, at one row of a record.

    One hand in the middle has its handle there, in place of the two at the ends. The posts on which handles stand are
    drawn only: nothing touches them.
    """
    large = {name: np.array(value) for name, value in vars(LargeObjectParams()).items()}
    p_WO, R_WO = _at(record, "person.p_WO", row), rotation_of(_at(record, "person.q_WO", row))
    length, width, thick = large["object_size"].tolist()
    bars = large["handle_size"].tolist()
    beside = np.array([0.0, 0.5, 0.0])
    if hands is Hands.ONE_AT_MIDDLE:
        large["hand_spacing"] = np.zeros(1)
    places = [
        large[place] + side * large[spacing] * beside
        for place, spacing in (("p_OG", "grip_spacing"), ("p_OH", "hand_spacing"))
        for side in (1.0, -1.0)
    ]
    handles = [_box(p_WO + R_WO @ place, R_WO, (bars[0], bars[1], bars[2]), _ARM) for place in places]
    for x, y, z in places:
        edge = math.copysign(length / 2.0, x)
        for end in (-0.5, 0.5):
            middle = np.array([(x + edge) / 2.0, y + end * (bars[1] - bars[2]), z])
            handles.append(_box(p_WO + R_WO @ middle, R_WO, (abs(x - edge), bars[2], bars[2]), _ARM))
    return [_box(p_WO, R_WO, (length, width, thick), _THING), *handles]


def draw_scene(moments: Mapping[str, Sequence[Solid]], caption: str, folder: Path) -> Figure:
    """Draw moments beside each other, by their titles, from the side and from above; the caption gives colours."""
    windows = _windows(moments)
    sides = windows[0][1] - windows[0][0]
    heights = [float(sides[view.axes[1]]) for view in _VIEWS]
    size = (3.6 * len(moments), 2.95 * sum(heights) / float(sides[0]) + 1.8)
    with figure(folder / "scene", 2, len(moments), size=size, heights=heights) as canvas:
        for column, (title, solids) in enumerate(moments.items()):
            for row, view in enumerate(_VIEWS):
                axes = canvas[row * len(moments) + column]
                _draw(axes, solids, view, *windows[column])
                axes.set_title(f"{title}\n{view.caption}" if row == 0 else view.caption)
    return Figure("scene", f"The scene in W, from the side (above) and from above (below). {caption}")


def _windows(moments: Mapping[str, Sequence[Solid]]) -> list[tuple[Floats, Floats]]:
    """Return minimum and maximum corner of what each moment's pictures show, of equal size for all.

    It is the same part of the cabin if that is not too large, else a part of it around what is there.
    """
    corners = [np.concatenate([s.corners for s in solids]) for solids in moments.values()]
    lows, highs = np.array([c.min(axis=0) for c in corners]), np.array([c.max(axis=0) for c in corners])
    if np.all(highs.max(axis=0) - lows.min(axis=0) < _MAX_SIDE):
        return [(lows.min(axis=0) - _MARGIN, highs.max(axis=0) + _MARGIN)] * len(corners)
    half = (highs - lows).max(axis=0) / 2 + _MARGIN
    return [((low + high) / 2 - half, (low + high) / 2 + half) for low, high in zip(lows, highs, strict=True)]


def draw_near(moments: Mapping[str, Sequence[Solid]], middles: Mapping[str, Floats], folder: Path) -> Figure:
    """Draw moments below each other, by their titles, from near: around a middle each, in W, m."""
    with figure(folder / "transfer", len(moments), 2, size=(8.0, 4.1 * len(moments))) as canvas:
        for row, (title, solids) in enumerate(moments.items()):
            for column, view in enumerate(_VIEWS):
                axes = canvas[2 * row + column]
                _draw(axes, solids, view, middles[title] - _NEAR, middles[title] + _NEAR)
                axes.set_title(f"{title}, {view.caption}")
    return Figure("transfer", "The gripper from near, at the moments between start and end of the scene.")


def finger_points(finger: Floats) -> list[Floats]:
    """Return joints and tip of thumb (2 joints) and of the four fingers (3 each) in H, bent towards the palm.

    Args:
        finger: angles of the joints, shape (14,), rad.
    """
    return [np.array(joint_places(f, finger[f.joints].tolist())) for f in FINGERS]


def _fingers(p_WH: Floats, R_WH: Floats, finger: Floats) -> list[Solid]:
    """Return the segments of thumb and fingers."""
    segments: list[Solid] = []
    for points, f in zip(finger_points(finger), FINGERS, strict=True):
        side = np.cross(f.ahead, f.bend)
        for start, end in pairwise(points):
            length = float(np.linalg.norm(end - start))
            ahead = (end - start) / length
            R_HF = np.column_stack([ahead, side, np.cross(ahead, side)])
            middle = p_WH + R_WH @ ((start + end) / 2)
            segments.append(_box(middle, R_WH @ R_HF, (length, FINGER_WIDTH, FINGER_WIDTH), _SKIN))
    return segments


def _box(p_WX: Floats, R_WX: Floats, sides: tuple[float, float, float], colour: str) -> Solid:
    return Solid(p_WX + (_CORNERS * np.array(sides)) @ np.transpose(R_WX), colour)


def _draw(axes: Axes, solids: Sequence[Solid], view: _View, low: Floats, high: Floats) -> None:
    """Draw the faces that are turned to the viewer, the farthest first, the darker the more oblique."""
    i, j = view.axes
    faces: list[tuple[Floats, Solid]] = [(np.take(s.corners, f, axis=0), s) for s in solids for f in _FACES]
    drawn: list[tuple[float, Floats, tuple[float, ...]]] = []
    for corners, solid in faces:
        outwards = corners.mean(axis=0) - solid.corners.mean(axis=0)
        facing = float(outwards @ view.to_eye) / float(np.linalg.norm(outwards))
        if facing > 1e-3:
            shade = 0.55 + 0.45 * facing
            colour = tuple(shade * c for c in to_rgb(solid.colour))
            drawn.append((float(corners.mean(axis=0) @ view.to_eye), corners[:, [i, j]], colour))
    drawn.sort(key=lambda face: face[0])
    polygons, colours = [corners for _, corners, _ in drawn], [colour for _, _, colour in drawn]
    axes.add_collection(PolyCollection(polygons, facecolors=colours, edgecolors="#3a4350", linewidths=0.5))
    axes.set(xlim=(low[i], high[i]), ylim=(low[j], high[j]), aspect="equal")
    axes.set(xlabel=f"{'xyz'[i]} (m)", ylabel=f"{'xyz'[j]} (m)")
