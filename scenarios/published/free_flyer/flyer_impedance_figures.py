"""Figures of the pushed free-flyer: errors over time like [Fernandes2020] figs. 4.5 to 4.16, and ratios by duration."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.free_flyer.parameters import Axis, Behaviour, ImpedanceParameters, Wrench
from handover.scenarios.free_flyer.push.impedance_evaluation import Errors, Motion, errors_of
from handover.scenarios.published.free_flyer.push_runs import (
    DURATIONS,
    Push,
    PushRuns,
    predicted_errors,
    predicted_greatest,
)

_SHOWN = {Behaviour.RIGID: 8.0, Behaviour.COMPLIANT: 20.0}
"""Time that is drawn, s: until the gripper is nearly at rest."""
_UNITS = (("position", "mm", 1e3, 20.0), ("orientation", "°", float(np.degrees(1.0)), 2.0))
"""What is drawn, its unit, how many of it a metre or a radian is, and what an axis shows at least, up and down."""
_STROKES = {"actual": "-", "calculated by eq. (4.4)": "--", "by python-control": ":"}


def draw_errors(rows: PushRuns, runs: Path, folder: Path) -> list[Figure]:
    """Draw a figure for each kind of push and each behaviour, with a row of panels for each axis."""
    figures: list[Figure] = []
    for behaviour in Behaviour:
        for kind in Wrench:
            figures += _draw_kind(rows, runs, folder, behaviour, kind)
    return figures


def _draw_kind(rows: PushRuns, runs: Path, folder: Path, behaviour: Behaviour, kind: Wrench) -> list[Figure]:
    found: list[tuple[Push, Errors]] = []
    for axis in Axis:
        push = Push(kind, axis)
        row = rows.of(push, behaviour)
        path = None if row is None else runs / row["run"] / "signals.parquet"
        if path is not None and path.exists():
            found.append((push, _errors_of(Record(path), behaviour)))
    if not found:
        return []
    name = f"errors_{behaviour.item}_{kind.name.lower()}"
    with figure(folder / name, len(found), 2, size=(9.0, 0.9 + 2.1 * len(found))) as panels:
        for i, (push, errors) in enumerate(found):
            _draw_push(panels[2 * i : 2 * i + 2], push, behaviour, errors)
        for axis in panels[-2:]:
            axis.set_xlabel("time (s)")
        legend_below(panels[0], _entries())
    numbers = f"{found[0][0].figure_number(behaviour)} to {found[-1][0].figure_number(behaviour).removeprefix('fig. ')}"
    caption = (
        f"Errors of the gripper's pose in W, rest minus actual, of the {behaviour.item} robot with ideal thrust, like "
        f"{numbers}: actual, calculated by eq. (4.4) (dashed), and the linear response by python-control (dotted). "
        "Shaded: the push."
    )
    return [Figure(name, caption)]


def _errors_of(record: Record, behaviour: Behaviour) -> Errors:
    motion = Motion.of(record, record.time)
    p_WG_goal = np.array(paper_values("free_flyer", "push_place")["p_WG_goal"])
    return errors_of(motion, p_WG_goal, behaviour, ImpedanceParameters().model)


def _draw_push(panels: list[Axes], push: Push, behaviour: Behaviour, errors: Errors) -> None:
    p, shown = ImpedanceParameters(), errors.t <= _SHOWN[behaviour]
    t = errors.t[shown]
    predicted = predicted_errors(push, behaviour, p.duration, t)
    turned, turned_model = errors.without_jumps
    for axis, (what, unit, scale, least), actual, model, linear in zip(
        panels, _UNITS, (errors.p, turned), (errors.p_model, turned_model), predicted, strict=True
    ):
        axis.axvspan(p.begin, p.end, color="#eef2f7", lw=0)
        curves: tuple[Floats, ...] = (actual[shown], model[shown], linear)
        for values, style in zip(curves, _STROKES.values(), strict=True):
            for k in range(3):
                axis.plot(t, scale * values[:, k], style, color=COLOURS[k], lw=1.6 if style == "-" else 1.1)
        axis.set(ylabel=f"{what} error ({unit})", xlim=(0.0, _SHOWN[behaviour]), title=push.label)
        low, high = axis.get_ylim()
        axis.set_ylim(min(low, -least), max(high, least))


def _entries() -> dict[str, Line2D]:
    """Return the legend's entries of colours and strokes."""
    axes = {axis: Line2D([], [], color=COLOURS[k], lw=1.6) for k, axis in enumerate("xyz")}
    return axes | {name: Line2D([], [], color=COLOURS[5], ls=style, lw=1.3) for name, style in _STROKES.items()}


def draw_ratios(rows: PushRuns, folder: Path) -> list[Figure]:
    """Draw compliant over rigid greatest errors by the force's duration, and the linear model's."""
    found = {axis: [(d, r) for d in DURATIONS if (r := rows.ratio(axis, d)) is not None] for axis in Axis}
    if any(len(points) < 2 for points in found.values()):
        return []
    published = float(paper_values("free_flyer", "published")["compliant_over_rigid"])
    durations: Floats = np.geomspace(min(DURATIONS), max(DURATIONS), 24)
    with figure(folder / "ratio", 1, size=(8.0, 3.4)) as (axes,):
        axes.axhline(published, color=COLOURS[5], ls=(0, (7, 3)), lw=1.0, label="published")
        for axis, points in found.items():
            push, colour = Push(Wrench.FORCE, axis), COLOURS[int(axis)]
            linear = [
                predicted_greatest(push, Behaviour.COMPLIANT, d) / predicted_greatest(push, Behaviour.RIGID, d)
                for d in durations.tolist()
            ]
            axes.plot(durations, linear, ":", color=colour, lw=1.2)
            axes.plot(*zip(*points, strict=True), "o", ms=5, color=colour, label=f"along {axis.name.lower()}")
        axes.plot([], [], ":", color="#4d5866", label="python-control")
        axes.set(xscale="log", xlabel="duration of the push (s)", ylabel="compliant over rigid (1)", ylim=(0.0, None))
        axes.legend(loc="lower right", ncols=2)
    caption = (
        "Greatest position error of the compliant robot over that of the rigid one under 5 N with ideal thrust, by how "
        "long the force lasts, which the thesis does not say."
    )
    return [Figure("ratio", caption)]
