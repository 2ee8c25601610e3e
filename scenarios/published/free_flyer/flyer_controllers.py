"""Other controllers in the place of the impedance control, as [Fernandes2020] sec. 6.3 proposes, in all handovers."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.handovers import HandoverOfTask
from handover.scenarios.free_flyer.parameters import Behaviour, Propulsion, Task, TaskParameters
from handover.scenarios.published.free_flyer.handover_runs import TASKS, USUAL, Variation
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment, Verdict
from handover.scenarios.published.verdicts import every_claim, nothing_measured

CONTROLLERS = {"ImpedanceController": "impedance", "AdmittanceController": "admittance", "PoseController": "PID"}
"""What takes the place, and its name in words."""
_WITHOUT_LIMITS = {"impedance.f_max": "100,100,100", "impedance.tau_max": "100,100,100"}
"""Parameters of those that clip their own commands, for ideal thrust."""
_NOISE = {
    f"navigation.{what}_noise": f"{3.0 * float(paper_values('free_flyer', 'navigation')[f'{what}_noise']):g}"
    for what in ("position", "attitude", "velocity", "rate")
}
DISTURBANCES = (
    Variation("delay of 32 ms", {"delay": "0.032"}),
    Variation("noise times 3", _NOISE),
    Variation("mass -30 %", {"mass_factor": "0.7"}),
    Variation("mass +30 %", {"mass_factor": "1.3"}),
)
"""One at a time; the controllers know the delay, and not the mass."""
_VARIED = tuple(dict.fromkeys(name for v in DISTURBANCES for name in v.parameters))
PROPULSIONS = (Propulsion.IDEAL, Propulsion.LIMITED)
"""Without and with limits of each axis."""
_DEFAULT = TaskParameters()
_SIMILAR = 0.2
"""Part of a displacement by which two controllers' may differ and count as like, where thrust has limits."""


def point(controller: str, task: Task, behaviour: Behaviour, propulsion: Propulsion, what: Variation) -> dict[str, str]:
    """Return a point of the plan."""
    free = propulsion is Propulsion.IDEAL and controller != "ImpedanceController"
    return {
        "impedance": controller,
        "task": task.item,
        "behaviour": behaviour.item,
        "propulsion": propulsion.item,
        **(_WITHOUT_LIMITS if free else {}),
        **what.parameters,
    }


class FlyerControllers(PublishedExperiment):
    """Impedance, admittance and Astrobee's PID, rigid and compliant, in the four handovers, with limits and without.

    Besides, robot to human with its limits under one disturbance at a time. The PID has no behaviours: what differs are
    the thresholds of the release. All points of a repetition share a seed. The quick plan is robot to human with
    limits.
    """

    name: ClassVar[str] = "flyer-controllers"
    title: ClassVar[str] = "other controllers of a free-flyer's gripper ([Fernandes2020] sec. 6.3)"
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return controllers x behaviours x tasks x propulsions, and the disturbances."""
        ways = [(c, b) for c in CONTROLLERS for b in Behaviour]
        given = Task.ROBOT_TO_HUMAN
        cases = [(t, p, USUAL) for t in Task for p in PROPULSIONS] + [
            (given, Propulsion.LIMITED, disturbance) for disturbance in DISTURBANCES
        ]
        if quick:
            cases = [(given, Propulsion.LIMITED, USUAL)]
        points = [point(c, task, b, propulsion, what) for task, propulsion, what in cases for c, b in ways]
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
        return [*[_hands_over(rows, c) for c in CONTROLLERS], *[_alike(rows, p) for p in PROPULSIONS], _late(rows)]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return all cases, and the disturbances."""
        rows = ControllerRows(table)
        tables = [_table(f"With {p.item} thrust", rows, [(t, p, USUAL) for t in Task]) for p in PROPULSIONS]
        disturbed = [(Task.ROBOT_TO_HUMAN, Propulsion.LIMITED, what) for what in DISTURBANCES]
        return [t for t in (*tables, _table("Robot to human, disturbed", rows, disturbed)) if t.rows]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw displacement and force by controller."""
        from handover.scenarios.published.free_flyer.flyer_controllers_figure import draw_controllers

        return draw_controllers(ControllerRows(table), folder)


class ControllerRows:
    """Rows of the campaign's table, by what they are for."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows = list(table.rows)

    def of(
        self, controller: str, task: Task, behaviour: Behaviour, propulsion: Propulsion, what: Variation = USUAL
    ) -> list[Mapping[str, Any]]:
        """Return the runs of a case, those that did not start as well."""
        wanted: dict[str, Any] = {
            "impedance": controller,
            "task": task.item,
            "behaviour": behaviour.item,
            "propulsion": propulsion.item,
        }
        return [
            row
            for row in self._rows
            if all(row[name] == x for name, x in wanted.items())
            and all(_is(name, row.get(name), what.parameters.get(name)) for name in _VARIED)
        ]

    def mean(self, metric: str, rows: Sequence[Mapping[str, Any]]) -> float | None:
        """Return a metric's mean over those of some runs that have it; None if none has."""
        values = [float(x) for row in rows if (x := row.get(metric)) is not None and x == x]
        return sum(values) / len(values) if values else None


