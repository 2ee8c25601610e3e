"""A run along a path in space: the arm's links, its load, the path it is to follow, and its tip path."""

from collections.abc import Sequence

import numpy as np

from handover.controllers.vsl.waypoints import InvalidWaypoints
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.vsl.parameters import Params as ArmParams
from handover.scenarios.experiment.replay import Body, Line, Replay, ball, circle, prism
from handover.scenarios.robots.vsl.parameters import Parameters
from handover.scenarios.robots.vsl.plots import phases_of_path

_LINK, _SERVO, _GROUND, _LOAD = "#8fb3d9", "#4d5866", "#9aa3af", "#b58a1b"
_DESIRED, _TIP_PATH, _ESTIMATE = "#3c8d53", "#d1602b", "#8357a8"
_ELBOW = 13
"""Of the centre line's points, the one where link 2 ends and link 3 begins; the shoulder is 1."""
_RADIUS_RATIO = 1.2
"""Radius of servos, base and gripper over that of the links (assumed)."""
_REACH = ArmParams().L_2 + ArmParams().L_3
"""How far the arm can be from its base along the ground, m."""
_PLATE, _GROUND_AT = 0.006, -0.06
"""Thickness of the plate below the arm, and height of its face in W, clear of the load, m (assumed).

The floor is below the plate, for two faces at one height flicker.
"""
_DENSITY, _BELOW = 2700.0, 0.03
"""Density of the ball that the load is drawn as, kg/m3, and how far below the gripper it hangs, m (assumed)."""


def replay_path(parameters: Parameters, record: Record, *, hybrid: bool) -> Replay:
    """Return the arm over a run's time; if `hybrid`, with the model's estimate of the tip."""
    shape = record["arm.shape"]
    hanging = parameters.load_at(record.time)
    return Replay(
        bodies=[_ground(), *arm_bodies(shape), *_load(parameters.masses, hanging, shape)],
        lines=[*arm_lines(shape), *_hook(parameters.masses, hanging, shape), *_tips(record, hybrid)],
        fixed=_desired_path(parameters),
        eye=(0.45, -1.45, 0.35),
        phases=phases_of_path(record),
        floor=_GROUND_AT - _PLATE,
        follow="gripper",
        notes=("The path of the tip is the true one, not that by the tracker.",),
    )


def _desired_path(parameters: Parameters) -> list[Line]:
    """Return the path; none if its file of waypoints is there no longer."""
    p = parameters
    parts: list[Floats] = []
    try:
        segments = p.segments()
    except InvalidWaypoints:
        return []
    for segment in segments:
        points, _ = segment.sampled(p.points, p.speed)
        parts += [segment.x_0[None], points]
    return [Line(label="desired path", colour=_DESIRED, points=np.vstack(parts)[None], width=4.0)]


def arm_lines(shape: Floats) -> list[Line]:
    """Return the links from shoulder to elbow and from elbow to gripper, and the gripper."""
    radius: float = ArmParams().R_link
    parts = (("arm", _LINK, shape[:, 1 : _ELBOW + 1], radius), ("arm", _LINK, shape[:, _ELBOW:], radius))
    gripper = ("gripper", _SERVO, shape[:, -2:], _RADIUS_RATIO * radius)
    return [
        Line(label=label, colour=colour, points=points, radii=np.full(len(points[0]), r))
        for label, colour, points, r in (*parts, gripper)
    ]


def arm_bodies(shape: Floats) -> list[Body]:
    """Return the base, and the servos at shoulder and elbow."""
    radius = _RADIUS_RATIO * ArmParams().R_link
    outline = circle(radius)
    base = prism(outline, _GROUND_AT, float(shape[0, 1, 2] - shape[0, 0, 2]))
    servos = [Body(label="arm", colour=_SERVO, mesh=ball(radius), p_WB=shape[:, k]) for k in (1, _ELBOW)]
    return [Body(label="arm", colour=_SERVO, mesh=base, p_WB=shape[:1, 0]), *servos]


def _load(masses: Sequence[float], hanging: Floats, shape: Floats) -> list[Body]:
    """Return a ball for each mass, shown while it is the one that hangs at the gripper."""
    below = shape[:, -1] - [0.0, 0.0, _BELOW]
    return [
        Body(
            label="load",
            colour=_LOAD,
            mesh=ball((3.0 * mass / (4.0 * np.pi * _DENSITY)) ** (1.0 / 3.0)),
            p_WB=np.where((hanging == mass)[:, None], below, np.nan),
        )
        for mass in masses
    ]


def _hook(masses: Sequence[float], hanging: Floats, shape: Floats) -> list[Line]:
    if not masses:
        return []
    points = np.stack([shape[:, -1], shape[:, -1] - [0.0, 0.0, _BELOW]], axis=1)
    points[hanging <= 0.0] = np.nan
    return [Line(label="load", colour=_LOAD, points=points, width=3.0)]


def _tips(record: Record, hybrid: bool) -> list[Line]:
    tip_path = Line(
        label="path of the tip", colour=_TIP_PATH, points=record["arm.p_WG"][:, None], width=4.0, trail=True
    )
    if not hybrid:
        return [tip_path]
    estimate = record["kinematics.p_WG_est"][:, None]
    return [tip_path, Line(label="tip, by the hybrid model", colour=_ESTIMATE, points=estimate, width=6.0)]


def _ground() -> Body:
    """Return a plate below the arm."""
    reach, side = 0.06 + _REACH, 0.15
    outline = np.array([[-0.1, -side], [reach, -side], [reach, side], [-0.1, side]])
    plate = prism(outline, _GROUND_AT - _PLATE, _GROUND_AT)
    return Body(label="ground", colour=_GROUND, mesh=plate, p_WB=np.zeros((1, 3)), opacity=0.5)
