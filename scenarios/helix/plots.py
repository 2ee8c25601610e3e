"""What the report draws of a Helix handover over time.

Figures of a Helix handover: error and phases, paths, tendons, and the camera pictures of some moments.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.pictures import CameraPicture
from handover.scenarios.experiment.plotting import COLOURS, figure, shade_phases
from handover.scenarios.experiment.time_plot import Curve, Level, TimePlot
from handover.scenarios.helix.parameters import Parameters

_PHASES = "servo.phase"
_FOLLOWED = (("gripper", "arm.p_WG", "servo.p_WG_est"), ("ball", "hand.p_WO", "servo.p_WO_est"))
"""What is followed, where it is in truth, and where the controller has it."""


def plot_handover(parameters: Parameters, record: Record) -> list[TimePlot]:
    """Return distance to the goal, positions true and estimated, tendons, and the gripper."""
    return [
        _distance(parameters, record),
        *(_position(record, axis) for axis in range(3)),
        _tendons("Commanded tendon lengths, since calibration", "change", "mm", 1000 * record["servo.dl_t"], held=True),
        _tendons("Tendon forces", "force", "N", record["arm.tension"], held=False),
        TimePlot(
            title="Gripper",
            quantity="closure, from 0 to 1",
            unit="",
            phases=_PHASES,
            curves=(
                Curve(label="commanded", values=record["servo.closure"], held=True),
                Curve(label="as it is", values=record["arm.grip"]),
            ),
        ),
    ]


def gripper_to_ball(record: Record) -> Floats:
    """Return the true distance between gripper and ball over time, m."""
    return np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"], axis=1)


def known(record: Record, values: Floats) -> Floats:
    """Return what the controller holds, not a number before it has seen ball and arm, when it means nothing."""
    return np.where(record[_PHASES] > 0, values, np.nan)


def tendon_name(k: int) -> str:
    """Return what the k-th tendon is called, from 0."""
    return f"segment {k // 3 + 1}, {120 * (k % 3)}°"


def _distance(parameters: Parameters, record: Record) -> TimePlot:
    return TimePlot(
        title="Distance to the goal",
        quantity="distance",
        unit="mm",
        phases=_PHASES,
        curves=(
            Curve(
                label="gripper to its goal, as the controller sees it",
                values=known(record, 1000 * record["servo.error"]),
                held=True,
            ),
            Curve(label="gripper to ball, true", values=1000 * gripper_to_ball(record), faint=True),
        ),
        levels=(
            Level(label="descends", value=1000 * parameters.threshold),
            Level(label="grasps", value=1000 * parameters.settings["threshold_grasp"]),
        ),
    )


def _position(record: Record, axis: int) -> TimePlot:
    curves: list[Curve] = []
    for what, true, estimated in _FOLLOWED:
        values = known(record, 1000 * record[estimated][:, axis])
        curves.append(Curve(label=f"{what}, estimated", values=values, held=True, group=what))
        curves.append(Curve(label=f"{what}, true", values=1000 * record[true][:, axis], faint=True, group=what))
    name = "xyz"[axis]
    return TimePlot(
        title=f"Gripper and ball along {name} of W",
        quantity=name,
        unit="mm",
        curves=curves,
        phases=_PHASES,
    )


def _tendons(title: str, quantity: str, unit: str, values: Floats, *, held: bool) -> TimePlot:
    curves = [Curve(label=tendon_name(k), values=values[:, k], held=held) for k in range(values.shape[1])]
    return TimePlot(title=title, quantity=quantity, unit=unit, curves=curves, phases=_PHASES)


_SHOWN_COLUMNS, _SHOWN_ROWS = (240, 1040), (620, 150)


def draw_handover(
    parameters: Parameters, pictures: Sequence[CameraPicture], record: Record, folder: Path
) -> list[Figure]:
    """Draw all figures of a run into a folder; return them in the order of a report."""
    made = [_pictures(pictures, folder)] if pictures else []
    return [*made, _error(parameters, record, folder), _paths(record, folder), _draw_tendons(record, folder)]


def _error(parameters: Parameters, record: Record, folder: Path) -> Figure:
    t = record.time
    true = gripper_to_ball(record)
    with figure(folder / "error", 1, size=(8.0, 3.6)) as (axes,):
        shade_phases(axes, t, record["servo.phase"], record.items("servo.phase"))
        seen = record["servo.phase"] > 0
        axes.plot(
            t[seen],
            record["servo.error"][seen] * 1000,
            color=COLOURS[0],
            label="to the goal, as the controller sees it",
        )
        axes.plot(t, true * 1000, color=COLOURS[1], label="gripper to ball, ground truth")
        axes.axhline(parameters.threshold * 1000, color="#4d5866", lw=0.8, ls="--")
        axes.axhline(parameters.settings["threshold_grasp"] * 1000, color="#4d5866", lw=0.8, ls=":")
        axes.set(xlabel="time (s)", ylabel="distance (mm)", ylim=(0, None), xlim=(t[0], t[-1]))
        axes.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.2))
    return Figure("error", "Distance to the goal over time. Dashed: threshold for the descent; dotted: for the grasp.")


def _paths(record: Record, folder: Path) -> Figure:
    with figure(folder / "paths", 3, size=(8.0, 6.0)) as axes:
        for i, (axis, name) in enumerate(zip(axes, "xyz", strict=True)):
            known = record["servo.phase"] > 0
            axis.plot(record.time, record["arm.p_WG"][:, i] * 1000, color=COLOURS[0], label="gripper")
            axis.plot(record.time, record["hand.p_WO"][:, i] * 1000, color=COLOURS[2], label="ball")
            estimates = (
                ("servo.p_WG_est", COLOURS[0], "gripper, estimated"),
                ("servo.p_WO_est", COLOURS[2], "ball, estimated"),
            )
            for signal, colour, label in estimates:
                values = record[signal][:, i] * 1000
                axis.plot(record.time[known], values[known], color=colour, ls="--", lw=1, label=label)
            axis.set(ylabel=f"{name} in W (mm)", xlim=(record.time[0], record.time[-1]))
        axes[-1].set(xlabel="time (s)")
        axes[0].legend(ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return Figure("paths", "Positions of gripper and ball in the world, true and as estimated from the pictures.")


def _draw_tendons(record: Record, folder: Path) -> Figure:
    with figure(folder / "tendons", 2, size=(8.0, 5.0)) as (lengths, tensions):
        for k in range(9):
            style: dict[str, Any] = {"color": COLOURS[k // 3], "ls": ("-", "--", ":")[k % 3], "lw": 1.2}
            label = tendon_name(k)
            lengths.plot(record.time, record["servo.dl_t"][:, k] * 1000, drawstyle="steps-post", label=label, **style)
            tensions.plot(record.time, record["arm.tension"][:, k], **style)
        lengths.set(ylabel="commanded change (mm)", xlim=(record.time[0], record.time[-1]))
        tensions.set(ylabel="tension (N)", xlabel="time (s)", xlim=(record.time[0], record.time[-1]))
        lengths.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return Figure("tendons", "Commanded tendon lengths, from calibration, and tendon forces. A slack tendon is at 0 N.")


def _pictures(pictures: Sequence[CameraPicture], folder: Path) -> Figure:
    moments = list(dict.fromkeys(p.t for p in pictures))
    n = len(moments)
    with figure(folder / "pictures", 2, n, size=(3.2 * n, 3.9)) as axes:
        for p in pictures:
            i = moments.index(p.t)
            _show(axes[i if p.camera == "left" else i + n], p)
            axes[i].set_title(f"{p.t:.1f} s, {p.role}")
    caption = (
        "Left (above) and right camera. Ball (circle), wrist (cross) and gripper (plus), yellow as measured in the "
        "pictures, blue as the controller has them."
    )
    return Figure("pictures", caption)


def _show(axis: Axes, picture: CameraPicture) -> None:
    axis.imshow(picture.pixels[:, :, ::-1])
    axis.set_axis_off()
    axis.set(xlim=_SHOWN_COLUMNS, ylim=_SHOWN_ROWS)
    for mark in picture.marks:
        style: dict[str, Any] = {"color": mark.colour, "lw": 1.2}
        if mark.shape == "circle":
            axis.add_patch(Circle((mark.u, mark.v), mark.radius, fill=False, **style))
        else:
            axis.plot(mark.u, mark.v, {"cross": "x", "plus": "+"}[mark.shape], ms=8, color=mark.colour, mew=1.4)
