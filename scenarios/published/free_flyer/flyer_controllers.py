"""Other controllers in the place of the impedance control, as [Fernandes2020] sec. 6.3 proposes, in all handovers."""

import math
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from typing import ClassVar

from handover.plants.free_flyer.robot.thrusters import Params as ThrustersParams
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Bars, Panel, drawn
from handover.scenarios.published.free_flyer.handovers import (
    TASKS,
    USUAL,
    Variation,
    every_of,
    factor_of,
    noise_times,
    unfinished_note,
)
from handover.scenarios.published.free_flyer.linear_model import linear_loop
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Point, Runs, is_done, is_known
from handover.scenarios.published.tables import table_of
from handover.scenarios.published.verdicts import every_claim, format_rate
from handover.scenarios.robots.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Propulsion, Task
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.table import CampaignTable

CONTROLLERS = {"ImpedanceController": "impedance", "AdmittanceController": "admittance", "PoseController": "PID"}
"""What takes the place, and its name in words."""
NO_THRUST = "no thrust"
"""What all are measured against: while it yields, the robot coasts."""
_LIMITS = ("impedance.f_max", "impedance.tau_max")
"""Of those that clip their own commands: none for ideal thrust; without thrust, admittance control may command none."""
DISTURBANCES = (
    Variation("delay of 32 ms, unknown to them", {"delay": "0.032", "impedance.delay": "0"}),
    noise_times(3.0),
    factor_of("mass", "mass_factor", 0.7),
    factor_of("mass", "mass_factor", 1.3),
)
"""One at a time. The controllers know neither the delay nor the mass: with the delay known, the rigid impedance control
rejects it, for its loop is then not stable, and there would be no run to look at."""
PROPULSIONS = (Propulsion.IDEAL, Propulsion.LIMITED)
"""Without and with limits of each axis."""
_SIMILAR = 0.2
"""Part of a displacement by which two controllers' may differ and count as like."""
_MIN_RUNS = 2
"""Runs of a case by which controllers are compared."""

Case = tuple[Task, Propulsion, Variation]
_USUAL: Sequence[Case] = [(task, propulsion, USUAL) for task in Task for propulsion in PROPULSIONS]
_DISTURBED: Sequence[Case] = [(Task.COLLABORATIVE, Propulsion.LIMITED, what) for what in DISTURBANCES]
_DRAWN = [*product((Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT), Behaviour)]


def point(controller: str, behaviour: Behaviour, case: Case) -> Point:
    """Return a point of the plan."""
    task, propulsion, what = case
    free = propulsion is Propulsion.IDEAL and controller != "ImpedanceController"
    most = "0,0,0" if controller == NO_THRUST else "100,100,100" if free else ""
    return {
        "impedance": "AdmittanceController" if controller == NO_THRUST else controller,
        "task": task.item,
        "behaviour": behaviour.item,
        "propulsion": propulsion.item,
        **(dict.fromkeys(_LIMITS, most) if most else {}),
        **what.parameters,
    }


