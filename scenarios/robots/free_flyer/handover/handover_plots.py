"""Curves over time of the free-flyer's handovers, as in [Fernandes2020] figs. 4.29-4.38.

Positions, orientations, the gripper and who holds the object, and thrust.
"""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.time_plot import Curve, Level, Phase, Stroke, TimeFigure, TimePlot, phases_of
from handover.scenarios.robots.free_flyer.parameters import HandoverParameters
from handover.scenarios.robots.free_flyer.push.push_plots import CAPTION, plot_thrust

_FOLLOWED: tuple[tuple[str, str, Stroke], ...] = (
    ("gripper", "robot.{}_WG", "solid"),
    ("hand", "person.{}_WH", "solid"),
    ("object", "person.{}_WO", "dashed"),
)
"""The object goes with the gripper or the hand."""
_PALETTE = ("gripper", "object", "hand")
_WATCHING = ("signal", "check velocity")
"""Phases in which the threshold of the gripper's speed counts."""


def figures_of_handover(parameters: HandoverParameters, record: Record) -> list[TimeFigure]:
    """Return paths of gripper, hand and object, the gripper with who holds the object, and thrust."""
    phases = phases_of(record, "decision.phase")
    return [
        TimeFigure(
            name="positions",
            caption="Positions of gripper, hand and object in W, and where the gripper is to be; shaded by the robot's "
            "phases.",
            plots=_positions(record, phases),
        ),
        TimeFigure(
            name="orientations",
            caption="Orientations of gripper, hand and object in W; shaded by the robot's phases.",
            plots=_orientations(record, phases),
        ),
        TimeFigure(
            name="gripper",
            caption="Angle of the gripper with the threshold above which it counts as full; its speed, with the one "
            "at which the robot would act. Forces on gripper and hand are shaded by who holds the object.",
            plots=[_angle(record, phases), _speed(parameters, record, phases), _forces(record)],
        ),
        TimeFigure(name="thrust", caption=CAPTION, plots=plot_thrust(record, ("impedance", "pose"), phases), columns=2),
    ]


def _positions(record: Record, phases: Sequence[Phase]) -> list[TimePlot]:
    goal = 1000 * record["decision.p_WG_goal"]
    followed = {name: 1000 * record[signal.format("p")] for name, signal, _ in _FOLLOWED}
    return [
        TimePlot(
            title=f"Gripper, hand and object along {axis} of W",
            quantity=f"{axis} in W",
            unit="mm",
            curves=[
                *_curves(followed, i),
                Curve(label="gripper's goal", values=goal[:, i], held=True, stroke="dotted", group="gripper"),
            ],
            phases=phases,
            palette=_PALETTE,
        )
        for i, axis in enumerate("xyz")
    ]


def _orientations(record: Record, phases: Sequence[Phase]) -> list[TimePlot]:
    followed = {name: roll_pitch_yaw(record[signal.format("q")]) for name, signal, _ in _FOLLOWED}
    return [
        TimePlot(
            title=f"{angle.capitalize()} of gripper, hand and object in W",
            quantity=angle,
            unit="°",
            curves=_curves(followed, i),
            phases=phases,
            palette=_PALETTE,
        )
        for i, angle in enumerate(("roll", "pitch", "yaw"))
    ]


def _curves(followed: dict[str, Floats], i: int) -> list[Curve]:
    return [Curve(label=name, values=followed[name][:, i], stroke=stroke) for name, _, stroke in _FOLLOWED]


def roll_pitch_yaw(q: Floats) -> Floats:
    """Return roll, pitch and yaw, °, without jumps by a whole turn."""
    yaw_pitch_roll = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX")
    return np.degrees(np.unwrap(yaw_pitch_roll[:, ::-1], axis=0))


def _angle(record: Record, phases: Sequence[Phase]) -> TimePlot:
    threshold = float(np.degrees(paper_values("free_flyer", "published")["angle_threshold"]))
    return TimePlot(
        title="Angle of the gripper",
        quantity="angle",
        unit="°",
        phases=phases,
        curves=(Curve(label="angle", values=np.degrees(record["person.gripper_angle"])),),
        levels=(Level(label="counts as full", value=threshold),),
        limits=(0.0, None),
    )


def _speed(parameters: HandoverParameters, record: Record, phases: Sequence[Phase]) -> TimePlot:
    return TimePlot(
        title="Speed of the gripper",
        quantity="speed",
        unit="m/s",
        phases=phases,
        curves=(
            Curve(label="as the robot sees it", values=record["decision.speed_G"]),
            Curve(label="true", values=np.linalg.norm(record["robot.v_WG"], axis=1), stroke="dotted"),
            Curve(
                label="at which the robot acts, while it counts",
                values=_threshold(parameters, record, phases),
                held=True,
                stroke="dashed",
            ),
        ),
        limits=(0.0, None),
    )


def _threshold(parameters: HandoverParameters, record: Record, phases: Sequence[Phase]) -> Floats:
    """Return the speed, m/s, that the robot takes for a pull or a push, NaN while it does not wait for it.

    It waits for a pull while it has the object, for a push else; who has it as the robot gives its signal decides.
    """
    pull, push = parameters.threshold("HAND"), parameters.threshold("GRIPPER")
    holder, items = record["person.holder"].tolist(), record.items("person.holder")
    values = np.full(len(record.time), np.nan)
    speed = np.nan
    for phase in phases:
        first, last = np.searchsorted(record.time, (phase.begin, phase.end)).tolist()
        if phase.name == _WATCHING[0]:
            speed = pull if items[holder[first]] == "GRIPPER" else push
        if phase.name in _WATCHING:
            values[first : last + 1] = speed
    return values


def _forces(record: Record) -> TimePlot:
    return TimePlot(
        title="Forces, and who holds the object",
        quantity="force",
        unit="N",
        phases=phases_of(record, "person.holder"),
        curves=(
            Curve(label="on the gripper", values=np.linalg.norm(record["person.f_G"], axis=1)),
            Curve(label="on the hand", values=np.linalg.norm(record["person.f_H"], axis=1), stroke="dashed"),
        ),
    )
