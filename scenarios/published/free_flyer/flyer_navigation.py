"""What errors of the free-flyer's navigation do to its handovers, one at a time (beyond [Fernandes2020])."""

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.lines import Line2D

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.free_flyer.parameters import Behaviour, Task
from handover.scenarios.published.free_flyer.flyer_navigation_claims import claims_of_navigation
from handover.scenarios.published.free_flyer.navigation_runs import (
    DRIFT_TIME,
    ESTIMATE_ERRORS,
    TRIED,
    VARIATIONS,
    EstimateError,
    NavigationRuns,
    point_of,
    signalled,
)
from handover.scenarios.published.free_flyer.variations import (
    PATIENCE,
    TASKS,
    USUAL,
    Row,
    Variation,
    acted_alone,
    changed_hands,
    is_done,
    succeeded_touched,
    values_of,
)
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import format_interval

_REPETITIONS = 3
_STROKES = {Task.ROBOT_TO_HUMAN: "-", Task.HUMAN_TO_ROBOT: "--"}
_DRAWN = (
    ("success", "succeeded (%)", 100.0),
    ("transfer_displacement", "gripper went (mm)", 1e3),
    ("transfer_time", "time (s)", 1.0),
)


class FlyerNavigation(PublishedExperiment):
    """Both behaviours give and receive with a navigation that is biased, drifts, or comes seldom or late.

    One error at a time, at three or four levels up to where handovers fail, three runs each; every run draws its own
    bias. The controllers know nothing of it: a delay that they knew would be refused where their loop is not
    stable. The thesis says nothing of its navigation's errors. The quick plan is the greatest level of each, once.
    """

    name: ClassVar[str] = "flyer-navigation"
    title: ClassVar[str] = "a free-flyer with errors in its navigation hands over (beyond [Fernandes2020] sec. 4.1.2)"
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return errors x levels x tasks x behaviours; if quick, the greatest level of each, of the rigid robot."""
        worst = [error.variation(error.levels[-1]) for error in ESTIMATE_ERRORS]
        behaviours = [Behaviour.RIGID] if quick else list(Behaviour)
        return CampaignPlan(
            scenario=self.scenario,
            points=[
                point_of(task, behaviour, variation)
                for variation in (USUAL, *(worst if quick else VARIATIONS))
                for task in TRIED
                for behaviour in behaviours
            ],
            fixed={"patience": PATIENCE},
            repetitions=1 if quick else _REPETITIONS,
            seed=412,
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge, beyond the thesis, where models of gate and loop say what is to come out."""
        return claims_of_navigation(NavigationRuns(table))

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return successes, false releases, displacement and time by error and level."""
        rows = [_cells(NavigationRuns(table), v) for v in (Variation("as usual"), *VARIATIONS)]
        note = (
            "Successes of runs with their interval (Clopper-Pearson), of both behaviours, where a run in which the "
            "robot acted alone, let go or closed with nobody at the gripper, is none; in how many the object changed "
            "hands, even if the robot then never came to rest where it retreats to; in how many it found rest and "
            "signalled, and acted alone; medians, without the runs in which it acted alone, of how far the gripper "
            "went at most while the robot yielded, and of the time from the signal until the receiver had the object, "
            f"giving and receiving; and what decided most failures. Drifts have a correlation time of {DRIFT_TIME:g} s."
        )
        header = [
            "navigation",
            *(f"{TASKS[task]}" for task in TRIED),
            "changed hands",
            "signalled",
            "acted alone",
            "displacement, mm",
            "time, s",
            "fails mostly by",
        ]
        shown = [row for row in rows if row]
        return (
            [ComparisonTable(title="Errors of the navigation", header=header, rows=shown, note=note)] if shown else []
        )

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw success, displacement and time by level, a panel for each error."""
        found = NavigationRuns(table)
        return [figure for metric, label, scale in _DRAWN for figure in _draw(found, metric, label, scale, folder)]


def _cells(runs: NavigationRuns, variation: Variation) -> list[str]:
    """Return a row of the table; [] without runs."""
    by_task = [runs.all_of(variation, (task,)) for task in TRIED]
    rows = [row for rows_of in by_task for row in rows_of]
    if not rows:
        return []
    decided = [Cause(int(row["decided_by"])) for row in rows if is_done(row) and not row["success"]]
    cause = max(set(decided), key=lambda c: (decided.count(c), -c)).words if decided else ""
    return [
        variation.label,
        *map(_share, by_task),
        f"{changed_hands(rows)} of {len(rows)}",
        f"{signalled(rows)} of {len(rows)}",
        str(acted_alone(rows)),
        _medians(by_task, "transfer_displacement", 1e3, 0),
        _medians(by_task, "transfer_time", 1.0, 1),
        cause,
    ]