class FlyerControllers(PublishedExperiment):
    """Impedance, admittance and Astrobee's PID, rigid and compliant, in the four handovers, with limits and without.

    Beside them stands a robot without any thrust while it yields: handovers that it does as well say nothing of a
    controller. The three also do the collaborative task with limits under one disturbance at a time. The PID has no
    behaviours: what differs are the thresholds of the release. All points of a repetition share a seed. The quick plan
    is robot to human with limits.
    """

    name: ClassVar[str] = "flyer-controllers"
    title: ClassVar[str] = "other controllers of a free-flyer's gripper ([Fernandes2020] sec. 6.3)"
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return controllers x behaviours x tasks x propulsions, and the disturbances."""
        usual = [(Task.ROBOT_TO_HUMAN, Propulsion.LIMITED, USUAL)] if quick else _USUAL
        cases = usual if quick else [*usual, *_DISTURBED]
        points = [point(c, b, case) for case, c, b in product(cases, CONTROLLERS, Behaviour)]
        points += [point(NO_THRUST, b, case) for case, b in product(usual, Behaviour)]
        repetitions = 1 if quick else 2
        return self.campaign(points, repetitions=repetitions, seed=63, paired=True, varied_units=("impedance",))

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge, all beyond the thesis: that each controller hands over, and whether the person can tell them apart."""
        runs = self.runs(table, is_known)
        coasted = {task: _of(runs, NO_THRUST, [c for c in _USUAL if c[0] is task]) for task in Task}
        return [
            *(_hands_over(runs, c, coasted) for c in CONTROLLERS),
            _coasting(coasted),
            *(_alike(runs, b, p) for p in PROPULSIONS for b in Behaviour),
            _late(runs),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return all cases, and the disturbances."""
        runs = self.runs(table, is_known)
        cases = {f"With {p.item} thrust": [c for c in _USUAL if c[1] is p] for p in PROPULSIONS}
        tables = [_table(title, runs, of) for title, of in {**cases, "Collaborative, disturbed": _DISTURBED}.items()]
        return [t for t in tables if t.rows]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw displacement and force by controller; nothing where a task has no runs."""
        found = self.runs(table, is_known)
        rigid = [(t, Propulsion.IDEAL, USUAL) for t, b in _DRAWN if b is Behaviour.RIGID]
        if not all(len(found.of(point(c, Behaviour.RIGID, case))) for c, case in product(CONTROLLERS, rigid)):
            return []
        shown = (("displacement", "displacement (mm)", 1e3), ("force", "force on the hand (N)", 1.0))
        panels = [_panel(found, p, *what) for what in shown for p in PROPULSIONS]
        caption = (
            "How far the gripper goes at most while the robot yields, and the greatest force on the hand in a "
            "transfer. Bars are means of the runs with each of the controllers."
        )
        return drawn(folder / "controllers", caption, panels, 2, size=(9.0, 5.6))


def _of(runs: Runs, controller: str, cases: Sequence[Case]) -> Runs:
    return runs.of(*(point(controller, b, case) for case in cases for b in Behaviour))


def _mean(runs: Runs, metric: str) -> float | None:
    values = runs.metric(metric)
    return float(values.mean()) if len(values) else None


def _hands_over(runs: Runs, controller: str, coasted: dict[Task, Runs]) -> Claim:
    found = _of(runs, controller, _USUAL)
    telling = [TASKS[t] for t, of in coasted.items() if len(of) and not of.count[0]]
    note = "No task is known to fail without thrust, so that success says nothing about the controller."
    if telling:
        note = f"Without thrust no run of {' and '.join(telling)} succeeds: these depend on control."
    claim = f"With the {CONTROLLERS[controller]} control every handover succeeds"
    return every_claim(claim, "", (0, 0), found.count, f"{note} {unfinished_note(found)}".strip())


def _coasting(found: dict[Task, Runs]) -> Claim:
    says, tried = Statement("Without thrust while it yields, the robot ends no handover"), every_of([*found.values()])
    if not len(tried):
        return says.unknown()
    each = ", ".join(f"{TASKS[t]} {of.count[0]} of {len(of)}" for t, of in found.items() if len(of))
    return says.judged(
        f"{format_rate(*tried.count)} succeeded",
        tried.count[0] == 0,
        "none succeeds",
        f"By task: {each}. Where a coasting robot succeeds, too, successes of the controllers say nothing about them. "
        f"{unfinished_note(tried)}",
        runs=(min(map(len, found.values())), _MIN_RUNS),
    )


def _alike(runs: Runs, behaviour: Behaviour, propulsion: Propulsion) -> Claim:
    says = Statement(
        f"With {propulsion.item} thrust the controller hardly matters to how far the person takes the {behaviour.item} "
        "robot"
    )
    ratios, texts, fewest = list[float](), list[str](), math.inf
    for task in Task:
        found = [runs.of(point(c, behaviour, (task, propulsion, USUAL))) for c in CONTROLLERS]
        means = [m for of in found if (m := _mean(of, "transfer_displacement")) is not None]
        if len(means) == len(CONTROLLERS):
            ratios.append(max(means) / min(means))
            texts.append(f"{TASKS[task]} {', '.join(f'{1e3 * m:.0f}' for m in means)} mm")
            fewest = min(fewest, *(len(of.metric("transfer_displacement")) for of in found))
    if not ratios:
        return says.unknown()
    return says.judged(
        "; ".join(texts),
        max(ratios) <= 1.0 + _SIMILAR,
        f"in each of the four handovers the largest mean displacement of {', '.join(CONTROLLERS.values())} is at most "
        f"{100 * _SIMILAR:.0f} % above the smallest. It takes {_MIN_RUNS} runs of each controller",
        f"It is up to {100 * (max(ratios) - 1):.0f} %.",
        enough=fewest >= _MIN_RUNS and len(ratios) == len(Task),
    )


def _late(runs: Runs) -> Claim:
    late = _DISTURBED[:1]
    found = {c: _of(runs, c, late) for c in CONTROLLERS}
    tried = every_of([*found.values()])
    rigid = {name: runs.of(point(c, Behaviour.RIGID, late[0])) for c, name in CONTROLLERS.items()}
    shares = {name: _mean(of, "saturated_share") for name, of in rigid.items()}
    limited = ", ".join(f"{name} {100 * share:.0f} %" for name, share in shares.items() if share is not None)
    delay = float(DISTURBANCES[0].parameters["delay"])
    radius = linear_loop(Behaviour.RIGID, float(ThrustersParams().lag), delay).pole_radius
    note = (
        f"With this delay the rigid impedance loop has its largest pole at |z| = {radius:.3f}; limits of thrust keep "
        f"a growing oscillation small, with more commanded than they give for {limited or 'an unknown part'} of the "
        f"run. {unfinished_note(tried)}"
    )
    return every_claim(f"With a {DISTURBANCES[0].label}, all controllers still hand over", "", (0, 0), tried.count,
                       note.strip())  # fmt: skip


def _table(title: str, runs: Runs, cases: Sequence[Case]) -> ComparisonTable:
    rows: list[dict[str, str]] = []
    for case, b in product(cases, Behaviour):
        found = {name: runs.of(point(c, b, case)) for c, name in {**CONTROLLERS, NO_THRUST: NO_THRUST}.items()}
        if any(map(len, found.values())):
            cells = {name: _cell(of) for name, of in found.items()}
            rows.append({"handover": case[2].label or TASKS[case[0]], "behaviour": b.item, **cells})
    note = (
        "Successes of runs, and three means. Displacement: how far the gripper went at most from the signal on, for as "
        "long as the robot yielded. Force: the greatest on the hand until the first receiver has the object. Time: "
        "until then. No thrust: while it yields the robot coasts; else it flies as usual."
    )
    return table_of(title, rows, note)


def _cell(runs: Runs) -> str:
    if not any(map(is_done, runs)):
        return "did not end" if len(runs) else ""
    figures = [_mean(runs, f"transfer_{name}") for name in ("displacement", "force", "time")]
    units = ((1e3, 0, "mm"), (1, 1, "N"), (1, 1, "s"))
    texts = (f"{k * x:.{digits}f} {unit}" for x, (k, digits, unit) in zip(figures, units, strict=True) if x is not None)
    return f"{runs.count[0]}/{len(runs)}: " + ", ".join(texts)


def _panel(runs: Runs, propulsion: Propulsion, metric: str, label: str, scale: float) -> Panel:
    bars: list[Bars] = []
    for i, (controller, name) in enumerate(CONTROLLERS.items()):
        means = [_mean(runs.of(point(controller, b, (t, propulsion, USUAL))), f"transfer_{metric}") for t, b in _DRAWN]
        found = [(n + 0.27 * (i - 1), scale * mean) for n, mean in enumerate(means) if mean is not None]
        bars.append(Bars(found, 0.25, COLOURS[i], name))
    ticks = {float(n): f"{TASKS[t]}\n{b.item}" for n, (t, b) in enumerate(_DRAWN)}
    return Panel(bars, {"title": f"{propulsion.item} thrust", "ylabel": label, "ylim": (0.0, None)}, ticks, small=True)
