"""Figures of a push: errors as in [Fernandes2020] figs. 4.5-4.16, thrust, and the scene at three moments."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.free_flyer.impedance_model import Errors
from handover.scenarios.free_flyer.impedance_parameters import Parameters, Wrench
from handover.scenarios.free_flyer.impedance_watch import ImpedanceWatch
from handover.scenarios.free_flyer.scene import draw_scene, robot_at
from handover.scenarios.free_flyer.thrust_figure import draw_thrust

_PUSH_COLOUR = "#fbe3cf"
_CALCULATED = "calculated, [Fernandes2020] eq. (4.4)"


def draw_push(parameters: Parameters, watch: ImpedanceWatch, record: Record, folder: Path) -> list[Figure]:
    """Draw all figures of a run into a folder; return them in the order of a report."""
    if len(record.time) < 2:
        return []
    errors = watch.errors()
    return [
        _errors(parameters, errors, folder),
        _scene(errors, parameters, record, folder),
        draw_thrust(record, ("impedance",), folder, _push(parameters)),
    ]


def _errors(parameters: Parameters, errors: Errors, folder: Path) -> Figure:
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


def _push(p: Parameters) -> Callable[[Axes, bool], None]:
    """Return what shades the time of the push."""

    def shade(axes: Axes, named: bool) -> None:
        axes.axvspan(p.begin, p.end, color=_PUSH_COLOUR, lw=0, zorder=0, label=_told(p) if named else None)

    return shade


def _told(p: Parameters) -> str:
    what = f"pushed with {p.force:g} N along" if p.kind is Wrench.FORCE else f"twisted with {p.torque:g} N m about"
    return f"{what} {p.axis.name.lower()} for {p.duration:g} s"


def _scene(errors: Errors, parameters: Parameters, record: Record, folder: Path) -> Figure:
    """Draw the start, the greatest error (of position, or of orientation for a twist), and the end."""
    size = np.linalg.norm(errors.p if parameters.kind is Wrench.FORCE else errors.R, axis=1)
    rows = (0, int(np.argmax(size)), len(record.time) - 1)
    titles = (f"{record.time[r]:.1f} s, {what}" for r, what in zip(rows, ("start", "farthest", "end"), strict=True))
    moments = {title: robot_at(record, r, 0.0) for title, r in zip(titles, rows, strict=True)}
    return draw_scene(moments, "Blue: jaws.", folder)