def _share(rows: Sequence[Row]) -> str:
    if not rows:
        return ""
    count = succeeded_touched(rows)
    interval = success_interval(count, len(rows))
    return f"{count} of {len(rows)} ({format_interval(interval.low, interval.high)})"


def _medians(by_task: Sequence[Sequence[Row]], metric: str, scale: float, digits: int) -> str:
    found = [scale * values_of(_touched(rows), metric) for rows in by_task]
    if not any(len(x) for x in found):
        return "–"
    return " and ".join(f"{np.median(x):.{digits}f}" if len(x) else "none" for x in found)


def _touched(rows: Sequence[Row]) -> list[Row]:
    """Return the runs in which the robot did not act alone."""
    return [row for row in rows if not acted_alone([row])]


def _draw(runs: NavigationRuns, metric: str, label: str, scale: float, folder: Path) -> list[Figure]:
    """Draw a metric's mean, or share of successes, by level of each error."""
    shown = [error for error in ESTIMATE_ERRORS if sum(bool(runs.all_of(error.variation(x))) for x in error.levels) > 1]
    if not shown:
        return []
    name = f"navigation_{metric.removeprefix('transfer_')}"
    rows = (len(shown) + 3) // 4
    with figure(folder / name, rows, 4, size=(10.0, 0.7 + 2.3 * rows)) as panels:
        for axes, error in zip(panels, shown, strict=False):
            highest = 0.0
            for k, (task, behaviour) in enumerate((t, b) for t in TRIED for b in Behaviour):
                points = _points(runs, error, task, behaviour, metric)
                aside = 1.03 ** (2 * k - 3)
                x, y = ([aside * error.scale * p for p, _ in points], [scale * q for _, q in points])
                axes.plot(x, y, _STROKES[task], marker="o", ms=3.5, lw=1.2, color=COLOURS[int(behaviour)])
                highest = max([highest, *(value for value in y if value == value)])
            top = 100.0 if metric == "success" else max(highest, 1e-9)
            ticks = [error.scale * level for level in error.levels]
            axes.set(xlabel=f"{error.label} ({error.unit})", xscale="log", ylim=(-0.04 * top, 1.08 * top))
            axes.set_xlim(min(ticks) / 1.3, 1.3 * max(ticks))
            axes.set_xticks(ticks, [f"{tick:.3g}" for tick in ticks])
            axes.minorticks_off()
            if error.parameter == "update_rate":
                axes.invert_xaxis()
        for axes in panels[::4]:
            axes.set_ylabel(label)
        for axes in panels[len(shown) :]:
            axes.set_visible(False)
        entries = {
            f"{TASKS[task]}, {b.item}": Line2D([], [], color=COLOURS[int(b)], ls=_STROKES[task], marker="o", ms=3.5)
            for task in TRIED
            for b in Behaviour
        }
        legend_below(panels[0], entries)
    what = {
        "success": "Share of handovers that succeed",
        "transfer_displacement": "How far the gripper goes at most while the robot yields (means)",
        "transfer_time": "Time from the signal until the receiver has the object (means)",
    }[metric]
    return [
        Figure(
            name,
            f"{what}, by errors of the navigation, one at a time; biases and drifts are deviations; "
            "each point is of a few runs.",
        )
    ]


def _points(
    runs: NavigationRuns, error: EstimateError, task: Task, behaviour: Behaviour, metric: str
) -> list[tuple[float, float]]:
    """Return levels and the metric's means over the runs that have it, NaN where none has; of success, over all.

    Runs in which the robot acted alone have no part in the means, and are no success.
    """
    points: list[tuple[float, float]] = []
    for level in error.levels:
        rows = runs.of(task, behaviour, error.variation(level))
        if metric == "success":
            values = np.array([float(succeeded_touched([row])) for row in rows])
        else:
            values = values_of(_touched(rows), metric)
        points.append((level, float(values.mean()) if len(values) else np.nan))
    return points
