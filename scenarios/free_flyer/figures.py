"""Figures of a handover as in [Fernandes2020] figs. 4.29-4.38: paths, gripper, thrust, the scene at three moments.

Figures of a push: errors as in [Fernandes2020] figs. 4.5-4.16, thrust, and the scene at three moments.

What the controllers command of the thrusters, and what the thrusters give.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS, figure, leave_room, shade_phases
from handover.scenarios.free_flyer.handover_evaluation import HandoverWatch
from handover.scenarios.free_flyer.impedance_evaluation import Errors, ImpedanceWatch
from handover.scenarios.free_flyer.parameters import HandoverParameters, ImpedanceParameters, Wrench
from handover.scenarios.free_flyer.plots import BEYOND, QUANTITIES, commanded_wrench
from handover.scenarios.free_flyer.scene import draw_near, draw_scene, jaw_gap, person_at, robot_at


def draw_thrust(
    record: Record, controllers: Sequence[str], folder: Path, shade: Callable[[Axes, bool], None]
) -> Figure:
    """Draw force and torque in B over time; commands of several controllers are added, as the thrusters do.

    The axes show what the thrusters give; commands run out of them. `shade` marks times in given axes,
    with names if so told.
    """
    t = record.time
    with figure(folder / "thrust", 2, size=(9.0, 6.2)) as axes:
        for axis, (what, quantity, unit) in zip(axes, QUANTITIES, strict=True):
            commanded = commanded_wrench(record, controllers, what)
            given = record[f"thrusters.{what}_B"]
            for i, name in enumerate("xyz"):
                axis.plot(t, commanded[:, i], color=COLOURS[i], lw=0.9, alpha=0.45, label=f"{name}, commanded")
                axis.plot(t, given[:, i], color=COLOURS[i], lw=1.2, label=f"{name}, given")
            limit = BEYOND * float(np.abs(given).max())
            if float(np.abs(commanded).max()) > limit > 0.0:
                axis.set_ylim(-limit, limit)
            axis.set(ylabel=f"{quantity.lower()} ({unit})", xlim=(t[0], t[-1]))
            shade(axis, axis is axes[0])
            leave_room(axis)
        axes[1].set_xlabel("time (s)")
        handles, labels = axes[0].get_legend_handles_labels()
        axes[0].figure.legend(handles, labels, ncols=(len(labels) + 1) // 2, loc="outside lower center")
    caption = (
        "Force and torque on the robot in B; pale: as commanded, where the thrusters give less, cut off far beyond."
    )
    return Figure("thrust", caption)


_FOLLOWED: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("person.{}_WO", "object", {"color": COLOURS[2], "lw": 4.5, "alpha": 0.4}),
    ("person.{}_WH", "hand", {"color": COLOURS[1], "lw": 1.4}),
    ("robot.{}_WG", "gripper", {"color": COLOURS[0], "lw": 1.4}),
)
"""Signals, labels and lines; the object's is wide, since it goes with the gripper or the hand."""


_WATCHING = ("SIGNAL", "CHECK_VELOCITY")
"""Phases in which the threshold of the gripper's speed counts."""


def draw_handover(parameters: HandoverParameters, watch: HandoverWatch, record: Record, folder: Path) -> list[Figure]:
    """Draw all figures of a run into a folder; return them in the order of a report."""
    if len(record.time) < 2:
        return []
    return [
        *_scenes(watch, record, folder),
        _paths(record, "p", lambda p: 1000 * p, "{} (mm)", ("x", "y", "z"), folder / "positions"),
        _paths(record, "q", _angles, "{} (rad)", ("roll", "pitch", "yaw"), folder / "orientations"),
        _gripper(parameters, watch, record, folder),
        draw_thrust(record, ("impedance", "pose"), folder, _phases(record)),
    ]


