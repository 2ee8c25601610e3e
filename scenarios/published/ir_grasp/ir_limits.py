"""Where infrared sensing wins and where it does not: ways to grasp along many axes, beyond Luberto et al."""

import math
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path
from textwrap import fill
from typing import Any, ClassVar

import numpy as np

from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Drawable, Mark, Panel, drawn, level
from handover.scenarios.published.ir_grasp.limits_axes import (
    ARMS,
    AXES,
    CONTACT,
    OF_SCENES,
    PAPER,
    REFLEX,
    REPETITIONS,
    SEED,
    Axis,
    LimitArm,
    settings_of,
)
from handover.scenarios.published.ir_grasp.limits_results import WORTH, Comparison, LimitRuns, sentence_of_worth
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Count, Point, Runs
from handover.scenarios.published.tables import number, table_of, with_interval
from handover.scenarios.published.verdicts import FEW, format_p_value, format_rate, format_share, min_trials_for
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import LEVEL, success_interval, time_interval
from handover.scenarios.runs.campaign.table import CampaignTable

_WITHOUT = tuple(arm for arm in ARMS if not arm.looks)
_MIN_AXES = 4
_HELD, _MIN_RUNS = 0.95, 30
_CARRIED, _HELD_CARRIED = 0.015, 0.90
_PUSHED, _PUSHED_MOST = 0.005, 0.015
_REFINED = 3.0
_AXIS = {axis.key: axis for axis in AXES}
_ALIKE_AXES = sum(axis.blind_alike for axis in AXES)
_COLOURS = {arm.title: COLOURS[k] for k, arm in enumerate(ARMS)}


