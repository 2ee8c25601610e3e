"""Figures of the free-flyer's handovers: as [Fernandes2020] figs. 4.29 to 4.38, margins, and displacement by force."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from matplotlib.lines import Line2D
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS, draw_time_figures, figure, legend_below
from handover.scenarios.experiment.time_plot import TimeFigure, TimePlot
from handover.scenarios.free_flyer.handover.handover_plots import figures_of_handover
from handover.scenarios.free_flyer.parameters import Behaviour, HandoverParameters, Propulsion, Task
from handover.scenarios.published.free_flyer.handover_runs import (
    EXCHANGES,
    GIVING,
    STRENGTHS,
    THRUSTS,
    Exchange,
    HandoverRuns,
)
from handover.scenarios.published.free_flyer.push_runs import linear_loop
from handover.scenarios.published.free_flyer.variations import TASKS, USUAL, Variation

_FIGURES = {
    (Task.ROBOT_TO_HUMAN, Behaviour.RIGID): (29, 30),
    (Task.ROBOT_TO_HUMAN, Behaviour.COMPLIANT): (31, 32),
    (Task.HUMAN_TO_ROBOT, Behaviour.RIGID): (33, 34),
    (Task.HUMAN_TO_ROBOT, Behaviour.COMPLIANT): (35, 36),
    (Task.FAILED_RECEPTION, Behaviour.COMPLIANT): (37, 38),
}
"""Numbers of the thesis's figures in chapter 4, of motion and of gripper; it has none of the other handovers."""
_IN_WORDS = {
    Propulsion.IDEAL: "ideal thrust",
    Propulsion.LIMITED: "Astrobee's limits",
    Propulsion.NOZZLES: "Astrobee's nozzles",
}
_LEAST = 2.0
"""What a plot of angles shows at least, up and down, °."""


def figure_number(exchange: Exchange, behaviour: Behaviour) -> str:
    """Return the thesis's figures of a handover, "" where it has none."""
    numbers = _FIGURES.get((exchange.task, behaviour))
    return "" if numbers is None else f"figs. 4.{numbers[0]}, 4.{numbers[1]}"


def draw_handovers(rows: HandoverRuns, runs: Path, folder: Path) -> list[Figure]:
    """Draw motion and gripper over time, of the first run of each handover with ideal thrust."""
    figures: list[Figure] = []
    for task in Task:
        for behaviour in Behaviour:
            for row in rows.of(task, behaviour, Propulsion.IDEAL)[:1]:
                path = runs / row["run"] / "signals.parquet"
                if path.exists():
                    figures += _draw_handover(Record(path), task, behaviour, folder)
    return figures


def _draw_handover(record: Record, task: Task, behaviour: Behaviour, folder: Path) -> list[Figure]:
    parameters = HandoverParameters(behaviour=behaviour, propulsion=Propulsion.IDEAL)
    positions, orientations, gripper = figures_of_handover(parameters, record)[:3]
    numbers = _FIGURES.get((task, behaviour))
    like = [f", like fig. 4.{n}" for n in numbers] if numbers else ["", ""]
    what = f"{TASKS[task]}, {behaviour.item}, with ideal thrust"
    specs = [
        TimeFigure(
            name=f"motion_{task.item}_{behaviour.item}",
            caption=f"Position and orientation in W of gripper, hand and object, {what}{like[0]}; shaded by the "
            "robot's phases.",
            plots=[*positions.plots, *(_not_magnified(plot) for plot in orientations.plots)],
        ),
        replace(
            gripper,
            name=f"gripper_{task.item}_{behaviour.item}",
            caption=f"Angle and speed of the gripper with their thresholds, {what}{like[1]}; shaded by the "
            "robot's phases.",
            plots=gripper.plots[:2],
        ),
    ]
    return draw_time_figures(specs, record.time, folder)


def _not_magnified(plot: TimePlot) -> TimePlot:
    """Return a plot of angles, °, which shows two degrees up and down at least: less is noise and tremor."""
    values = np.concatenate([curve.values for curve in plot.curves])
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return replace(plot, limits=(min(1.1 * low, -_LEAST), max(1.1 * high, _LEAST)))


