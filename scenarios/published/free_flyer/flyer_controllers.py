"""Other controllers in the place of the impedance control, as [Fernandes2020] sec. 6.3 proposes, in all handovers."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

from matplotlib.axes import Axes

from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.free_flyer.parameters import Behaviour, Propulsion, Task, TaskParameters
from handover.scenarios.published.free_flyer.push_runs import linear_loop
from handover.scenarios.published.free_flyer.variations import (
    TASKS,
    USUAL,
    Row,
    Variation,
    has,
    is_done,
    known_rows,
    names_of,
    noise_times,
    succeeded,
    unfinished_note,
    values_of,
)
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import every_claim, format_rate, nothing_measured, verdict_of

CONTROLLERS = {"ImpedanceController": "impedance", "AdmittanceController": "admittance", "PoseController": "PID"}
"""What takes the place, and its name in words."""
NO_THRUST = "no thrust"
"""What all are measured against: while it yields, the robot coasts."""
_WITHOUT_THRUST = {"impedance.f_max": "0,0,0", "impedance.tau_max": "0,0,0"}
"""Parameters of the admittance control for that: it may command nothing. The pose control flies as ever."""
_WITHOUT_LIMITS = {"impedance.f_max": "100,100,100", "impedance.tau_max": "100,100,100"}
"""Parameters of those that clip their own commands, for ideal thrust."""
DISTURBANCES = (
    Variation("delay of 32 ms, unknown to them", {"delay": "0.032", "impedance.delay": "0"}),
    noise_times(3.0),
    Variation("mass -30 %", {"mass_factor": "0.7"}),
    Variation("mass +30 %", {"mass_factor": "1.3"}),
)
"""One at a time. The controllers know neither the delay nor the mass: told of the delay, the rigid impedance control
rejects it, for its loop is then not stable, and there would be no run to look at."""
_VARIED = (*names_of(DISTURBANCES), *_WITHOUT_THRUST)
PROPULSIONS = (Propulsion.IDEAL, Propulsion.LIMITED)
"""Without and with limits of each axis."""
_DEFAULT = TaskParameters()
_SIMILAR = 0.2
"""Part of a displacement by which two controllers' may differ and count as like."""
_MIN_RUNS = 2
"""Runs of a case by which controllers are compared."""
_DISTURBED = Task.COLLABORATIVE
"""The task that is disturbed: giving, then receiving."""


def point(controller: str, task: Task, behaviour: Behaviour, propulsion: Propulsion, what: Variation) -> dict[str, str]:
    """Return a point of the plan."""
    free = propulsion is Propulsion.IDEAL and controller != "ImpedanceController"
    limits = _WITHOUT_THRUST if controller == NO_THRUST else _WITHOUT_LIMITS if free else {}
    return {
        "impedance": "AdmittanceController" if controller == NO_THRUST else controller,
        "task": task.item,
        "behaviour": behaviour.item,
        "propulsion": propulsion.item,
        **limits,
        **what.parameters,
    }


