"""Figures of the experiment `ir-limits`: objects held, and pushed, by level, a panel for each axis."""

from collections.abc import Sequence
from math import ceil
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.published.ir_grasp.limits_axes import ARMS, AXES, CONTACT, PAPER, REFLEX, Axis, LimitArm
from handover.scenarios.published.ir_grasp.limits_results import LimitRuns

_COLUMNS = 4
_APART = 0.05
"""Distance of arms beside each other, in places of levels."""

_PUSHING = (REFLEX, PAPER, CONTACT)


def draw_limits(runs: LimitRuns, folder: Path) -> list[Figure]:
    """Draw rates and displacement by level into a folder; nothing without runs."""
    shown = [axis for axis in AXES if any(runs.count(arm, axis, axis.all_levels)[1] for arm in ARMS)]
    return [_rates(runs, shown, folder), _displacement(runs, shown, folder)] if shown else []


def _rates(runs: LimitRuns, shown: Sequence[Axis], folder: Path) -> Figure:
    rows, columns = _grid(shown)
    with figure(folder / "limits", rows, columns, size=(11.0, 0.7 + 2.25 * rows)) as panels:
        for axes, axis in zip(panels, shown, strict=False):
            for k, arm in reversed(list(enumerate(ARMS))):
                _rate(axes, runs, arm, axis, _APART * (k - 0.5 * (len(ARMS) - 1)))
            axes.axhline(50.0, color="#4d5866", lw=0.7, ls=(0, (4, 3)))
            axes.set(ylim=(-4, 104))
            _levels(axes, axis)
        _finish(panels, len(shown), "objects held (%)", ARMS)
    caption = (
        "Objects held by each way to grasp, the more disturbed the further to the right; intervals by Clopper and "
        "Pearson, 95 %. Leftmost there is no disturbance yet, but for the bars. All but the last "
        f"{sum(axis.blind_alike for axis in AXES)} start from the "
        "nominal pose; in those objects are moved as in the paper's perturbed poses."
    )
    return Figure("limits", caption)


def _rate(axes: Axes, runs: LimitRuns, arm: LimitArm, axis: Axis, aside: float) -> None:
    counts = [(k + aside, *runs.count(arm, axis, (level,))) for k, level in enumerate(axis.all_levels)]
    counts = [count for count in counts if count[2]]
    if not counts:
        return
    colour, rates = COLOURS[ARMS.index(arm)], [100 * k / n for _, k, n in counts]
    intervals = [success_interval(k, n) for _, k, n in counts]
    reach = [
        [rate - 100 * i.low for rate, i in zip(rates, intervals, strict=True)],
        [100 * i.high - rate for rate, i in zip(rates, intervals, strict=True)],
    ]
    axes.errorbar([x for x, _, _ in counts], rates, yerr=reach, color=colour, elinewidth=0.6, lw=0.0)
    style = "-" if arm.looks else "--"
    axes.plot([x for x, _, _ in counts], rates, style, color=colour, marker="o", ms=3, lw=1.4 if arm.looks else 1.0)


def _displacement(runs: LimitRuns, shown: Sequence[Axis], folder: Path) -> Figure:
    rows, columns = _grid(shown)
    with figure(folder / "limits_displacement", rows, columns, size=(11.0, 0.7 + 2.25 * rows)) as panels:
        for axes, axis in zip(panels, shown, strict=False):
            for k, arm in enumerate(_PUSHING):
                _pushes(axes, runs, arm, axis, 0.14 * (k - 1))
            _levels(axes, axis)
            axes.set_yscale("symlog", linthresh=1.0)
            axes.set(ylim=(-0.1, 300))
            axes.set_yticks([0, 1, 10, 100], ["0", "1", "10", "100"])
        _finish(panels, len(shown), "pushed by (mm)", _PUSHING)
    caption = (
        "How far objects are pushed before the hand closes, without what the ground carried: each run a point, "
        "medians as lines. The scale is linear up to 1 mm."
    )
    return Figure("limits_displacement", caption)


def _grid(shown: Sequence[Axis]) -> tuple[int, int]:
    """Return into how many rows and columns panels of some axes are put."""
    return ceil(len(shown) / _COLUMNS), min(len(shown), _COLUMNS)


def _pushes(axes: Axes, runs: LimitRuns, arm: LimitArm, axis: Axis, aside: float) -> None:
    colour, medians = COLOURS[ARMS.index(arm)], list[tuple[float, float]]()
    for k, level in enumerate(axis.all_levels):
        pushed = 1e3 * runs.values("displacement", arm, axis, (level,))
        if len(pushed):
            axes.plot(np.full(len(pushed), k + aside), pushed, ".", ms=2.5, color=colour, alpha=0.5)
            medians.append((k + aside, float(np.median(pushed))))
    axes.plot([x for x, _ in medians], [y for _, y in medians], color=colour, lw=1.2)


def _levels(axes: Axes, axis: Axis) -> None:
    axes.set_xticks(range(len(axis.all_levels)), [axis.format_number(level) for level in axis.all_levels])
    axes.set_xlim(-0.4, len(axis.all_levels) - 0.6)
    label = f"{axis.title} ({axis.unit})" if axis.unit else axis.title
    axes.set_xlabel(fill(label, 34), fontsize=8)
    axes.tick_params(labelsize=8)


def _finish(panels: Sequence[Axes], count: int, label: str, arms: Sequence[LimitArm]) -> None:
    """Label the panels, hide those that are left over, and write the legend below."""
    for k, axes in enumerate(panels):
        if k >= count:
            axes.set_visible(False)
        elif k % _COLUMNS == 0:
            axes.set_ylabel(label)
        else:
            axes.tick_params(labelleft=False)
    entries: dict[str, Any] = {
        arm.title: Line2D([], [], color=COLOURS[ARMS.index(arm)], ls="-" if arm.looks else "--", marker="o", ms=3)
        for arm in arms
    }
    legend_below(panels[0], entries, columns=min(len(entries), _COLUMNS))
