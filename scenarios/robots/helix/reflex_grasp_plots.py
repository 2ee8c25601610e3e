"""Figure of a grasp by infrared reflex: what the fingers read, and where the ball is in the gripper."""

import numpy as np

from handover.controllers.helix.reflex.grasp_reflex import Params as ReflexParams
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.time_plot import Curve, Level, TimeFigure, TimePlot, phases_of
from handover.scenarios.robots.helix.reflex_grasp_parameters import ReflexGraspParameters

_NEAR = 0.12
"""Distance of gripper and ball within which the ball's place in the gripper is drawn, m."""
_FINGERS = ("60°", "180°", "300°")


def figure_of_reflex(parameters: ReflexGraspParameters, record: Record) -> TimeFigure:
    """Return the readings of both sensors of each finger, and the ball beside and along the gripper's axis."""
    phases = phases_of(record, "servo.phase") if "servo.phase" in record else ()
    true, believed = _in_gripper(record), record["reflex.p_GO_est"]
    is_near = np.linalg.norm(true, axis=1) < _NEAR
    ways = (
        (
            "Ball beside the gripper's axis",
            np.linalg.norm(true[:, :2], axis=1),
            np.linalg.norm(believed[:, :2], axis=1),
        ),
        ("Ball along the gripper's axis", true[:, 2], believed[:, 2]),
    )
    places = [
        TimePlot(
            title=title,
            quantity="distance",
            unit="mm",
            phases=phases,
            curves=[
                Curve(label="true", values=np.where(is_near, 1e3 * of_true, np.nan)),
                Curve(
                    label="as the controller has it",
                    values=np.where(is_near, 1e3 * of_belief, np.nan),
                    held=True,
                    stroke="dashed",
                ),
            ],
            levels=() if k else (Level(label="near", value=1e3 * parameters.near),),
        )
        for k, (title, of_true, of_belief) in enumerate(ways)
    ]
    readings = [
        TimePlot(
            title=f"Sensors that look {way}",
            quantity="reading",
            unit="tick",
            phases=phases,
            curves=[
                Curve(label=f"finger at {at}", values=record["fingers.ticks"][:, 3 * k + i], held=True)
                for i, at in enumerate(_FINGERS)
            ],
            levels=(Level(label="sees", value=ReflexParams().ticks_min),),
        )
        for k, way in enumerate(("across", "ahead"))
    ]
    caption = "What the fingers' infrared sensors read, and where that and the cameras put the ball in the gripper."
    return TimeFigure(name="reflex", caption=caption, plots=[*places, *readings])


def _in_gripper(record: Record) -> Floats:
    """Return p_GO over time, shape (rows, 3), m."""
    p_GO_W = record["hand.p_WO"] - record["arm.p_WG"]
    return np.array([np.transpose(rotation_of(q)) @ p for q, p in zip(record["arm.q_WG"], p_GO_W, strict=True)])