def _paths(
    record: Record, quantity: str, of: Callable[[Floats], Floats], axis_told: str, names: tuple[str, ...], path: Path
) -> Figure:
    with figure(path, 3, size=(9.0, 6.8), heights=(1.6, 1.0, 1.0)) as axes:
        for i, (axis, name) in enumerate(zip(axes, names, strict=True)):
            shade_phases(axis, record.time, record["decision.phase"], _phase_names(record) if i == 0 else {})
            for signal, label, style in _FOLLOWED:
                axis.plot(record.time, of(record[signal.format(quantity)])[:, i], label=label, **style)
            axis.set(ylabel=axis_told.format(name), xlim=(record.time[0], record.time[-1]))
        leave_room(axes[0])
        axes[-1].set_xlabel("time (s)")
        axes[-1].legend(ncols=3, loc="upper right", bbox_to_anchor=(1.0, -0.25))
    what = "Positions" if quantity == "p" else "Orientations"
    return Figure(path.name, f"{what} of gripper, hand and object in W; shaded by the robot's phases.")


def _angles(q: Floats) -> Floats:
    """Return roll, pitch and yaw, rad, without jumps by a whole turn."""
    yaw_pitch_roll = Rotation.from_quat(q, scalar_first=True).as_euler("ZYX")
    return np.unwrap(yaw_pitch_roll[:, ::-1], axis=0)


def _phases(record: Record) -> Callable[[Axes, bool], None]:
    """Return what shades the phases of a run."""
    names = _phase_names(record)
    return lambda axes, named: shade_phases(axes, record.time, record["decision.phase"], names if named else {})


def _phase_names(record: Record) -> dict[int, str]:
    return record.items("decision.phase")


def _gripper(parameters: HandoverParameters, watch: HandoverWatch, record: Record, folder: Path) -> Figure:
    published = paper_values("free_flyer", "published")
    t, names_of = record.time, _phase_names(record)
    watching = np.isin(record["decision.phase"], [code for code, name in names_of.items() if name in _WATCHING])
    with figure(folder / "gripper", 2, size=(9.0, 6.0), heights=(1.4, 1.0)) as (angle, speed):
        for axis in (angle, speed):
            _phases(record)(axis, axis is angle)
            axis.set(xlim=(t[0], t[-1]))
        threshold: float = published["angle_threshold"]
        told = f"above {threshold:g} rad it counts as full"
        angle.plot(t, record["person.gripper_angle"], color=COLOURS[0], label="gripper's angle, speed")
        angle.axhline(threshold, color="#4d5866", lw=0.8, ls="--", label=told)
        angle.set(ylabel="gripper angle (rad)", ylim=(0, None))
        leave_room(angle)
        speed.plot(t, record["decision.speed_G"], color=COLOURS[0])
        for transfer in watch.transfers:
            threshold = published[f"velocity_{transfer.receiver.lower()}"][parameters.behaviour]
            until = t[-1] if transfer.felt is None else transfer.felt
            shown = watching & (t >= transfer.signalled) & (t <= until)
            speed.plot(t, np.where(shown, threshold, np.nan), color=COLOURS[1], lw=2.0)
        angle.plot([], [], color=COLOURS[1], lw=2.0, label="speed at which the robot acts, while it counts")
        angle.figure.legend(*angle.get_legend_handles_labels(), ncols=3, loc="outside lower center")
        speed.set(ylabel="gripper speed (m/s)", xlabel="time (s)", ylim=(0, None))
    caption = (
        "Angle of the gripper, dashed: above it it counts as full; its speed, orange: at which the robot would act."
    )
    return Figure("gripper", caption)


def _moments(watch: HandoverWatch, record: Record) -> dict[str, int]:
    """Return the rows of start, end, and when the robot felt the person or signalled in vain, by their titles."""
    times = [(0.0, "start")]
    for name, transfer in zip(("transfer", "return"), watch.transfers, strict=False):
        times += [(t, "failed reception") for t in transfer.in_vain]
        times.append((transfer.asked, f"{name}: signal") if transfer.felt is None else (transfer.felt, name))
    if len(times) == 1 and len(watch.phases) > 1:
        phase, began = watch.phases[-1]
        times.append((began, phase.replace("_", " ").lower()))
    times.append((float(record.time[-1]), "end"))
    return {f"{t:.1f} s, {title}": int(np.searchsorted(record.time, t)) for t, title in times}