def succeeded(rows: Sequence[Mapping[str, Any]]) -> int:
    """Return how many of some runs succeeded."""
    return sum(row["status"] == "done" and bool(row["success"]) for row in rows)


def _is(name: str, value: Any, wanted: str | None) -> bool:
    """Return whether a row has a disturbance's value of a parameter, or, for None, its default."""
    if value is None or value != value:
        return wanted is None
    return float(value) == (getattr(_DEFAULT, name, None) if wanted is None else float(wanted))


def _hands_over(rows: ControllerRows, controller: str) -> Claim:
    found = [row for t in Task for b in Behaviour for p in PROPULSIONS for row in rows.of(controller, t, b, p)]
    claim = f"With the {CONTROLLERS[controller]} control every handover succeeds"
    return every_claim(claim, "", (0, 0), (succeeded(found), len(found)))


def _alike(rows: ControllerRows, propulsion: Propulsion) -> Claim:
    claim = f"With {propulsion.item} thrust the controller hardly matters to how far a pull takes the rigid robot"
    facts: dict[str, Any] = {"claim": claim, "published": "", "beyond": True}
    task, means = Task.ROBOT_TO_HUMAN, list[float]()
    for controller in CONTROLLERS:
        found = rows.of(controller, task, Behaviour.RIGID, propulsion)
        if (mean := rows.mean("transfer_displacement", found)) is not None:
            means.append(mean)
    if len(means) < len(CONTROLLERS):
        return nothing_measured(**facts)
    return Claim(
        **facts,
        measured=", ".join(f"{1e3 * m:.0f} mm" for m in means),
        verdict=Verdict.REPRODUCED if max(means) <= (1.0 + _SIMILAR) * min(means) else Verdict.NOT_REPRODUCED,
        reason=f"Holds if the largest mean displacement, of {', '.join(CONTROLLERS.values())}, is at most "
        f"{100 * _SIMILAR:.0f} % above the smallest.",
    )


def _late(rows: ControllerRows) -> Claim:
    facts: dict[str, Any] = {
        "claim": "A delay that the rigid impedance control cannot bear is borne by the admittance control",
        "published": "",
        "beyond": True,
    }
    late = DISTURBANCES[0]
    impedance, admittance = (
        rows.of(c, Task.ROBOT_TO_HUMAN, Behaviour.RIGID, Propulsion.LIMITED, late) for c in list(CONTROLLERS)[:2]
    )
    if not impedance or not admittance:
        return nothing_measured(**facts)
    refused = sum(row["status"] != "done" for row in impedance)
    held = refused == len(impedance) and succeeded(admittance) == len(admittance)
    return Claim(
        **facts,
        measured=f"impedance refused in {refused} of {len(impedance)}, admittance succeeded in "
        f"{succeeded(admittance)} of {len(admittance)}",
        verdict=Verdict.REPRODUCED if held else Verdict.NOT_REPRODUCED,
        reason=f"Holds if, with a {late.label} that both know, the one does not start in any run, since its loop is "
        "not stable, and the other succeeds in all.",
    )


def _table(title: str, rows: ControllerRows, cases: Sequence[tuple[Task, Propulsion, Variation]]) -> ComparisonTable:
    cells: list[list[str]] = []
    for task, propulsion, what in cases:
        for behaviour in Behaviour:
            found = [rows.of(c, task, behaviour, propulsion, what) for c in CONTROLLERS]
            if any(found):
                cells.append([what.label or TASKS[task], behaviour.item, *[_cell(rows, of) for of in found]])
    return ComparisonTable(
        title=title,
        header=["handover", "behaviour", *CONTROLLERS.values()],
        rows=cells,
        note="Successes of runs; means of the gripper's displacement until the first receiver has the object, the "
        "greatest force on the hand, and the time from the signal until then.",
    )


def _cell(rows: ControllerRows, found: Sequence[Mapping[str, Any]]) -> str:
    if not any(row["status"] == "done" for row in found):
        return "refused" if found else ""
    figures = [rows.mean(f"transfer_{name}", found) for name in ("displacement", "force", "time")]
    texts = (
        f"{scale * x:.{digits}f} {unit}"
        for x, (scale, digits, unit) in zip(figures, ((1e3, 0, "mm"), (1, 1, "N"), (1, 1, "s")), strict=True)
        if x is not None
    )
    return f"{succeeded(found)}/{len(found)}: " + ", ".join(texts)
