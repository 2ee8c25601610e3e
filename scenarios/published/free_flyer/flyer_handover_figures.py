"""Figures of the free-flyer's handovers: as [Fernandes2020] figs. 4.29 to 4.38, margins, and displacement by force."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS, draw_time_figures
from handover.scenarios.experiment.time_plot import TimeFigure, TimePlot
from handover.scenarios.published.figures import SOFT, Drawable, Mark, Panel, drawn, level, records_of, strips
from handover.scenarios.published.free_flyer.handovers import EXCHANGES, GIVING, TASKS, Variation
from handover.scenarios.published.free_flyer.linear_model import linear_loop
from handover.scenarios.published.runs import Runs
from handover.scenarios.robots.free_flyer.handover.handover_plots import figures_of_handover
from handover.scenarios.robots.free_flyer.parameters import Behaviour, HandoverParameters, Propulsion, Task

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
_INK = "#1c2330"

Find = Callable[..., Runs]
"""Finds the runs of a task, behaviour, propulsion and variation."""


def figure_number(task: Task, behaviour: Behaviour) -> str:
    """Return the thesis's figures of a handover, "" where it has none."""
    numbers = _FIGURES.get((task, behaviour))
    return "" if numbers is None else f"figs. 4.{numbers[0]}, 4.{numbers[1]}"


def draw_handovers(
    find: Find, thrusts: Sequence[Propulsion], strengths: Mapping[float, Variation], runs: Path, folder: Path
) -> list[Figure]:
    """Draw motion and gripper over time, how the gripper yields, margins of speeds, and displacement by force.

    Args:
        find: finds runs in the campaign.
        thrusts: propulsions.
        strengths: persons by the force with which they pull at most, N, ascending.
        runs: where the folders of the runs are.
        folder: where the figures go.
    """
    over_time: list[Figure] = []
    yielding: list[Figure] = []
    for task in Task:
        found = {b: records_of(find(task, b, Propulsion.IDEAL).names[:1], runs) for b in Behaviour}
        records = [(b, record) for b, of_behaviour in found.items() for record in of_behaviour]
        over_time += [figure for b, record in records for figure in _over_time(record, task, b, folder)]
        moved = [(b, m) for b, record in records if (m := _yielding(record, b)) is not None]
        panels = [panel for b, m in moved for panel in _panels_of_yielding(b, m)]
        caption = (
            f"Gripper from its place in W while the robot first yields, {TASKS[task]}, with ideal thrust. Dotted: the "
            "linear response of the controller's model, by python-control, to what the person does to the gripper."
        )
        yielding += drawn(folder / f"yielding_{task.item}", caption, panels, 2, size=(9.0, 0.9 + 2.3 * len(moved)))
    return [*over_time, *yielding, *_margins(find, thrusts, folder), *_strengths(find, thrusts, strengths, folder)]