@dataclass(frozen=True)
class _Yielding:
    """The gripper from its place while the robot yields: s, and in W position, m, and rotation vector, rad, (n, 3)."""

    t: Floats
    p: Floats
    turn: Floats
    p_linear: Floats
    turn_linear: Floats


def _yielding(record: Record, behaviour: Behaviour) -> _Yielding | None:
    """Return the gripper in the first transfer, actual and by python-control; None if the robot never yielded.

    The linear one is the response of the body near rest, from rest in its place on, to what the person does to the
    gripper, with the object between them: eq. (3.25) at the controller's period, ideal thrust and exact navigation.
    """
    active = record["decision.impedance"].astype(bool)
    if not active.any():
        return None
    first = int(np.argmax(active))
    n = int(np.argmin(active[first:])) or len(active) - first
    span = slice(first, first + n)
    R_WG, R_WD = (
        Rotation.from_quat(record[name][span], scalar_first=True) for name in ("robot.q_WG", "decision.q_WG_goal")
    )
    turn: Floats = (cast(Any, R_WG) * cast(Any, R_WD).inv()).as_rotvec()
    wrench = np.hstack([record["person.f_G"][span], record["person.tau_G"][span]])
    moved = linear_loop(behaviour).response(wrench)
    p = record["robot.p_WG"][span] - record["decision.p_WG_goal"][span]
    return _Yielding(record.time[span], p, turn, moved[:, :3], moved[:, 3:6])


def draw_yielding(rows: HandoverRuns, runs: Path, folder: Path) -> list[Figure]:
    """Draw how the gripper yields in the first run of each task with ideal thrust, beside python-control's response."""
    figures: list[Figure] = []
    for task in Task:
        found: list[tuple[Behaviour, _Yielding]] = []
        for behaviour in Behaviour:
            paths = [runs / row["run"] / "signals.parquet" for row in rows.of(task, behaviour, Propulsion.IDEAL)[:1]]
            moved = [m for path in paths if path.exists() and (m := _yielding(Record(path), behaviour)) is not None]
            found += [(behaviour, m) for m in moved]
        if found:
            figures.append(_draw_yielding(task, found, folder))
    return figures


def _draw_yielding(task: Task, found: Sequence[tuple[Behaviour, _Yielding]], folder: Path) -> Figure:
    name = f"yielding_{task.item}"
    with figure(folder / name, len(found), 2, size=(9.0, 0.9 + 2.3 * len(found))) as panels:
        for k, (behaviour, m) in enumerate(found):
            shown = ((m.p, m.p_linear, 1e3, "position (mm)"), (m.turn, m.turn_linear, np.degrees(1.0), "turn (°)"))
            for axes, (actual, linear, scale, label) in zip(panels[2 * k : 2 * k + 2], shown, strict=True):
                for i in range(3):
                    axes.plot(m.t, scale * actual[:, i], "-", lw=1.6, color=COLOURS[i])
                    axes.plot(m.t, scale * linear[:, i], ":", lw=1.6, color="#1c2330")
                low, high = axes.get_ylim()
                least = _LEAST if "°" in label else 0.0
                axes.set(title=behaviour.item, ylabel=label, ylim=(min(low, -least), max(high, least)))
        for axes in panels[-2:]:
            axes.set_xlabel("time (s)")
        entries = {axis: Line2D([], [], color=COLOURS[i], lw=1.6) for i, axis in enumerate("xyz")}
        entries["by python-control"] = Line2D([], [], color="#1c2330", ls=":", lw=1.6)
        legend_below(panels[0], entries)
    caption = (
        f"Gripper from its place in W while the robot first yields, {TASKS[task]}, with ideal thrust; dotted: the "
        "linear response of the controller's model, by python-control, to what the person does to the gripper."
    )
    return Figure(name, caption)


