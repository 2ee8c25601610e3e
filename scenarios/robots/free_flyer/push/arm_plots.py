"""Curves over time, and the replay, of a push on a free-flyer whose arm moves."""

import numpy as np
from scipy.spatial.transform import Rotation

from handover.controllers.free_flyer.arm_impedance_controller import Params as ControllerParams
from handover.controllers.free_flyer.arm_model import Chain
from handover.cosim.blocks.geometry import quaternion_of, rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.replay import Body, Line, Mesh, Replay, faceted, hull, rod
from handover.scenarios.experiment.time_plot import Curve, Phase, TimeFigure, TimePlot
from handover.scenarios.robots.free_flyer.push.arm_evaluation import columns_of, errors_with_arm
from handover.scenarios.robots.free_flyer.push.arm_parameters import ArmPushParameters
from handover.scenarios.robots.free_flyer.push.push_plots import (
    CAPTION,
    CAPTION_OF_PUSH,
    errors_over_time,
    phases_of_push,
    plot_thrust,
    pushes_over_time,
)
from handover.scenarios.robots.free_flyer.replay import frame_at, hand_pushes, push_arrows
from handover.scenarios.robots.free_flyer.scene import EDGE

_CUBE, _LINKS, _GRIPPER, _PATH = "#c9d3df", ("#8793a3", "#6b7686", "#8793a3"), "#2f6db5", "#b58a1b"
_RADIUS, _JAWS = 0.02, np.array([0.06, 0.05, 0.03])
"""Radius of a link, and sides of the gripper, m."""


def figures_of_arm_push(parameters: ArmPushParameters, record: Record) -> list[TimeFigure]:
    """Return the figures of errors, of base and joints, and of push and thrust; none of a single instant."""
    if len(record.time) < 2:
        return []
    errors, phases = errors_with_arm(columns_of(record), parameters.target()), phases_of_push(parameters, record)
    turned, turned_model = (np.degrees(values) for values in errors.without_jumps)
    return [
        TimeFigure(
            name="errors",
            caption="Error of the gripper's pose, rest minus actual, and by [Fernandes2020] eq. (4.4) with joints.",
            plots=[
                *errors_over_time("position", "mm", 1000 * errors.p, 1000 * errors.p_model, phases),
                *errors_over_time("orientation", "°", turned, turned_model, phases),
            ],
            columns=2,
        ),
        TimeFigure(
            name="yielding",
            caption="Who gives way: the base's displacement and turn, the joints' angles, and their torques.",
            plots=_yielding(parameters, record, phases),
            columns=2,
        ),
        TimeFigure(name="thrust", caption=CAPTION, plots=plot_thrust(record, ("impedance",), phases), columns=2),
        TimeFigure(name="push", caption=CAPTION_OF_PUSH, plots=pushes_over_time(parameters, record, phases)),
    ]


def _yielding(parameters: ArmPushParameters, record: Record, phases: list[Phase]) -> list[TimePlot]:
    moved = 1000 * (record["robot.p_WB"] - record["robot.p_WB"][0])
    turned = np.degrees(Rotation.from_quat(record["robot.q_WB"], scalar_first=True).as_rotvec())
    angles, torques = np.degrees(record["robot.q_J"]), record["impedance.tau_J_cmd"]
    joints = tuple(f"joint {j + 1}" for j in range(parameters.joints))
    return [
        _plot("Displacement of the base in W", "displacement", "mm", moved, ("x", "y", "z"), phases),
        _plot("Turn of the base in W", "turn", "°", turned, ("x", "y", "z"), phases),
        _plot("Angles of the joints", "angle", "°", angles, joints, phases),
        _plot("Commanded torques on the joints", "torque", "N·m", torques, joints, phases),
    ]


def _plot(
    title: str, quantity: str, unit: str, values: Floats, labels: tuple[str, ...], phases: list[Phase]
) -> TimePlot:
    curves = [Curve(label=label, values=values[:, i]) for i, label in enumerate(labels)]
    return TimePlot(title=title, quantity=quantity, unit=unit, curves=curves, phases=phases)


def replay_arm_push(parameters: ArmPushParameters, record: Record) -> Replay:
    """Return base, links and gripper, the gripper's place of rest, and what pushes it."""
    path = Line(label="path of the gripper", colour=_PATH, points=record["robot.p_WG"][:, None], trail=True)
    return Replay(
        weightless=True,
        follow="gripper",
        bodies=_robot(parameters, record),
        lines=[path, *push_arrows(parameters.kind, record), *hand_pushes(record)],
        fixed=frame_at("place of rest", parameters.target().p_WG),
        eye=(-1.0, -1.15, 0.6),
        phases=phases_of_push(parameters, record),
    )


def _robot(parameters: ArmPushParameters, record: Record) -> list[Body]:
    """Return cube, links and gripper; the links by the recorded angles."""
    params = ControllerParams(**vars(parameters.robot), **parameters.arm(parameters.arm_factor))
    model, n = params.model(), parameters.joints
    p_WB, q_WB = record["robot.p_WB"], record["robot.q_WB"]
    rows = range(len(record.time))
    chains = [
        Chain(model, rotation_of(q), np.zeros(3), angles[:n])
        for q, angles in zip(q_WB, record["robot.q_J"], strict=True)
    ]
    bodies = [Body(label="robot", colour=_CUBE, mesh=_box(np.full(3, EDGE)), p_WB=p_WB, q_WB=q_WB)]
    for j in range(n):
        p_WL = np.array([p_WB[k] + chains[k].origins[j] for k in rows])
        q_WL = np.array([quaternion_of(chains[k].R[j + 1]) for k in rows])
        mesh = rod(np.array([np.zeros(3), model.links[j]]), np.full(2, _RADIUS))
        bodies.append(Body(label=f"link {j + 1}", colour=_LINKS[j], mesh=mesh, p_WB=p_WL, q_WB=q_WL))
    p_WG, q_WG = record["robot.p_WG"], record["robot.q_WG"]
    return [*bodies, Body(label="gripper", colour=_GRIPPER, mesh=_box(_JAWS), p_WB=p_WG, q_WB=q_WG)]


def _box(sides: Floats) -> Mesh:
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return faceted(hull(corners * sides))