class IrLimits(PublishedExperiment):
    """The hand is disturbed in one way at a time, more and more, and meets each scene by several ways to grasp.

    Three ways use the sensors: the reflex, the same without touch where fingertips meet objects, and, where sensors are
    at fault, the paper's algorithm. Five do not. Everywhere these are going 35 or 55 mm ahead, going 100 mm ahead while
    slowly closing, and that until the joints feel a contact. Where objects come nearer, closing at once joins them.
    Each level has three scenes of each of five objects: the table's, or discs and bars of five masses. Seven objects
    that were kept from all tuning join them where objects are carried, and where light or sensors differ. Nothing was
    tuned with a seed of this campaign.
    """

    name: ClassVar[str] = "ir-limits"
    title: ClassVar[str] = "where infrared sensing wins: ways to grasp, disturbed in one way at a time (beyond Luberto)"
    scenario: ClassVar[str] = IrGrasp.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return arms x axes x levels x objects, three times; if quick, the hardest levels of one object, once."""
        points: dict[frozenset[tuple[str, str]], Point] = {}
        for axis in AXES:
            for x, arm in product(axis.levels[-1:] if quick else axis.all_levels, ARMS):
                if arm.meets(axis):
                    settings = settings_of(arm, axis, x)
                    points |= {frozenset(point.items()): point for point in (settings[:1] if quick else settings)}
        return self.campaign(
            list(points.values()), repetitions=1 if quick else REPETITIONS, seed=SEED, paired=True, scenes=OF_SCENES
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge that one curve is enough, and what looking is worth."""
        runs, unpushed = self.results(table), self.results(table, _PUSHED_MOST)
        mild = [x for x in _AXIS["curve"].levels if x <= 0.1]
        return [
            _no_worse(
                "One calibration curve is enough for all materials: with reflectivities from 0.2 to 2 the paper's "
                "algorithm holds no fewer moved objects than with their own.", "satisfactory",
                *runs.from_start(PAPER, [(_AXIS[key], _AXIS[key].levels) for key in ("dark", "bright")]),
            ),
            _no_worse(
                "One curve is enough for all sensors: with constants off by 2 to 10 % at most the paper's algorithm "
                "holds no fewer moved objects than with exact ones.", "they vary only slightly",
                *runs.from_start(PAPER, [(_AXIS["curve"], mild)]),
            ),
            _worth(runs),
            _worth(unpushed),
            _rate_at_least(
                f"The reflex holds {format_share(_HELD)} of all objects on these axes.", _of_all(runs, REFLEX).count,
                _HELD,
            ),
            _rate_at_least(
                f"Objects carried across at {1e3 * _CARRIED:.0f} mm/s are held in {format_share(_HELD_CARRIED)}.",
                runs.count(REFLEX, _AXIS["speed"], (_CARRIED,)), _HELD_CARRIED,
            ),
            _pushes(runs),
            _quick_enough(runs),
        ]  # fmt: skip

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return what looking is worth, where each arm falls below one half, all rates, and what was pushed."""
        runs, unpushed = self.results(table), self.results(table, _PUSHED_MOST)
        levels = [
            (axis, x) for axis in AXES for x in axis.all_levels if any(runs.count(a, axis, (x,))[1] for a in ARMS)
        ]
        pushed = {axis: {arm.title: _pushed(runs, arm, axis) for arm in ARMS} for axis in AXES}
        return [
            _table_of_worth(runs),
            _table_of_worth(unpushed),
            table_of(
                "Where a way falls below one half",
                [
                    {"axis": axis.title, "range": _range(axis), **{arm.title: runs.half(arm, axis) for arm in ARMS}}
                    for axis in _shown(runs)
                    if any(runs.half(arm, axis) for arm in ARMS)
                ],
                "Interpolated between levels. From the start: less than half is held without any disturbance, though "
                "it may be more farther on, as where the object comes nearer.",
            ),
            table_of(
                "Objects held",
                [
                    {
                        "axis and level": f"{axis.title}: {axis.format_level(x)}",
                        **{a.title: with_interval(runs.count(a, axis, (x,))).replace(" %)", ")") for a in ARMS},
                    }
                    for axis, x in levels
                ],
                "With 95 % intervals by Clopper and Pearson, in percent. Where it makes no difference to a hand that "
                "does not look, its runs are those at the axis's start.",
            ),
            table_of(
                "How far objects are pushed before the hand closes (mm): median, most",
                [{"axis": axis.title, **cells} for axis, cells in pushed.items() if any(cells.values())],
                "All levels beyond the start together; without what the ground carried an object.",
            ),
        ]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw rates and displacement by level, a panel for each axis."""
        found = self.results(table)
        shown = _shown(found)
        rows, columns = math.ceil(len(shown) / 4), min(len(shown), 4)
        size = (11.0, 0.9 + 2.25 * rows)
        return [
            *drawn(folder / "limits", "Objects held by each way to grasp, the more disturbed the further to the right; "
                   "intervals by Clopper and Pearson, 95 %. Leftmost there is no disturbance yet, but for the bars. In "
                   f"all but the last {_ALIKE_AXES} objects start from the nominal pose.",
                   [_panel(found, axis, "objects held (%)", ARMS, _rates, ylim=(-4, 104)) for axis in shown], columns,
                   size=size, legend=4),
            *drawn(folder / "limits_displacement", "How far objects are pushed before the hand closes, without what "
                   "the ground carried: each run a point, medians as lines. The scale is linear up to 1 mm.",
                   [_panel(found, axis, "pushed by (mm)", (REFLEX, PAPER, CONTACT), _displacements, ylim=(-0.1, 300))
                    for axis in shown], columns, size=size, legend=4),
        ]  # fmt: skip

    def results(self, table: CampaignTable, pushed_most: float = math.inf) -> LimitRuns:
        """Return the campaign's results, of which those count as held that were pushed by so much at most, m."""
        return LimitRuns(self.runs(table, lambda _: True), pushed_most)


def _shown(runs: LimitRuns) -> list[Axis]:
    return [axis for axis in AXES if any(runs.count(arm, axis, axis.all_levels)[1] for arm in ARMS)]


def _of_all(runs: LimitRuns, arm: LimitArm) -> Runs:
    """Return all runs of an arm, those that axes share once."""
    points = (point for axis in AXES for x in axis.all_levels for point in settings_of(arm, axis, x))
    return runs.all.of(*points)


def _no_worse(sentence: str, printed: str, held: Sequence[float], started: Sequence[bool]) -> Claim:
    """Judge that no fewer are held at some levels than at the start; levels of a scene are not independent."""
    says, n = Statement(sentence, "sec. V-B", printed), len(held)
    lost = np.array(started, dtype=np.float64) - np.array(held)
    interval = time_interval(lost, np.mean) if np.any(lost) else success_interval(0, n) if n else None
    if interval is None:
        return says.unknown()
    return says.judged(
        f"{format_share(float(np.mean(held)))} against {format_rate(sum(started), n)}",
        interval.high < FEW,
        f"what is lost has an interval below {format_share(FEW)} of the scenes: of each, the share of levels that was "
        "not held, less 1 if it was not held undisturbed",
        f"The mean of {counted(n, 'scene')} is {format_share(float(lost.mean()))}, by {interval.method} over scenes up "
        f"to {format_share(interval.high)}.",
        runs=(n, min_trials_for(FEW)),
    )