def draw_margins(rows: HandoverRuns, folder: Path) -> list[Figure]:
    """Draw the gripper's speeds at rest and when the robot felt the person, beside the thresholds."""
    cases = [
        (exchange, behaviour, propulsion, found)
        for exchange in EXCHANGES
        for behaviour in Behaviour
        for propulsion in THRUSTS
        if (found := rows.of(exchange.task, behaviour, propulsion))
    ]
    if not cases:
        return []
    with figure(folder / "margins", 1, size=(8.0, 1.3 + 0.24 * len(cases))) as (axes,):
        for k, (exchange, behaviour, _, found) in enumerate(cases):
            rest, felt = exchange.of(found, "rest_speed"), exchange.of(found, "speed")
            alpha = exchange.threshold(behaviour)
            labels = ("at rest", "when felt", "threshold") if k == 0 else (None, None, None)
            axes.plot(rest, np.full(len(rest), k), "o", ms=4, color=COLOURS[0], label=labels[0])
            axes.plot(felt, np.full(len(felt), k), "D", ms=4, color=COLOURS[1], label=labels[1])
            axes.plot([alpha] * 2, [k - 0.42, k + 0.42], color=COLOURS[5], lw=1.6, label=labels[2])
        axes.set_yticks(range(len(cases)), [f"{e.label}, {b.item}, {p.item}" for e, b, p, _ in cases], fontsize=8)
        axes.invert_yaxis()
        axes.set(xlabel="speed of the gripper (m/s)", xlim=(0.0, None))
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    caption = (
        "Speed of the gripper as the robot sees it: the greatest while it waits and nobody touches it, and when it "
        "felt the person, in each run; between them its threshold, that of sec. 4.1.2."
    )
    return [Figure("margins", caption)]


def _by_force(
    rows: HandoverRuns, variations: Sequence[tuple[float, Variation]], propulsion: Propulsion, behaviour: Behaviour
) -> list[tuple[float, Floats, bool]]:
    """Return force, N, displacements along z, mm, and whether the robot felt the pull in all runs."""
    points: list[tuple[float, Floats, bool]] = []
    for strength, variation in variations:
        found = rows.of(GIVING.task, behaviour, propulsion, variation)
        z = 1e3 * GIVING.of(found, "displacement_z")
        if len(z):
            points.append((strength, z, len(GIVING.of(found, "speed")) == len(found)))
    return points


def draw_strengths(rows: HandoverRuns, folder: Path) -> list[Figure]:
    """Draw how far the gripper goes along z, as it gives, by how strongly the person pulls."""
    usual = HandoverParameters().strength
    variations = sorted(
        [(usual, USUAL), *((float(v.parameters["strength"]), v) for v in STRENGTHS)], key=lambda pair: pair[0]
    )
    found = {(p, b): _by_force(rows, variations, p, b) for p in THRUSTS for b in Behaviour}
    if any(len(points) < 3 for points in found.values()):
        return []
    published = [1e3 * float(x) for x in paper_values("free_flyer", "published")["transfer_displacement_z"]]
    with figure(folder / "strength", 1, len(THRUSTS), size=(9.0, 3.7)) as panels:
        for axes, propulsion in zip(panels, THRUSTS, strict=True):
            for behaviour in Behaviour:
                points, colour = found[propulsion, behaviour], COLOURS[int(behaviour)]
                felt_at = [(strength, float(np.median(z))) for strength, z, felt in points if felt]
                if felt_at:
                    axes.plot(*zip(*felt_at, strict=True), "-", lw=1.2, color=colour)
                for strength, z, felt in points:
                    inside = colour if felt else "white"
                    axes.plot(np.full(len(z), strength), z, "o", ms=5, color=colour, markerfacecolor=inside)
                axes.plot([], [], "o-", ms=5, color=colour, label=behaviour.item)
                axes.axhline(published[behaviour], color=colour, ls=(0, (7, 3)), lw=1.0)
            axes.plot([], [], "o", ms=5, color=COLOURS[5], markerfacecolor="white", label="not felt")
            axes.plot([], [], color=COLOURS[5], ls=(0, (7, 3)), lw=1.0, label="published")
            axes.set(
                title=_IN_WORDS[propulsion], xlabel="force of the pull at most (N)", xlim=(0.0, None), ylim=(0.0, None)
            )
        top = max(axes.get_ylim()[1] for axes in panels)
        for axes in panels:
            axes.set_ylim(0.0, top)
        panels[0].set_ylabel("gripper along z (mm)")
        legend_below(panels[0])
    caption = (
        "How far the gripper goes from its place along z of W as the robot gives, by the force with which the person "
        "pulls at most, which the thesis does not say: each run, and lines through the medians of those that the robot "
        "felt in all runs; hollow where it did not, and the person gave up. Dashed: sec. 4.3.1."
    )
    return [Figure("strength", caption)]
