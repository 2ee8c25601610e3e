"""Figures of a Helix handover: error and phases, paths, tendons, and the camera pictures of three moments."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from cosim.pinhole import Pinhole
from scenarios.experiment import Figure
from scenarios.helix_handover.parameters import Parameters
from scenarios.helix_handover.rig import camera_of
from scenarios.helix_handover.snapshot import Snapshot
from scenarios.plotting import COLOURS, figure, shade_phases
from scenarios.record import Record

_SHOWN_COLUMNS, _SHOWN_ROWS = (240, 1040), (620, 150)


def draw_handover(
    parameters: Parameters, snapshots: Mapping[str, Snapshot], record: Record, folder: Path
) -> list[Figure]:
    """Draw all figures of a run into a folder; return them in the order of a report. Snapshots are by their titles."""
    made = [_pictures(snapshots, folder)] if snapshots else []
    return [*made, _error(parameters, record, folder), _paths(record, folder), _tendons(record, folder)]


def _error(parameters: Parameters, record: Record, folder: Path) -> Figure:
    t = record.time
    true = np.linalg.norm(record["arm.p_WG"] - record["hand.p_WO"], axis=1)
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


def _tendons(record: Record, folder: Path) -> Figure:
    with figure(folder / "tendons", 2, size=(8.0, 5.0)) as (lengths, tensions):
        for k in range(9):
            style: dict[str, Any] = {"color": COLOURS[k // 3], "ls": ("-", "--", ":")[k % 3], "lw": 1.2}
            label = f"segment {k // 3 + 1}, {120 * (k % 3)}°"
            lengths.plot(record.time, record["servo.dl_t"][:, k] * 1000, drawstyle="steps-post", label=label, **style)
            tensions.plot(record.time, record["arm.tension"][:, k], **style)
        lengths.set(ylabel="commanded change (mm)", xlim=(record.time[0], record.time[-1]))
        tensions.set(ylabel="tension (N)", xlabel="time (s)", xlim=(record.time[0], record.time[-1]))
        lengths.legend(ncols=3, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    return Figure("tendons", "Commanded tendon lengths, from calibration, and tendon forces. A slack tendon is at 0 N.")


def _pictures(snapshots: Mapping[str, Snapshot], folder: Path) -> Figure:
    n = len(snapshots)
    with figure(folder / "pictures", 2, n, size=(4.0 * n, 4.7)) as axes:
        for i, (role, shot) in enumerate(snapshots.items()):
            for side, axis in (("left", axes[i]), ("right", axes[i + n])):
                _show(axis, shot, side)
            axes[i].set_title(f"{shot.t:.1f} s, {role}")
    caption = "Left (above) and right camera. Marked as estimated: ball (circle), wrist (cross), gripper (plus)."
    return Figure("pictures", caption)


def _show(axis: Axes, shot: Snapshot, side: str) -> None:
    picture: NDArray[np.uint8] = getattr(shot, side)
    axis.imshow(picture[:, :, ::-1])
    axis.set_axis_off()
    axis.set(xlim=_SHOWN_COLUMNS, ylim=_SHOWN_ROWS)
    camera = camera_of(side)
    if not np.any(shot.p_WG_est):
        return
    ball, wrist, gripper = (_pixel(camera, p) for p in (shot.p_WO_est, shot.p_WR_est, shot.p_WG_est))
    axis.plot(*ball, "o", ms=16, mfc="none", mec="#ffd23f", mew=1.6)
    axis.plot(*wrist, "x", ms=8, color="#2c5fff", mew=1.8)
    axis.plot(*gripper, "+", ms=11, color="#ff3b30", mew=1.8)


def _pixel(camera: Pinhole, p_WP: NDArray[np.float64]) -> tuple[float, float]:
    u, v = camera.project(p_WP)
    return float(u), float(v)
