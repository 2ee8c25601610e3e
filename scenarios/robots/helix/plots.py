"""Figures of a Helix handover: distance, positions, tendons and gripper over time, and camera pictures."""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.helix.hand.bowl import Bowl
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.experiment.plotting import figure
from handover.scenarios.experiment.time_plot import (
    Curve,
    Level,
    Phase,
    Stroke,
    TimeFigure,
    TimePlot,
    phases_of,
)
from handover.scenarios.robots.helix.marked_pictures import LEGEND
from handover.scenarios.robots.helix.parameters import Parameters

_FOLLOWED = (("gripper", "arm.p_WG", "servo.p_WG_est"), ("ball", "hand.p_WO", "servo.p_WO_est"))
"""Name, signal of the true position, and signal of the controller's estimate."""
_PALETTE = ("gripper", "goal", "ball")
_STROKES: tuple[Stroke, ...] = ("solid", "dashed", "dotted")
"""Strokes of a segment's three tendons."""


def figures_of_handover(parameters: Parameters, record: Record) -> list[TimeFigure]:
    """Return the figures of the distance to the goal, of true and estimated positions, of tendons, and of the grasp."""
    phases = phases_of(record, "servo.phase") if "servo.phase" in record else ()
    change, title = 1000 * record["servo.dl_t"], "Commanded tendon lengths, since calibration"
    tendons = [_tendons(title, "change", "mm", change, phases, held=True)]
    if "arm.tension" in record:
        tendons.append(_tendons("Tendon forces", "tension", "N", record["arm.tension"], phases, held=False))
    hand = [_hand_force(parameters, record, phases)] if "hand.f_H" in record else []
    return [
        TimeFigure(
            name="error",
            caption="Distance to the goal over time, with the thresholds for the descent and for the grasp.",
            plots=[_distance(parameters, record, phases)],
        ),
        TimeFigure(
            name="paths",
            caption="Positions of gripper and ball in the world, true and as estimated from the pictures.",
            plots=[_position(record, axis, phases) for axis in range(3)],
        ),
        TimeFigure(
            name="tendons",
            caption="Commanded tendon lengths, from calibration, and tendon forces. A slack tendon is at 0 N.",
            plots=tendons,
        ),
        TimeFigure(
            name="grasp",
            caption="How far the gripper is closed, and with what ball and fingers press on the hand.",
            plots=[_gripper(record, phases), *hand],
        ),
    ]


def figure_of_delivery(bowl: Bowl, record: Record) -> TimeFigure:
    """Return the figure of where the ball is over the bowl: how far beside its middle, and how high over its rim."""
    phases = phases_of(record, "servo.phase") if "servo.phase" in record else ()
    over = 1000 * (record["hand.p_WO"] - bowl.p_WD)
    gripper = 1000 * (record["arm.p_WG"] - bowl.p_WD)
    ways = (
        ("beside", "Ball beside the bowl's middle", np.linalg.norm(over[:, :2], axis=1), "rim", 1000 * bowl.radius),
        ("over", "Ball over the bowl's rim", over[:, 2], "rim", 0.0),
    )
    of_gripper = (np.linalg.norm(gripper[:, :2], axis=1), gripper[:, 2])
    plots = [
        TimePlot(
            title=title,
            quantity="distance" if name == "beside" else "height",
            unit="mm",
            phases=phases,
            curves=[
                Curve(label="ball", values=values, group="ball"),
                Curve(label="gripper", values=of_it, stroke="dashed", group="gripper"),
            ],
            levels=(Level(label=label, value=level),),
            palette=_PALETTE,
        )
        for (name, title, values, label, level), of_it in zip(ways, of_gripper, strict=True)
    ]
    caption = (
        "Where ball and gripper are over the bowl: in the plane of its rim, from its middle, and above that plane."
    )
    return TimeFigure(name="delivery", caption=caption, plots=plots)


def _known(record: Record, values: Floats) -> Floats:
    """Return values of the controller, NaN before it has seen ball and arm, when they are meaningless.

    Those of a controller without phases are all kept.
    """
    return np.where(record["servo.phase"] > 0, values, np.nan) if "servo.phase" in record else values


def _distance(parameters: Parameters, record: Record, phases: Sequence[Phase]) -> TimePlot:
    curves: list[Curve] = []
    if "servo.error" in record:
        seen = _known(record, 1000 * record["servo.error"])
        curves.append(Curve(label="gripper to its goal, as the controller sees it", values=seen, held=True))
    true = 1000 * np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"], axis=1)
    curves.append(Curve(label="gripper to ball, true", values=true))
    return TimePlot(
        title="Distance to the goal",
        quantity="distance",
        unit="mm",
        phases=phases,
        limits=(0.0, None),
        curves=curves,
        levels=_thresholds(parameters) if curves[1:] and "servo.phase" in record else (),
    )


