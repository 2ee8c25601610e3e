"""A grasp on the table in space: palm, phalanges, the object, and the beams of the sensors."""

import numpy as np

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.hand import FINGERS, PALM, finger_points, sensor_rays
from handover.plants.ir_grasp.objects import Thing, outlines, solid_of
from handover.scenarios.experiment.replay import Body, Line, Mesh, Replay, merged, prism
from handover.scenarios.robots.ir_grasp.parameters import Parameters
from handover.scenarios.robots.ir_grasp.plots import (
    FINGER_COLOURS,
    FINGER_NAMES,
    OTHER_COLOUR,
    PALM_COLOUR,
    THING_COLOUR,
    phases_of_grasp,
)

_BEAM = "#8357a8"
_HEIGHT, _PALM_LOW, _PALM_HIGH, _THING_HIGH = 0.025, 0.012, 0.038, 0.055
"""Heights above the table of fingers' axes, palm's faces and object, m: the scene is planar, so these are assumed."""


def replay_grasp(parameters: Parameters, record: Record) -> Replay:
    """Return hand, object and beams over a run's time."""
    parts = [prism(outline, 0.0, _THING_HIGH) for outline in outlines(parameters.solid)]
    fingers, beams = _fingers_and_beams(record)
    return Replay(
        bodies=[
            _turning("palm", PALM_COLOUR, prism(np.array(PALM), _PALM_LOW, _PALM_HIGH), record, "p_WH", "yaw"),
            _turning("object", THING_COLOUR, merged(parts), record, "p_WO", "yaw_O"),
            *_other(parameters, record),
        ],
        lines=[*fingers, *beams],
        eye=(-0.35, -0.7, 1.35),
        phases=phases_of_grasp(record),
        floor=0.0,
        follow="palm",
        notes=("The scene is planar; heights above the table are for display only. Beams end at what they meet.",),
    )


def _other(parameters: Parameters, record: Record) -> list[Body]:
    if parameters.other_radius == 0.0 or "scene.p_WX" not in record:
        return []
    disc = solid_of(Thing.DISC, disc_radius=parameters.other_radius)
    mesh = prism(outlines(disc)[0], 0.0, _THING_HIGH)
    p = record["scene.p_WX"]
    p_WB, q_WB = np.column_stack([p, np.zeros(len(p))]), np.tile([1.0, 0.0, 0.0, 0.0], (len(p), 1))
    return [Body(label="second object", colour=OTHER_COLOUR, mesh=mesh, p_WB=p_WB, q_WB=q_WB)]


def _turning(label: str, colour: str, mesh: Mesh, record: Record, place: str, yaw: str) -> Body:
    p, half = record[f"scene.{place}"], record[f"scene.{yaw}"] / 2.0
    zero = np.zeros(len(p))
    return Body(
        label=label,
        colour=colour,
        mesh=mesh,
        p_WB=np.column_stack([p, zero]),
        q_WB=np.column_stack([np.cos(half), zero, zero, np.sin(half)]),
    )


def _fingers_and_beams(record: Record) -> tuple[list[Line], list[Line]]:
    """Return the fingers, and the beams up to what they meet or to the end of their range."""
    p_WH, yaw, q = record["scene.p_WH"], record["scene.yaw"], record["scene.q"]
    hands = [finger_points(p_WH[k], float(yaw[k]), q[k]) for k in range(len(yaw))]
    rays = [sensor_rays(p_WH[k], float(yaw[k]), q[k]) for k in range(len(yaw))]
    origins, directions = (np.array(values) for values in zip(*rays, strict=True))
    reach = np.minimum(record["scene.range"], ReflexParams().distance_max)[:, :, None]
    beams = np.stack([origins, origins + reach * directions], axis=2)  # (rows, fingers, 2, 2)
    fingers: list[Line] = []
    for i, finger in enumerate(FINGERS):
        points = np.array([hand[i] for hand in hands])
        radii = np.array([*finger.radii, finger.radii[-1]])
        fingers.append(Line(label=FINGER_NAMES[i], colour=FINGER_COLOURS[i], points=_raised(points), radii=radii))
    lines = [Line(label="beams", colour=_BEAM, points=_raised(beams[:, i]), width=3.0) for i in range(len(FINGERS))]
    return fingers, lines


def _raised(points: Floats) -> Floats:
    """Return points on the table, shape (rows, n, 2), at the fingers' height."""
    return np.concatenate([points, np.full((*points.shape[:2], 1), _HEIGHT)], axis=2)
