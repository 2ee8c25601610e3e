"""Tables I and II of Luberto et al. beside ours, with exact tests and how the hand came to close."""

from collections import Counter

import numpy as np

from handover.controllers.ir_grasp.ir_reflex import Stop
from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.campaign.statistics import LEVEL, paired_test, success_interval, two_proportions
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.ir_grasp.plots import FINGER_NAMES
from handover.scenarios.published.ir_grasp.ir_table_runs import (
    ARMS,
    BLIND,
    FORWARD_35,
    FORWARD_55,
    OBJECTS,
    POSES,
    REFLEX,
    Count,
    IrTableRuns,
)
from handover.scenarios.published.published_experiment import ComparisonTable
from handover.scenarios.published.verdicts import format_interval, format_median, format_p_value, format_share

_TITLES = {
    Thing.CYLINDER: "cylinder",
    Thing.BABY_CUP_A: "baby cup, pose (a)",
    Thing.BABY_CUP_B: "baby cup, pose (b)",
    Thing.PAPER_BOX_A: "paper box, pose (a)",
    Thing.PAPER_BOX_B: "paper box, pose (b)",
}


def tables_of(runs: IrTableRuns) -> list[ComparisonTable]:
    """Return successes by pose, exact tests, how grasps came to close, and distances."""
    return [*(_successes(runs, p) for p in POSES), _tests(runs), _closing(runs), *(_distances(runs, p) for p in POSES)]


def _successes(runs: IrTableRuns, perturbed: bool) -> ComparisonTable:
    header = ["object"]
    for arm in ARMS:
        header += (
            [f"{arm.title}, published", f"{arm.title}, ours"] if arm.column is not None else [f"{arm.title}, ours"]
        )
    rows = [[title, *_cells(runs, perturbed, thing)] for thing, title in _TITLES.items()]
    note = (
        "Intervals by Clopper and Pearson, 95 %; all runs of an arm count in the total. A star: Fisher's exact test "
        f"rejects equality at {format_share(LEVEL)}, of each cell by itself. The forward arms are a control that "
        "the paper does not have."
    )
    ours, theirs = runs.count(REFLEX, perturbed), runs.published(REFLEX, perturbed)
    if theirs is not None and ours[0] * theirs[1] > theirs[0] * ours[1]:
        note += " That our IR-guided hand succeeds more often indicates an easier task."
    if runs.not_done:
        note += f" {runs.not_done} runs did not come to their end and do not count."
    return ComparisonTable(
        title=f"Table I, {POSES[perturbed]} poses: successful grasps",
        header=header,
        rows=[*rows, ["total", *_cells(runs, perturbed, None)]],
        note=note,
    )


def _cells(runs: IrTableRuns, perturbed: bool, thing: Thing | None) -> list[str]:
    cells: list[str] = []
    for arm in ARMS:
        ours, theirs = runs.count(arm, perturbed, thing), runs.published(arm, perturbed, thing)
        cell = _with_interval(ours) if thing is None else _format_count(ours)
        if theirs is not None:
            apart = ours[1] and two_proportions(*ours, *theirs) < LEVEL
            cells.append(_with_interval(theirs) if thing is None else _format_count(theirs))
            cell += " *" if apart else ""
        cells.append(cell)
    return cells


def _format_count(count: Count) -> str:
    return f"{count[0]}/{count[1]}" if count[1] else ""


def _with_interval(count: Count) -> str:
    if not count[1]:
        return ""
    interval = success_interval(*count)
    return f"{_format_count(count)} ({format_interval(interval.low, interval.high)})"


def _tests(runs: IrTableRuns) -> ComparisonTable:
    compared = [((REFLEX, p), (arm, p)) for p in POSES for arm in (BLIND, FORWARD_35, FORWARD_55)]
    compared += [((arm, False), (arm, True)) for arm in ARMS]
    rows: list[list[str]] = []
    for ways in compared:
        first, second = runs.pairs(*ways)
        test = paired_test(first, second)
        names = [f"{arm.title}, {POSES[perturbed]}" for arm, perturbed in ways]
        rows.append([*names, str(len(first)), str(test.only_first), str(test.only_second), format_p_value(test.p)])
    return ComparisonTable(
        title="Runs in the same scenes",
        header=["first", "second", "pairs", "only the first held", "only the second held", "p"],
        rows=rows,
        note="McNemar's exact test, two-sided. The same scene: object, shift and turn, errors of vision, and noise. "
        "Between nominal and perturbed poses all but shift and turn are the same.",
    )