def _thresholds(parameters: Parameters) -> tuple[Level, ...]:
    """Return the errors at which the scenario's own controller, which has phases, descends and grasps, mm."""
    return (
        Level(label="descends", value=1000 * parameters.threshold),
        Level(label="grasps", value=1000 * parameters.settings["threshold_grasp"]),
    )


def _position(record: Record, axis: int, phases: Sequence[Phase]) -> TimePlot:
    curves: list[Curve] = []
    for what, true, estimated in _FOLLOWED:
        curves.append(Curve(label=f"{what}, true", values=1000 * record[true][:, axis], group=what))
        if estimated in record:
            values = _known(record, 1000 * record[estimated][:, axis])
            curves.append(Curve(label=f"{what}, estimated", values=values, held=True, stroke="dashed", group=what))
    name = "xyz"[axis]
    return TimePlot(
        title=f"Gripper and ball along {name} of W",
        quantity=f"{name} in W",
        unit="mm",
        curves=curves,
        phases=phases,
        palette=_PALETTE,
    )


def _tendons(title: str, quantity: str, unit: str, values: Floats, phases: Sequence[Phase], *, held: bool) -> TimePlot:
    """Return a plot of three tendons in each of three segments, from the base; a segment has one colour."""
    curves = [
        Curve(
            label=f"segment {k // 3 + 1}, {120 * (k % 3)}°",
            values=values[:, k],
            held=held,
            stroke=_STROKES[k % 3],
            group=f"segment {k // 3 + 1}",
        )
        for k in range(values.shape[1])
    ]
    return TimePlot(title=title, quantity=quantity, unit=unit, curves=curves, phases=phases)


def _gripper(record: Record, phases: Sequence[Phase]) -> TimePlot:
    curves = [Curve(label="as it is", values=record["arm.grip"])]
    if "servo.closure" in record:
        curves.append(Curve(label="commanded", values=record["servo.closure"], held=True, stroke="dashed"))
    return TimePlot(
        title="Gripper",
        quantity="closure, 0 to 1",
        unit="",
        phases=phases,
        curves=curves,
    )


def _hand_force(parameters: Parameters, record: Record, phases: Sequence[Phase]) -> TimePlot:
    most = parameters.hand_force_max
    force = np.linalg.norm(record["hand.f_H"], axis=1)
    return TimePlot(
        title="Force on the hand",
        quantity="force",
        unit="N",
        phases=phases,
        limits=(0.0, None),
        curves=[Curve(label="of ball and fingers", values=force)],
        levels=(Level(label="what the person tolerates", value=most),) if force.max() > 0.5 * most else (),
    )


_COLUMNS, _ROWS, _ROWS_FROM_ABOVE = (240, 1040), (620, 150), (490, 20)
"""The part of the pictures that is shown, px; those of a camera above show farther off, which is up in them."""


def draw_pictures(pictures: Sequence[CameraPicture], above: Collection[str], folder: Path) -> Figure:
    """Draw the cameras' pictures, some from above, into a folder: a camera a row, the moments side by side."""
    moments, cameras = list(dict.fromkeys(p.t for p in pictures)), list(dict.fromkeys(p.camera for p in pictures))
    n = len(moments)
    with figure(folder / "pictures", len(cameras), n, size=(3.2 * n, 1.95 * len(cameras))) as axes:
        for p in pictures:
            i = moments.index(p.t)
            _show(axes[i + n * cameras.index(p.camera)], p, _ROWS_FROM_ABOVE if p.camera in above else _ROWS)
            axes[i].set_title(f"{p.t:.1f} s, {p.role}")
    caption = f"Cameras, from the upper row to the lower: {', '.join(cameras)}. Marks: {LEGEND}."
    return Figure("pictures", caption)


def _show(axis: Axes, picture: CameraPicture, rows: tuple[int, int]) -> None:
    axis.imshow(picture.pixels[:, :, ::-1])
    axis.set_axis_off()
    axis.set(xlim=_COLUMNS, ylim=rows)
    for mark in picture.marks:
        style: dict[str, Any] = {"color": mark.colour, "lw": 1.2, "ls": "--" if "dashed" in mark.shape else "-"}
        if "circle" in mark.shape:
            axis.add_patch(Circle((mark.u, mark.v), mark.radius, fill=False, **style))
        else:
            axis.plot(mark.u, mark.v, {"cross": "x", "plus": "+"}[mark.shape], ms=8, color=mark.colour, mew=1.4)
