"""Where infrared sensing wins and where it does not: ways to grasp along many axes, beyond Luberto et al."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import LEVEL, success_interval, time_interval
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.published.ir_grasp.ir_limits_figures import draw_limits
from handover.scenarios.published.ir_grasp.limits_axes import ARMS, AXES, PAPER, REFLEX, Axis, LimitArm, plan_of_limits
from handover.scenarios.published.ir_grasp.limits_results import WORTH, LimitRuns, Row, sentence_of_worth
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import (
    FEW,
    format_interval,
    format_p_value,
    format_rate,
    format_share,
    min_trials_for,
    nothing_measured,
    verdict_of,
    with_shortfall,
)

_WITHOUT = tuple(arm for arm in ARMS if not arm.looks)
_MIN_AXES = 4
_HELD, _MIN_RUNS = 0.95, 30
_CARRIED, _HELD_CARRIED = 0.015, 0.90
_PUSHED, _PUSHED_MOST = 0.005, 0.015
_REFINED = 3.0
_SPEED = next(axis for axis in AXES if axis.key == "speed")
_LIGHT = tuple(axis for axis in AXES if axis.key in ("dark", "bright"))
_ALIKE_AXES = sum(axis.blind_alike for axis in AXES)
_CURVE = next(axis for axis in AXES if axis.key == "curve")


class IrLimits(PublishedExperiment):
    """The hand is disturbed in one way at a time, more and more, and meets each scene by several ways to grasp.

    Three ways use the sensors: the reflex, the same without touch where fingertips meet objects, and, where sensors are
    at fault, the paper's algorithm. Five do not: everywhere going 35 or 55 mm ahead, going 100 mm ahead while
    slowly closing, and that until the joints feel a contact; closing at once where objects come nearer. Each level
    has three scenes of each of five objects, the table's, or discs and bars of five masses; seven objects that were
    kept from all tuning join them where objects are carried, and where light or sensors differ. Nothing was tuned
    with a seed of this campaign.
    """

    name: ClassVar[str] = "ir-limits"
    title: ClassVar[str] = "where infrared sensing wins: ways to grasp, disturbed in one way at a time (beyond Luberto)"
    scenario: ClassVar[str] = IrGrasp.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return arms x axes x levels x objects, three times; if quick, the hardest levels of one object, once."""
        return plan_of_limits(self.name, quick)

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge that one curve is enough, and what looking is worth."""
        runs, unpushed = LimitRuns(table), LimitRuns(table, _PUSHED_MOST)
        paper = [_one_curve(runs, PAPER), _alike(runs, PAPER)]
        return [
            *paper,
            _worth(runs),
            _worth(unpushed),
            _holds(runs),
            _carried(runs),
            _pushes(runs),
            _quick_enough(runs),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return what looking is worth, where each arm falls below one half, all rates, and what was pushed."""
        runs, unpushed = LimitRuns(table), LimitRuns(table, _PUSHED_MOST)
        return [_worth_table(runs), _worth_table(unpushed), _halves(runs), _rates(runs), _pushed_table(runs)]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002 (its figures need the table alone)
        """Draw rates and displacement by level, a panel for each axis."""
        return draw_limits(LimitRuns(table), folder)


def _one_curve(runs: LimitRuns, arm: LimitArm) -> Claim:
    levels = [(axis, axis.levels) for axis in _LIGHT]
    sentence = (
        "One calibration curve is enough for all materials: with reflectivities from 0.2 to 2 the paper's algorithm "
        "holds no fewer moved objects than with their own."
    )
    return _no_worse(sentence, "sec. V-B", "satisfactory", *runs.from_start(arm, levels))


def _alike(runs: LimitRuns, arm: LimitArm) -> Claim:
    mild = [level for level in _CURVE.levels if level <= 0.1]
    sentence = (
        "One curve is enough for all sensors: with constants off by 2 to 10 % at most the paper's algorithm holds "
        "no fewer moved objects than with exact ones."
    )
    return _no_worse(sentence, "sec. V-B", "they vary only slightly", *runs.from_start(arm, [(_CURVE, mild)]))


def _no_worse(sentence: str, where: str, printed: str, held: Sequence[float], started: Sequence[bool]) -> Claim:
    """Judge that no fewer are held at some levels than at the start; levels of a scene are not independent."""
    if not held:
        return nothing_measured(sentence, where, printed)
    n, least = len(held), min_trials_for(FEW)
    lost = np.array(started, dtype=np.float64) - np.array(held)
    interval = time_interval(lost, np.mean) if np.any(lost) else success_interval(0, n)
    if interval is None:
        return nothing_measured(sentence, where, printed)
    reason = (
        f"Reproduced if what is lost has an interval below {format_share(FEW)} of the scenes: of each, the share of "
        f"levels that was not held, less 1 if it was not held undisturbed; the mean of {n} scenes is "
        f"{format_share(float(lost.mean()))}, by {interval.method} over scenes up to {format_share(interval.high)}."
    )
    return Claim(
        claim=sentence,
        where=where,
        published=printed,
        measured=f"{format_share(float(np.mean(held)))} against {format_rate(sum(started), n)}",
        verdict=verdict_of(interval.high < FEW, could_be_either=n >= least),
        reason=with_shortfall(reason, n, least),
    )