def _over_time(record: Record, task: Task, behaviour: Behaviour, folder: Path) -> list[Figure]:
    parameters = HandoverParameters(behaviour=behaviour, propulsion=Propulsion.IDEAL)
    positions, orientations, gripper = figures_of_handover(parameters, record)[:3]
    numbers = _FIGURES.get((task, behaviour))
    motion_like, gripper_like = (f", like fig. 4.{n}" for n in numbers) if numbers else ("", "")
    what, of = f"{TASKS[task]}, {behaviour.item}, with ideal thrust", f"{task.item}_{behaviour.item}"
    specs = [
        TimeFigure(
            name=f"motion_{of}",
            caption=f"Position and orientation in W of gripper, hand and object, {what}{motion_like}; shaded by the "
            "robot's phases.",
            plots=[*positions.plots, *(_not_magnified(plot) for plot in orientations.plots)],
        ),
        replace(
            gripper,
            name=f"gripper_{of}",
            caption=f"Angle and speed of the gripper with their thresholds, {what}{gripper_like}; shaded by the "
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


def _panels_of_yielding(behaviour: Behaviour, m: _Yielding) -> list[Panel]:
    shown = ((m.p, m.p_linear, 1e3, "position (mm)"), (m.turn, m.turn_linear, np.degrees(1.0), "turn (°)"))
    panels: list[Panel] = []
    for actual, linear, scale, label in shown:
        marks = [Mark(m.t, scale * actual[:, i], "-", COLOURS[i], "xyz"[i]) for i in range(3)]
        marks += [Mark(m.t, scale * linear[:, i], ":", _INK, "by python-control") for i in range(3)]
        least = _LEAST if "°" in label else 0.0
        axes = {"title": behaviour.item, "xlabel": "time (s)", "ylabel": label}
        panels.append(Panel([*marks, Mark(m.t[:1].repeat(2), [-least, least], "", style={"alpha": 0.0})], axes))
    return panels


def _margins(find: Find, thrusts: Sequence[Propulsion], folder: Path) -> list[Figure]:
    cases: dict[str, Sequence[Drawable]] = {}
    for e, b, p in product(EXCHANGES, Behaviour, thrusts):
        if len(found := find(e.task, b, p)):
            alpha = e.threshold(b)
            cases[f"{e.label}, {b.item}, {p.item}"] = (
                Mark(rest := e.of(found, "rest_speed"), np.zeros(len(rest)), "o", COLOURS[0], "at rest"),
                Mark(felt := e.of(found, "speed"), np.zeros(len(felt)), "D", COLOURS[1], "when felt"),
                Mark([alpha, alpha], [-0.42, 0.42], "-", SOFT, "threshold", style={"lw": 1.6}),
            )
    caption = (
        "Speed of the gripper as the robot sees it, in each run: the greatest while it waits and nobody touches it, "
        "and when it felt the person. Between them is its threshold, that of sec. 4.1.2."
    )
    axes = {"xlabel": "speed of the gripper (m/s)", "xlim": (0.0, None)}
    return strips(folder / "margins", caption, cases, axes)


def _strengths(
    find: Find, thrusts: Sequence[Propulsion], strengths: Mapping[float, Variation], folder: Path
) -> list[Figure]:
    """Draw how far the gripper goes along z, as it gives, by how strongly the person pulls."""
    published = paper_values("free_flyer", "published")["transfer_displacement_z"]
    panels: list[Panel] = []
    for propulsion in thrusts:
        marks: list[Drawable] = []
        for b in Behaviour:
            found = {n: find(GIVING.task, b, propulsion, v) for n, v in strengths.items()}
            away = {n: 1e3 * GIVING.of(runs, "displacement_z") for n, runs in found.items()}
            away = {n: z for n, z in away.items() if len(z)}
            if len(away) < 3:
                return []
            felt = [n for n in away if len(GIVING.of(found[n], "speed")) == len(found[n])]
            marks.append(Mark(felt, [float(np.median(away[n])) for n in felt], "-", COLOURS[b]))
            for n, z in away.items():
                style = {"ms": 5.0, "markerfacecolor": COLOURS[b] if n in felt else "white"}
                marks.append(Mark(np.full(len(z), n), z, "o", COLOURS[b], style=style))
            marks += [Mark(form="o-", colour=COLOURS[b], label=b.item), level(1e3 * published[b], COLOURS[b])]
        marks += [
            Mark(form="o", label="not felt", style={"markerfacecolor": "white"}),
            Mark(label="published", form="--"),
        ]
        axes = {"title": _IN_WORDS[propulsion], "xlabel": "force of the pull at most (N)"}
        limits = {"xlim": (0.0, None), "ylim": (0.0, None)}
        panels.append(Panel(marks, {**axes, "ylabel": "gripper along z (mm)", **limits}))
    caption = (
        "How far the gripper goes from its place along z of W as the robot gives, by the force with which the person "
        "pulls at most. Shown are each run, and lines through the medians of those that the robot felt in all runs; "
        "hollow where it did not, and the person gave up. Dashed: sec. 4.3.1."
    )
    return drawn(folder / "strength", caption, panels, len(thrusts), size=(9.0, 3.7), same_height=True)
