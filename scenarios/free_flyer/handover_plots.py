"""What the report draws of a handover in microgravity over time."""

from collections.abc import Sequence

import numpy as np

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.time_plot import Curve, Level, TimePlot
from handover.scenarios.free_flyer.handover_parameters import Parameters
from handover.scenarios.free_flyer.thrust_plots import plot_thrust

_PHASES = "decision.phase"
_TOUCHES = {"HAND": "a pull", "GRIPPER": "a push"}


def plot_handover(parameters: Parameters, record: Record, receivers: Sequence[str]) -> list[TimePlot]:
    """Return the gripper's place, speed and angle, who holds the object, and thrust."""
    published = paper_values("free_flyer", "published")
    return [
        _place(record),
        _speed(parameters, record, receivers),
        TimePlot(
            title="Angle of the gripper",
            quantity="angle",
            unit="°",
            phases=_PHASES,
            curves=(Curve(label="angle", values=np.degrees(record["person.gripper_angle"])),),
            levels=(Level(label="counts as full", value=float(np.degrees(published["angle_threshold"]))),),
        ),
        TimePlot(
            title="Forces, and who holds the object",
            quantity="force",
            unit="N",
            phases="person.holder",
            curves=(
                Curve(label="on the gripper", values=np.linalg.norm(record["person.f_G"], axis=1)),
                Curve(label="on the hand", values=np.linalg.norm(record["person.f_H"], axis=1)),
            ),
        ),
        *plot_thrust(record, ("impedance", "pose"), _PHASES),
    ]


def _place(record: Record) -> TimePlot:
    p_WG, p_WG_goal = 1000 * record["robot.p_WG"], 1000 * record["decision.p_WG_goal"]
    curves: list[Curve] = []
    for i, axis in enumerate("xyz"):
        curves.append(Curve(label=f"{axis}, gripper", values=p_WG[:, i], group=axis))
        curves.append(Curve(label=f"{axis}, its goal", values=p_WG_goal[:, i], held=True, faint=True, group=axis))
    return TimePlot(
        title="The gripper and its goal in W", quantity="position", unit="mm", curves=curves, phases=_PHASES
    )


def _speed(parameters: Parameters, record: Record, receivers: Sequence[str]) -> TimePlot:
    published = paper_values("free_flyer", "published")
    levels = [
        Level(
            label=f"counts as {_TOUCHES[receiver]}",
            value=published[f"velocity_{receiver.lower()}"][parameters.behaviour],
        )
        for receiver in dict.fromkeys(receivers)
    ]
    curves = (
        Curve(label="as the robot sees it", values=record["decision.speed_G"]),
        Curve(label="true", values=np.linalg.norm(record["robot.v_WG"], axis=1), faint=True),
    )
    return TimePlot(
        title="Speed of the gripper", quantity="speed", unit="m/s", curves=curves, levels=levels, phases=_PHASES
    )