def _worth(runs: LimitRuns) -> Claim:
    says = Statement(
        f"On at least {_MIN_AXES} axes the reflex grasps {100 * WORTH:g} percentage points more of the objects than "
        f"the best way that does not look{_unpushed(runs)}."
    )
    compared = runs.compared(REFLEX, _WITHOUT)
    if not compared:
        return says.unknown()
    worth = sorted((c for c in compared if c.verdict == "worth it"), key=lambda c: -c.gain)
    return says.judged(
        f"on {len(worth)} of {len(compared)}" + "".join(f"; {c.axis.title} ({100 * c.gain:+.0f})" for c in worth),
        len(worth) >= _MIN_AXES,
        "on so many axes the difference is as large, of all levels beyond the start. Besides, the exact sign-flip "
        f"test over scenes, corrected by Holm over the axes, must reject at {format_share(LEVEL)}",
        f"The best of the others is that which held most. It takes {_MIN_RUNS} runs of each axis.",
        enough=all(c.first[1] >= _MIN_RUNS for c in compared),
    )


def _rate_at_least(sentence: str, count: Count, rate: float) -> Claim:
    says, (k, n) = Statement(sentence), count
    if not n:
        return says.unknown()
    return says.judged(
        format_rate(k, n),
        k / n >= rate,
        f"the rate is at least so high, of {_MIN_RUNS} runs or more",
        "The interval is Clopper and Pearson's, all runs taken for independent; that all of it lies above takes "
        f"{min_trials_for(1.0 - rate)} without a failure.",
        enough=n >= _MIN_RUNS,
        interval=success_interval(k, n),
    )


def _pushes(runs: LimitRuns) -> Claim:
    most = f"{1e3 * _PUSHED_MOST:.0f} mm"
    says = Statement(
        f"Before it closes the reflex pushes an object by {1e3 * _PUSHED:.0f} mm in the median, and by {most} at most."
    )
    pushed = _of_all(runs, REFLEX).metric("displacement")
    if not len(pushed):
        return says.unknown()
    over = format_rate(int(np.sum(pushed > _PUSHED_MOST)), len(pushed))
    return says.judged(
        f"{1e3 * np.median(pushed):.1f} mm and {1e3 * pushed.max():.0f} mm; over {most} in {over}",
        bool(np.median(pushed) <= _PUSHED and pushed.max() <= _PUSHED_MOST),
        "both are so over all its runs on these axes; without what the ground carried",
        enough=len(pushed) >= _MIN_RUNS,
    )


def _quick_enough(runs: LimitRuns) -> Claim:
    says = Statement(f"The reflex refines a grasp in {_REFINED:g} s in the median.")
    times = {arm.title: _of_all(runs, arm).metric("refinement_time") for arm in (REFLEX, PAPER)}
    ours = times[REFLEX.title]
    if not len(ours):
        return says.unknown()
    return says.judged(
        ", ".join(f"{title} {np.median(t):.1f} s" for title, t in times.items() if len(t)),
        bool(np.median(ours) <= _REFINED),
        "it is so over all its runs on these axes",
        f"The paper's algorithm runs on {len(PAPER.axes)} of them.",
        enough=len(ours) >= _MIN_RUNS,
    )


def _table_of_worth(runs: LimitRuns) -> ComparisonTable:
    compared = runs.compared(REFLEX, _WITHOUT)
    why = (
        f"Held, and pushed by at most {1e3 * _PUSHED_MOST:.0f} mm before the hand closed: what slides on this table "
        "may be knocked over on another. "
        if _unpushed(runs)
        else ""
    )
    note = (
        f"{why}{sentence_of_worth(compared)} All levels beyond the start together, in the same scenes; p by the exact "
        f"sign-flip test over scenes, corrected by Holm over the axes. On the last {_ALIKE_AXES} axes the levels are "
        "of the same scenes, and a hand that does not look met each once. The best way without looking is chosen by "
        "these runs themselves, which favours it."
    )
    if runs.unfinished:
        note += f" Counted as failures: {counted(runs.unfinished, 'run')} that did not come to an end."
    return table_of(f"What looking is worth{_unpushed(runs)}", [_row_of_worth(c) for c in compared], note)


