"""Figures of a handover as in [Fernandes2020] figs. 4.29-4.38: paths, gripper, thrust, the scene at three moments."""

from collections.abc import Callable
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
from handover.scenarios.free_flyer.handover_parameters import Parameters
from handover.scenarios.free_flyer.handover_watch import HandoverWatch
from handover.scenarios.free_flyer.scene import draw_near, draw_scene, jaw_gap, person_at, robot_at
from handover.scenarios.free_flyer.thrust_figure import draw_thrust

_FOLLOWED: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("person.{}_WO", "object", {"color": COLOURS[2], "lw": 4.5, "alpha": 0.4}),
    ("person.{}_WH", "hand", {"color": COLOURS[1], "lw": 1.4}),
    ("robot.{}_WG", "gripper", {"color": COLOURS[0], "lw": 1.4}),
)
"""Signals, labels and lines; the object's is wide, since it goes with the gripper or the hand."""


_WATCHING = ("SIGNAL", "CHECK_VELOCITY")
"""Phases in which the threshold of the gripper's speed counts."""


def draw_handover(parameters: Parameters, watch: HandoverWatch, record: Record, folder: Path) -> list[Figure]:
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


def _gripper(parameters: Parameters, watch: HandoverWatch, record: Record, folder: Path) -> Figure:
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