def _worth(runs: LimitRuns) -> Claim:
    sentence = (
        f"On at least {_MIN_AXES} axes the reflex holds {100 * WORTH:g} percentage points more of the objects than the "
        f"best way that does not look{_unpushed(runs)}."
    )
    compared = runs.compared(REFLEX, _WITHOUT)
    if not compared:
        return nothing_measured(sentence, beyond=True)
    worth = [c for c in compared if c.verdict == "worth it"]
    return Claim(
        claim=sentence,
        published="",
        measured=f"on {len(worth)} of {len(compared)}"
        + "".join(f"; {c.axis.title} ({100 * c.gain:+.0f})" for c in sorted(worth, key=lambda c: -c.gain)),
        verdict=verdict_of(len(worth) >= _MIN_AXES, could_be_either=all(c.first[1] >= _MIN_RUNS for c in compared)),
        reason="Of each axis all levels beyond its start count, and the best of the others is that which held most of "
        "them. An axis counts if the difference is as large and the exact sign-flip test over scenes, which is "
        "McNemar's where a scene is met at one level, "
        f"corrected by Holm over the axes, rejects at {format_share(LEVEL)}. It takes {_MIN_RUNS} runs of each.",
        beyond=True,
    )


def _holds(runs: LimitRuns) -> Claim:
    sentence = f"The reflex holds {format_share(_HELD)} of all objects on these axes."
    rows = _once(runs, REFLEX)
    return _rate_at_least(sentence, (sum(bool(row["success"]) for row in rows), len(rows)), _HELD)


def _once(runs: LimitRuns, arm: LimitArm) -> list[Row]:
    """Return all runs of an arm, those that axes share once."""
    return list({row["run"]: row for axis in AXES for row in runs.rows(arm, axis, axis.all_levels)}.values())


def _of_all(runs: LimitRuns, metric: str, arm: LimitArm) -> Floats:
    """Return a metric of all runs of an arm, without those that have none."""
    found = [row.get(metric) for row in _once(runs, arm)]
    return np.array([v for v in found if v is not None and v == v], dtype=np.float64)


def _carried(runs: LimitRuns) -> Claim:
    sentence = f"Objects carried across at {1e3 * _CARRIED:.0f} mm/s are held in {format_share(_HELD_CARRIED)}."
    return _rate_at_least(sentence, runs.count(REFLEX, _SPEED, (_CARRIED,)), _HELD_CARRIED)


def _rate_at_least(sentence: str, count: tuple[int, int], rate: float) -> Claim:
    k, n = count
    if not n:
        return nothing_measured(sentence, beyond=True)
    interval, least = success_interval(k, n), min_trials_for(1.0 - rate)
    return Claim(
        claim=sentence,
        published="",
        measured=format_rate(k, n),
        interval=(interval.low, interval.high),
        verdict=verdict_of(k / n >= rate, could_be_either=n >= _MIN_RUNS),
        reason=f"Holds if the rate is at least so high, of {_MIN_RUNS} runs or more. The interval is Clopper and "
        f"Pearson's, all runs taken for independent; that all of it lies above takes {least} without a failure.",
        beyond=True,
    )


def _pushes(runs: LimitRuns) -> Claim:
    sentence = (
        f"Before it closes the reflex pushes an object by {1e3 * _PUSHED:.0f} mm in the median, and by "
        f"{1e3 * _PUSHED_MOST:.0f} mm at most."
    )
    pushed = _of_all(runs, "displacement", REFLEX)
    if not len(pushed):
        return nothing_measured(sentence, beyond=True)
    median, most = float(np.median(pushed)), float(pushed.max())
    over = int(np.sum(pushed > _PUSHED_MOST))
    return Claim(
        claim=sentence,
        published="",
        measured=f"{1e3 * median:.1f} mm and {1e3 * most:.0f} mm; over {1e3 * _PUSHED_MOST:.0f} mm in "
        f"{format_rate(over, len(pushed))}",
        verdict=verdict_of(median <= _PUSHED and most <= _PUSHED_MOST, could_be_either=len(pushed) >= _MIN_RUNS),
        reason="Holds if both are so over all its runs on these axes; without what the ground carried.",
        beyond=True,
    )