def _row_of_worth(c: Comparison) -> dict[str, str]:
    return {
        "axis": c.axis.title,
        "reflex": f"{c.first[0]}/{c.first[1]}" if c.axis.blind_alike else with_interval(c.first),
        "best without looking": c.best.title,
        "it holds": with_interval(c.second),
        "points": f"{100 * c.gain:+.0f}",
        "scenes: it held more, the other": f"{c.only_first}, {c.only_second}",
        "p": format_p_value(c.p),
        "looking": c.verdict,
    }


def _unpushed(runs: LimitRuns) -> str:
    """Return words for what counts as held."""
    most = f", counting what was pushed by at most {1e3 * runs.pushed_most:.0f} mm"
    return "" if runs.pushed_most == math.inf else most


def _range(axis: Axis) -> str:
    first, last = axis.all_levels[0], axis.all_levels[-1]
    return f"{axis.format_number(first)} to {axis.format_level(last)}"


def _pushed(runs: LimitRuns, arm: LimitArm, axis: Axis) -> str:
    pushed = 1e3 * runs.of(arm, axis, axis.levels).metric("displacement")
    return f"{number(pushed)}, {pushed.max():.0f}" if len(pushed) else ""


Draw = Callable[[LimitRuns, LimitArm, Axis, int, int], Sequence[Drawable]]
"""Returns marks of an arm along an axis; which of how many arms it is."""


def _panel(
    runs: LimitRuns, axis: Axis, label: str, arms: Sequence[LimitArm], draw: Draw, ylim: tuple[float, float]
) -> Panel:
    marks = [mark for k, arm in reversed(list(enumerate(arms))) for mark in draw(runs, arm, axis, k, len(arms))]
    key = [
        Mark(form="o-" if arm.looks else "o--", colour=_COLOURS[arm.title], label=arm.title, style={"ms": 3})
        for arm in arms
    ]
    ticks = {float(k): axis.format_number(x) for k, x in enumerate(axis.all_levels)}
    title = f"{axis.title} ({axis.unit})" if axis.unit else axis.title
    axes: dict[str, Any] = {"xlabel": fill(title, 34), "ylabel": label, "xlim": (-0.4, len(ticks) - 0.6)}
    if draw is _displacements:
        ten = {0.0: "0", 1.0: "1", 10.0: "10", 100.0: "100"}
        return Panel([*marks, *key], {**axes, "yscale": ("symlog", {"linthresh": 1.0}), "ylim": ylim}, ticks, ten,
                     small=True)  # fmt: skip
    return Panel([level(50.0, lw=0.7), *marks, *key], {**axes, "ylim": ylim}, ticks, small=True)


def _rates(runs: LimitRuns, arm: LimitArm, axis: Axis, k: int, n: int) -> Sequence[Drawable]:
    counts = [(place + 0.05 * (k - 0.5 * (n - 1)), runs.count(arm, axis, (x,)))
              for place, x in enumerate(axis.all_levels)]  # fmt: skip
    counts = [(place, count) for place, count in counts if count[1]]
    rates = np.array([100 * held / tried for _, (held, tried) in counts])
    intervals = [success_interval(*count) for _, count in counts]
    bars = [rates - [100 * i.low for i in intervals], [100 * i.high for i in intervals] - rates]
    style = {"ms": 3, "lw": 1.4 if arm.looks else 1.0}
    form, places = "o-" if arm.looks else "o--", [place for place, _ in counts]
    return [Mark(places, rates, form, _COLOURS[arm.title], bars=bars, style=style)] if counts else []


def _displacements(runs: LimitRuns, arm: LimitArm, axis: Axis, k: int, _n: int) -> Sequence[Drawable]:
    marks: list[Mark] = []
    medians: list[tuple[float, float]] = []
    colour = _COLOURS[arm.title]
    for place, x in enumerate(axis.all_levels):
        pushed = 1e3 * runs.of(arm, axis, (x,)).metric("displacement")
        if len(pushed):
            at = place + 0.14 * (k - 1)
            marks.append(Mark(np.full(len(pushed), at), pushed, ".", colour, style={"ms": 2.5, "alpha": 0.5}))
            medians.append((at, float(np.median(pushed))))
    return [*marks, Mark.through(medians, "-", colour)] if medians else []