def _scenes(watch: HandoverWatch, record: Record, folder: Path) -> list[Figure]:
    """Draw the scene, and the transfers from near."""
    gap, rows = jaw_gap(record), _moments(watch, record)
    seen = {title: robot_at(record, row, float(gap[row])) + person_at(record, row) for title, row in rows.items()}
    scene = draw_scene(seen, "Blue: jaws; orange: object.", folder)
    between = list(rows)[1:-1]
    if not between:
        return [scene]
    middle = (record["robot.p_WG"] + record["person.p_WH"]) / 2
    near = {title: middle[rows[title]] for title in between}
    return [scene, draw_near({title: seen[title] for title in between}, near, folder)]


_PUSH_COLOUR = "#fbe3cf"
_CALCULATED = "calculated, [Fernandes2020] eq. (4.4)"


def draw_push(parameters: ImpedanceParameters, watch: ImpedanceWatch, record: Record, folder: Path) -> list[Figure]:
    """Draw all figures of a run into a folder; return them in the order of a report."""
    if len(record.time) < 2:
        return []
    errors = watch.errors()
    return [
        _errors(parameters, errors, folder),
        _scene(errors, parameters, record, folder),
        draw_thrust(record, ("impedance",), folder, _push(parameters)),
    ]


def _errors(parameters: ImpedanceParameters, errors: Errors, folder: Path) -> Figure:
    p = parameters
    t = errors.t
    columns = (
        ("rest - actual (mm)", 1000 * errors.p, 1000 * errors.p_model, "error of position"),
        ("rest - actual (rad)", *errors.without_jumps, "error of orientation"),
    )
    with figure(folder / "errors", 3, 2, size=(10.0, 7.0)) as axes:
        for column, (unit, actual, calculated, what) in enumerate(columns):
            limit = 1.1 * max(float(np.nanmax(np.abs(actual))), float(np.nanmax(np.abs(calculated))), 1e-3)
            for i, name in enumerate("xyz"):
                axis = axes[2 * i + column]
                axis.axvspan(p.begin, p.end, color=_PUSH_COLOUR, lw=0, zorder=0, label=_told(p))
                axis.plot(t, calculated[:, i], color=COLOURS[1], lw=1.0, alpha=0.75, label=_CALCULATED)
                axis.plot(t, actual[:, i], color=COLOURS[0], lw=1.5, label="actual")
                axis.set(xlim=(0, t[-1]), ylim=(-limit, limit), ylabel=f"{name}: {unit}")
            axes[column].set_title(what)
            axes[4 + column].set_xlabel("time (s)")
        axes[0].figure.legend(*axes[0].get_legend_handles_labels(), ncols=3, loc="outside lower center")
    return Figure("errors", f"Error of the gripper's pose, rest minus actual, in the whole run; {_told(p)}.")


def _push(p: ImpedanceParameters) -> Callable[[Axes, bool], None]:
    """Return what shades the time of the push."""

    def shade(axes: Axes, named: bool) -> None:
        axes.axvspan(p.begin, p.end, color=_PUSH_COLOUR, lw=0, zorder=0, label=_told(p) if named else None)

    return shade


def _told(p: ImpedanceParameters) -> str:
    what = f"pushed with {p.force:g} N along" if p.kind is Wrench.FORCE else f"twisted with {p.torque:g} N m about"
    return f"{what} {p.axis.name.lower()} for {p.duration:g} s"


def _scene(errors: Errors, parameters: ImpedanceParameters, record: Record, folder: Path) -> Figure:
    """Draw the start, the greatest error (of position, or of orientation for a twist), and the end."""
    size = np.linalg.norm(errors.p if parameters.kind is Wrench.FORCE else errors.R, axis=1)
    rows = (0, int(np.argmax(size)), len(record.time) - 1)
    titles = (f"{record.time[r]:.1f} s, {what}" for r, what in zip(rows, ("start", "farthest", "end"), strict=True))
    moments = {title: robot_at(record, r, 0.0) for title, r in zip(titles, rows, strict=True)}
    return draw_scene(moments, "Blue: jaws.", folder)