def _quick_enough(runs: LimitRuns) -> Claim:
    sentence = f"The reflex refines a grasp in {_REFINED:g} s in the median."
    times = {arm.title: _of_all(runs, "refinement_time", arm) for arm in (REFLEX, PAPER)}
    ours = times[REFLEX.title]
    if not len(ours):
        return nothing_measured(sentence, beyond=True)
    medians = ", ".join(f"{title} {np.median(t):.1f} s" for title, t in times.items() if len(t))
    return Claim(
        claim=sentence,
        published="",
        measured=medians,
        verdict=verdict_of(float(np.median(ours)) <= _REFINED, could_be_either=len(ours) >= _MIN_RUNS),
        reason="Holds if it is so over all its runs on these axes; the paper's algorithm runs on "
        f"{len(PAPER.axes)} of them.",
        beyond=True,
    )


def _worth_table(runs: LimitRuns) -> ComparisonTable:
    compared = runs.compared(REFLEX, _WITHOUT)
    rows = [
        [
            c.axis.title,
            f"{c.first[0]}/{c.first[1]}" if c.axis.blind_alike else _with_interval(c.first),
            c.best.title,
            _with_interval(c.second),
            f"{100 * c.gain:+.0f}",
            f"{c.only_first}, {c.only_second}",
            format_p_value(c.p),
            c.verdict,
        ]
        for c in compared
    ]
    of_scenes = "scenes: it held more, the other"
    header = ["axis", "reflex", "best without looking", "it holds", "points", of_scenes, "p", "looking"]
    why = _WHY_UNPUSHED if _unpushed(runs) else ""
    note = (
        f"{why}{sentence_of_worth(compared)} All levels beyond the start together, in the same scenes; p by the exact "
        "sign-flip test over scenes, corrected by Holm over the axes. "
        f"On the last {_ALIKE_AXES} axes the levels are of the same scenes, and a hand that does not look met each "
        "once. The best way without looking is chosen by these runs themselves, which favours it."
    )
    if runs.unfinished:
        note += f" {runs.unfinished} runs did not come to their end, and count as failures."
    return ComparisonTable(title=f"What looking is worth{_unpushed(runs)}", header=header, rows=rows, note=note)


_WHY_UNPUSHED = (
    f"Held, and pushed by at most {1e3 * _PUSHED_MOST:.0f} mm before the hand closed: what slides on this table may be "
    "knocked over on another. "
)


def _unpushed(runs: LimitRuns) -> str:
    """Return words for what counts as held."""
    return (
        "" if runs.pushed_most == math.inf else f", counting what was pushed by at most {1e3 * runs.pushed_most:.0f} mm"
    )


def _with_interval(count: tuple[int, int]) -> str:
    if not count[1]:
        return ""
    interval = success_interval(*count)
    return f"{count[0]}/{count[1]} ({format_interval(interval.low, interval.high)})"


def _halves(runs: LimitRuns) -> ComparisonTable:
    shown = [axis for axis in AXES if any(runs.count(arm, axis, axis.all_levels)[1] for arm in ARMS)]
    rows = [[axis.title, _span(axis), *(runs.half(arm, axis) for arm in ARMS)] for axis in shown]
    return ComparisonTable(
        title="Where a way falls below one half",
        header=["axis", "range", *(arm.title for arm in ARMS)],
        rows=rows,
        note="Interpolated between levels. From the start: less than half is held without any disturbance, though "
        "it may be more farther on, as where the object comes nearer.",
    )


def _span(axis: Axis) -> str:
    first, last = axis.all_levels[0], axis.all_levels[-1]
    return f"{axis.format_number(first)} to {axis.format_level(last)}"


def _rates(runs: LimitRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for axis in AXES:
        for level in axis.all_levels:
            counts = [runs.count(arm, axis, (level,)) for arm in ARMS]
            if any(n for _, n in counts):
                cells = [_with_interval(count).replace(" %)", ")") for count in counts]
                rows.append([f"{axis.title}: {axis.format_level(level)}", *cells])
    return ComparisonTable(
        title="Objects held",
        header=["axis and level", *(arm.title for arm in ARMS)],
        rows=rows,
        note="With 95 % intervals by Clopper and Pearson, in percent. Where it makes no difference to a hand that does "
        "not look, its runs are those at the axis's start.",
    )


def _pushed_table(runs: LimitRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for axis in AXES:
        cells = [_pushed(runs, arm, axis) for arm in ARMS]
        if any(cells):
            rows.append([axis.title, *cells])
    return ComparisonTable(
        title="How far objects are pushed before the hand closes (mm): median, most",
        header=["axis", *(arm.title for arm in ARMS)],
        rows=rows,
        note="All levels beyond the start together; without what the ground carried an object.",
    )


def _pushed(runs: LimitRuns, arm: LimitArm, axis: Axis) -> str:
    pushed = 1e3 * runs.values("displacement", arm, axis, axis.levels)
    return f"{np.median(pushed):.1f}, {pushed.max():.0f}" if len(pushed) else ""