class FlyerControllers(PublishedExperiment):
    """Impedance, admittance and Astrobee's PID, rigid and compliant, in the four handovers, with limits and without.

    Beside them stands a robot without any thrust while it yields, as handovers that it does as well tell nothing of a
    controller; and, for the three, the collaborative task with limits under one disturbance at a time. The PID has no
    behaviours: what differs are the thresholds of the release. All points of a repetition share a seed. The quick plan
    is robot to human with limits.
    """

    name: ClassVar[str] = "flyer-controllers"
    title: ClassVar[str] = "other controllers of a free-flyer's gripper ([Fernandes2020] sec. 6.3)"
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return controllers x behaviours x tasks x propulsions, and the disturbances."""
        ways = [(c, b) for c in CONTROLLERS for b in Behaviour]
        usual = [(t, p, USUAL) for t in Task for p in PROPULSIONS]
        if quick:
            usual = [(Task.ROBOT_TO_HUMAN, Propulsion.LIMITED, USUAL)]
        disturbed = [] if quick else [(_DISTURBED, Propulsion.LIMITED, disturbance) for disturbance in DISTURBANCES]
        tried = [(*way, *case) for case in [*usual, *disturbed] for way in ways]
        tried += [(NO_THRUST, b, *case) for case in usual for b in Behaviour]
        points = [point(c, task, b, propulsion, what) for c, b, task, propulsion, what in tried]
        return CampaignPlan(
            scenario=self.scenario,
            points=points,
            repetitions=1 if quick else 2,
            seed=63,
            paired=True,
            varied_units=("impedance",),
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge, all beyond the thesis: that each controller hands over, and whether the person can tell them apart."""
        rows = ControllerRows(table)
        return [
            *[_hands_over(rows, c) for c in CONTROLLERS],
            _coasting(rows),
            *[_alike(rows, b, p) for p in PROPULSIONS for b in Behaviour],
            _late(rows),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return all cases, and the disturbances."""
        rows = ControllerRows(table)
        tables = [_table(f"With {p.item} thrust", rows, [(t, p, USUAL) for t in Task]) for p in PROPULSIONS]
        disturbed = [(_DISTURBED, Propulsion.LIMITED, what) for what in DISTURBANCES]
        return [t for t in (*tables, _table("Collaborative, disturbed", rows, disturbed)) if t.rows]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw displacement and force by controller."""
        return _draw(ControllerRows(table), folder)


class ControllerRows:
    """Rows of the campaign's table by what they are for, those of runs that did not come to their end as well."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows: Sequence[Row] = known_rows(table)

    def of(
        self, controller: str, task: Task, behaviour: Behaviour, propulsion: Propulsion, what: Variation = USUAL
    ) -> list[Row]:
        """Return the runs of a case."""
        wanted = point(controller, task, behaviour, propulsion, what)
        return [row for row in self._rows if has(row, wanted, _VARIED, _DEFAULT)]

    def mean(self, metric: str, rows: Sequence[Row]) -> float | None:
        """Return a metric's mean over those of some runs that have it; None if none has."""
        values = values_of(rows, metric)
        return float(values.mean()) if len(values) else None


def _hands_over(rows: ControllerRows, controller: str) -> Claim:
    found = [row for t in Task for b in Behaviour for p in PROPULSIONS for row in rows.of(controller, t, b, p)]
    claim = f"With the {CONTROLLERS[controller]} control every handover succeeds"
    telling = [t for t in Task if (of := _coasted(rows, t)) and not succeeded(of)]
    note = "No task is known to fail without thrust, so that success says nothing about the controller."
    if telling:
        note = f"Without thrust no run of {' and '.join(TASKS[t] for t in telling)} succeeds: these depend on control."
    return every_claim(claim, "", (0, 0), (succeeded(found), len(found)), f"{note} {unfinished_note(found)}".strip())


def _coasted(rows: ControllerRows, task: Task) -> list[Row]:
    """Return the runs of a task without thrust."""
    return [row for b in Behaviour for p in PROPULSIONS for row in rows.of(NO_THRUST, task, b, p)]


def _coasting(rows: ControllerRows) -> Claim:
    facts: dict[str, Any] = {
        "claim": "Without thrust while it yields, the robot ends no handover",
        "published": "",
        "beyond": True,
    }
    found = {t: _coasted(rows, t) for t in Task}
    tried = [row for rows_of in found.values() for row in rows_of]
    if not tried:
        return nothing_measured(**facts)
    each = ", ".join(f"{TASKS[t]} {succeeded(of)} of {len(of)}" for t, of in found.items() if of)
    enough = min(map(len, found.values())) >= _MIN_RUNS
    needed = "" if enough else f" Judged from {_MIN_RUNS} runs of each task on."
    return Claim(
        **facts,
        measured=f"{format_rate(succeeded(tried), len(tried))} succeeded",
        verdict=verdict_of(succeeded(tried) == 0, could_be_either=enough),
        reason=f"Holds if none succeeds. By task: {each}. Where a coasting robot succeeds, too, the successes of the "
        f"controllers say nothing about them.{needed} {unfinished_note(tried)}".strip(),
    )


def _alike(rows: ControllerRows, behaviour: Behaviour, propulsion: Propulsion) -> Claim:
    claim = (
        f"With {propulsion.item} thrust the controller hardly matters to how far the person takes the "
        f"{behaviour.item} robot"
    )
    facts: dict[str, Any] = {"claim": claim, "published": "", "beyond": True}
    ratios, texts, left_out, fewest = list[float](), list[str](), list[str](), math.inf
    for task in Task:
        found = [rows.of(c, task, behaviour, propulsion) for c in CONTROLLERS]
        means = [m for of in found if (m := rows.mean("transfer_displacement", of)) is not None]
        if len(means) < len(CONTROLLERS):
            left_out.append(TASKS[task])
            continue
        ratios.append(max(means) / min(means))
        texts.append(f"{TASKS[task]} {', '.join(f'{1e3 * m:.0f}' for m in means)} mm")
        fewest = min(fewest, *(len(values_of(of, "transfer_displacement")) for of in found))
    if not ratios:
        return nothing_measured(**facts)
    enough = fewest >= _MIN_RUNS and not left_out
    needed = f" Judged by all four, from {_MIN_RUNS} runs of each controller on." if not enough else ""
    return Claim(
        **facts,
        measured="; ".join(texts),
        verdict=verdict_of(max(ratios) <= 1.0 + _SIMILAR, could_be_either=enough),
        reason=f"Holds if in each handover the largest mean displacement, of {', '.join(CONTROLLERS.values())}, "
        f"is at most {100 * _SIMILAR:.0f} % above the smallest; it is up to {100 * (max(ratios) - 1):.0f} %.{needed}",
    )


def _late(rows: ControllerRows) -> Claim:
    case = _DISTURBED, Propulsion.LIMITED, DISTURBANCES[0]
    found = {(c, b): rows.of(c, case[0], b, case[1], case[2]) for c in CONTROLLERS for b in Behaviour}
    tried = [row for rows_of in found.values() for row in rows_of]
    limited = ", ".join(
        f"{name} {100 * share:.0f} %"
        for c, name in CONTROLLERS.items()
        if (share := rows.mean("saturated_share", found[c, Behaviour.RIGID])) is not None
    )
    delay = float(DISTURBANCES[0].parameters["delay"])
    radius = linear_loop(Behaviour.RIGID, float(ThrustersParams().lag), delay).pole_radius
    note = (
        f"With this delay the rigid impedance loop has its largest pole at |z| = {radius:.3f}, so given it the "
        "controller does not start; where it is not given, limits of thrust keep a growing oscillation small. Share of "
        "the run for which more was commanded than the rigid robot's thrusters give: "
        f"{limited or 'not known'}; admittance and PID control clip their own commands. {unfinished_note(tried)}"
    )
    claim = f"With a {DISTURBANCES[0].label}, all controllers still hand over"
    return every_claim(claim, "", (0, 0), (succeeded(tried), len(tried)), note.strip())


def _table(title: str, rows: ControllerRows, cases: Sequence[tuple[Task, Propulsion, Variation]]) -> ComparisonTable:
    cells: list[list[str]] = []
    for task, propulsion, what in cases:
        for behaviour in Behaviour:
            found = [rows.of(c, task, behaviour, propulsion, what) for c in (*CONTROLLERS, NO_THRUST)]
            if any(found):
                cells.append([what.label or TASKS[task], behaviour.item, *[_cell(rows, of) for of in found]])
    return ComparisonTable(
        title=title,
        header=["handover", "behaviour", *CONTROLLERS.values(), NO_THRUST],
        rows=cells,
        note="Successes of runs, and means: how far the gripper went at most from the signal for as long as the robot "
        "yielded, which is on after the object has left; the greatest force on the hand until the first receiver has "
        "the object, and the time from the signal until then. No thrust: while it yields the robot coasts, "
        "as the admittance control may command nothing; it flies as ever.",
    )


def _cell(rows: ControllerRows, found: Sequence[Row]) -> str:
    if not any(map(is_done, found)):
        return "did not end" if found else ""
    figures = [rows.mean(f"transfer_{name}", found) for name in ("displacement", "force", "time")]
    texts = (
        f"{scale * x:.{digits}f} {unit}"
        for x, (scale, digits, unit) in zip(figures, ((1e3, 0, "mm"), (1, 1, "N"), (1, 1, "s")), strict=True)
        if x is not None
    )
    return f"{succeeded(found)}/{len(found)}: " + ", ".join(texts)


_DRAWN = (Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT)
_SHOWN = (("displacement", "displacement (mm)", 1e3), ("force", "force on the hand (N)", 1.0))


def _draw(rows: ControllerRows, folder: Path) -> list[Figure]:
    """Draw displacement and force by controller, task, behaviour and propulsion; nothing where a task has no runs."""
    if not all(rows.of(c, t, Behaviour.RIGID, Propulsion.IDEAL) for c in CONTROLLERS for t in _DRAWN):
        return []
    with figure(folder / "controllers", 2, 2, size=(9.0, 5.6)) as panels:
        for k, (metric, label, scale) in enumerate(_SHOWN):
            for axis, propulsion in zip(panels[2 * k : 2 * k + 2], PROPULSIONS, strict=True):
                _draw_panel(axis, rows, propulsion, f"transfer_{metric}", scale)
                axis.set(ylabel=label, ylim=(0.0, None), title=f"{propulsion.item} thrust" if k == 0 else "")
        legend_below(panels[0])
    caption = (
        "How far the gripper goes at most while the robot yields, and the greatest force on the hand in a transfer, by "
        "what takes the place of the impedance control; means of the runs, ideal thrust on the left, Astrobee's limits "
        "on the right."
    )
    return [Figure("controllers", caption)]


def _draw_panel(axis: Axes, rows: ControllerRows, propulsion: Propulsion, metric: str, scale: float) -> None:
    cases = [(task, behaviour) for task in _DRAWN for behaviour in Behaviour]
    for i, (controller, name) in enumerate(CONTROLLERS.items()):
        means = [rows.mean(metric, rows.of(controller, task, b, propulsion)) for task, b in cases]
        places = [n + 0.27 * (i - 1) for n, mean in enumerate(means) if mean is not None]
        heights = [scale * mean for mean in means if mean is not None]
        axis.bar(places, heights, width=0.25, color=COLOURS[i], label=name)
    labels = [f"{TASKS[task]}\n{behaviour.item}" for task, behaviour in cases]
    axis.set_xticks(range(len(cases)), labels, fontsize=7)