def _closing(runs: IrTableRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for perturbed, pose in POSES.items():
        for arm in ARMS:
            stops = Counter(Stop(int(s)).name.lower().replace("_", " ") for s in runs.metric("stop", arm, perturbed))
            displaced = 1000 * runs.metric("displacement", arm, perturbed)
            rows.append(
                [
                    f"{arm.title}, {pose}",
                    ", ".join(f"{n} {stop}" for stop, n in stops.most_common()),
                    format_median(runs.metric("steps", arm, perturbed), 0),
                    format_median(runs.metric("refinement_time", arm, perturbed), 1),
                    f"{np.median(displaced):.1f}, {np.max(displaced):.1f}" if len(displaced) else "",
                ]
            )
    return ComparisonTable(
        title="How the hand came to close",
        header=["arm", "why it closed", "steps", "time (s)", "object displaced: median, most (mm)"],
        rows=rows,
        note="Medians with bootstrapped intervals, 95 %: Gauss-Newton steps, and time until closing, from the first "
        "look at the sensors or, of a hand that does not look, from the pre-grasp pose. Displaced: how "
        "far the object was pushed before the hand closed.",
    )


def _distances(runs: IrTableRuns, perturbed: bool) -> ComparisonTable:
    header = ["object", *(f"{finger}, {whose}" for finger in FINGER_NAMES for whose in ("published", "ours", "true"))]
    rows: list[list[str]] = []
    for name, things in OBJECTS.items():
        row, published = [name.replace("_", " ")], runs.published_distances(name, perturbed)
        for finger in FINGER_NAMES:
            ours = 1000 * runs.metric(f"final_distance_{finger}", REFLEX, perturbed, things)
            unseen = len(runs.rows(REFLEX, perturbed, things)) - len(ours)
            true = 1000 * runs.metric(f"true_distance_{finger}", REFLEX, perturbed, things)
            row += [f"{1000 * published[finger]:.0f}", _with_unseen(format_median(ours, 1), unseen)]
            row.append(f"{np.median(true):.1f}" if len(true) else "")
        rows.append(row)
    return ComparisonTable(
        title=f"Table II, {POSES[perturbed]} poses: distances at the last step (mm)",
        header=header,
        rows=rows,
        note="Ours: medians of the IR-guided runs in which the finger sees the object, with bootstrapped intervals, "
        "95 %, as the sensors measure them, and in how many more it does not: a distance beyond the range enters no "
        "median. True: median along the beam, where it meets the object. Thumb and ring enter the cost. The poses of "
        f"an object are taken together. {_nearer_than_measured(runs, perturbed)}",
    )


def _nearer_than_measured(runs: IrTableRuns, perturbed: bool) -> str:
    """Say in how many runs a finger is so near that its reading falls again, and so is taken for a larger distance."""
    nearest = paper_values("ir_grasp", "published")["sensor_range"][0]
    rows = [r for r in runs.rows(REFLEX, perturbed) if r["stop"] == Stop.THRESHOLD]
    true = [[r.get(f"true_distance_{finger}") for finger in ("thumb", "ring")] for r in rows]
    nearer = sum(any(d is not None and d < nearest for d in distances) for distances in true)
    return (
        f"In {nearer} of the {len(rows)} runs that ended by the threshold, thumb or ring is truly nearer than "
        f"{1000 * nearest:g} mm, where readings fall again: the sensor takes it for farther off than it is."
    )


def _with_unseen(median: str, unseen: int) -> str:
    """Add to a median in how many runs there is nothing to take it of."""
    return "; ".join(text for text in (median, f"not seen in {unseen}" if unseen else "") if text)
