"""Figures of `helix-1`: times by step size beside table 1, and errors as in figs. 7, 8, 16 and 17 of [Vervloet2025]."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.published.helix.helix_1_curves import MeanCurve, errors_of, mean_curve
from handover.scenarios.published.helix.helix_1_runs import Helix1Runs, published

_TICKS = (10, 20, 50, 100, 200, 500)
_PUBLISHED, _SHADE = COLOURS[5], "#dfe4ec"

FIGURES_OF_RUNS = ("fig. 7", "fig. 16", "fig. 17")
"""The thesis's figures of single runs, by step size. Figs. 17, 20, 21 and appendix A say 0.3, text and table 0.4."""


def draw_times(arms: Sequence[Helix1Runs], folder: Path) -> list[Figure]:
    """Draw every run's time until the gripper begins to close beside the published minimum, median and maximum."""
    if not any(arm.closed for arm in arms):
        return []
    with figure(folder / "times", 1, len(arms), size=(1.2 + 3.6 * len(arms), 4.0)) as axes:
        low, high = _range_of_times(arms)
        for axis, arm in zip(axes, arms, strict=True):
            for i, alpha in enumerate(arm.alphas):
                _published_times(axis, i)
                _our_times(axis, i, arm, alpha)
            axis.set(yscale="log", ylim=(low, high), xlim=(-0.6, len(arm.alphas) - 0.4), xlabel="step size α")
            axis.set_xticks(range(len(arm.alphas)), [str(alpha) for alpha in arm.alphas])
            axis.set_yticks([t for t in _TICKS if low <= t <= high], [str(t) for t in _TICKS if low <= t <= high])
            axis.yaxis.set_minor_formatter(NullFormatter())
            axis.grid(axis="x", visible=False)
            axis.set_title(arm.title.replace(", ", ",\n"))
        axes[0].set_ylabel("time until the gripper begins to close (s)")
        axes[0].figure.legend(handles=_times_legend(), loc="outside lower center", ncols=min(len(arms), 2))
    caption = (
        "Time until the gripper begins to close, by step size, on a logarithmic axis: where the time halves as the "
        "step doubles, columns are equally far apart. Runs in which it never began to close are not there."
    )
    return [Figure("times", caption)]


def draw_errors(arms: Sequence[Helix1Runs], runs: Path, folder: Path) -> list[Figure]:
    """Draw the mean error over time with its deviation, by step size and settings, as in fig. 8."""
    errors = [(arm, {alpha: errors_of(arm.rows[alpha], runs) for alpha in arm.alphas}) for arm in arms]
    drawn = [(arm, of_arm) for arm, of_arm in errors if any(of_arm.values())]
    if not drawn:
        return []
    medians = published()["arm_time_median"]
    with figure(folder / "errors", len(drawn), size=(8.0, 0.7 + 2.9 * len(drawn))) as axes:
        for axis, (arm, of_arm) in zip(axes, drawn, strict=True):
            for i, (colour, alpha) in enumerate(zip(COLOURS, arm.alphas, strict=False)):
                if of_alpha := of_arm[alpha]:
                    style = colour, f"α = {alpha}"
                    draw_mean_error(axis, of_alpha, arm.rows[alpha][0]["control_period"], style, singles=False)
                axis.plot(medians[i], 0.0, marker="^", ms=7, color=colour, clip_on=False, zorder=5)
            axis.plot([], [], "^", ms=7, color=_PUBLISHED, label="published medians of the times")
            axis.set(ylabel="error (mm)", ylim=(0, None), xlim=(0, None))
            axis.set_title(arm.title)
            axis.legend(loc="upper right")
        axes[-1].set_xlabel("time (s)")
    caption = (
        "Distance to the goal that the controller sees, over wrist and gripper, until the gripper begins to close, "
        "like fig. 8: mean of the runs still under way, up to the median length, with their standard deviation. The "
        "error jumps where the goal changes from above the ball to the ball."
    )
    return [Figure("errors", caption)]


def draw_single_errors(arm: Helix1Runs, runs: Path, folder: Path) -> list[Figure]:
    """Draw every run's error over time with mean and deviation, a panel a step size, as in figs. 7, 16 and 17."""
    errors = {alpha: errors_of(arm.rows[alpha], runs) for alpha in arm.alphas}
    drawn = [alpha for alpha, of_alpha in errors.items() if of_alpha]
    if not drawn:
        return []
    name = f"single_errors{arm.suffix}"
    with figure(folder / name, len(drawn), size=(8.0, 0.8 + 2.3 * len(drawn))) as axes:
        for axis, alpha in zip(axes, drawn, strict=True):
            i = arm.alphas.index(alpha)
            draw_mean_error(axis, errors[alpha], arm.rows[alpha][0]["control_period"], (COLOURS[i], ""))
            _published_span(axis, i)
            longest = max(float(arm.times(alpha).max()), published()["arm_time_max"][i])
            axis.set(ylabel="error (mm)", ylim=(0, None), xlim=(0, 1.02 * longest))
            axis.set_title(f"α = {alpha}, as {FIGURES_OF_RUNS[i]}")
        axes[-1].set_xlabel("time (s)")
        axes[0].figure.legend(handles=_single_legend(), loc="outside lower center", ncols=2)
    caption = (
        "Distance to the goal that the controller sees, over wrist and gripper, until the gripper begins to close, "
        f"like figs. 7, 16 and 17, {arm.title}. Thin: the runs; thick: mean of those still under way, up "
        "to the median length, with their standard deviation. Grey: when the thesis's runs ended."
    )
    return [Figure(name, caption)]


def _published_span(axis: Axes, i: int) -> None:
    printed = published()
    low, high = printed["arm_time_min"][i], printed["arm_time_max"][i]
    axis.axvspan(low, high, color=_SHADE, lw=0, zorder=0)
    axis.axvline(printed["arm_time_median"][i], color=_PUBLISHED, lw=1.6, ls="--")


def _single_legend() -> list[Line2D]:
    return [
        Line2D([], [], color=_PUBLISHED, lw=2.0, label="mean of our runs, with deviation"),
        Line2D([], [], color=_PUBLISHED, lw=0.6, label="our runs"),
        Line2D([], [], color=_SHADE, lw=8, label="published: when the runs ended"),
        Line2D([], [], color=_PUBLISHED, lw=1.6, ls="--", label="published: median of the times"),
    ]


def _published_times(axis: Axes, i: int) -> None:
    printed = published()
    x, width = i - 0.2, 0.22
    low, high = printed["arm_time_min"][i], printed["arm_time_max"][i]
    axis.bar(x, high - low, width, bottom=low, color="#d5dae2", lw=0, zorder=1)
    axis.plot([x - width / 2, x + width / 2], [printed["arm_time_median"][i]] * 2, color=_PUBLISHED, lw=2.0)


def _our_times(axis: Axes, i: int, arm: Helix1Runs, alpha: float) -> None:
    rows = [row for row in arm.rows[alpha] if row.get("arm_time") is not None]
    if not rows:
        return
    times = np.array([row["arm_time"] for row in rows])
    x = i + 0.2 + 0.2 * (np.linspace(-0.5, 0.5, len(rows)) if len(rows) > 1 else np.zeros(1))
    held = np.array([bool(row["success"]) for row in rows])
    axis.plot(x[held], times[held], "o", ms=5, color=COLOURS[0], alpha=0.85, mew=0)
    axis.plot(x[~held], times[~held], "x", ms=6, color=COLOURS[1], mew=1.6)
    axis.plot([i + 0.08, i + 0.32], [np.median(times)] * 2, color=COLOURS[0], lw=2.0)


def _times_legend() -> list[Line2D]:
    return [
        Line2D([], [], color="#d5dae2", lw=8, label="published: minimum to maximum"),
        Line2D([], [], color=COLOURS[0], marker="o", ms=5, lw=0, label="our runs, ball taken"),
        Line2D([], [], color=_PUBLISHED, lw=2, label="published: median"),
        Line2D([], [], color=COLOURS[1], marker="x", ms=6, mew=1.6, lw=0, label="our runs, ball not taken"),
    ]


def _range_of_times(arms: Sequence[Helix1Runs]) -> tuple[float, float]:
    printed = published()
    ours = np.concatenate([arm.times(alpha) for arm in arms for alpha in arm.alphas])
    every = np.concatenate([ours, printed["arm_time_min"], printed["arm_time_max"]])
    return 0.85 * float(every.min()), 1.15 * float(every.max())


def draw_mean_error(
    axis: Axes, runs: Sequence[Floats], period: float, style: tuple[str, str], *, singles: bool = True
) -> None:
    """Draw the mean of errors, m, of runs of one control period, s, with its deviation.

    Args:
        axis: where to.
        runs: errors at each control step of each run.
        period: control period, s.
        style: colour and label.
        singles: whether to draw each run, too.
    """
    for run in runs if singles else ():
        axis.plot(period * np.arange(len(run)), 1000 * run, color=style[0], lw=0.6, alpha=0.4)
    draw_mean(axis, mean_curve(runs, period), style)


def draw_mean(axis: Axes, curve: MeanCurve, style: tuple[str, str], dashes: str = "-") -> None:
    """Draw a mean, m, in mm, with a band of one standard deviation to either side; style is colour and label."""
    colour, label = style
    mean, deviation = 1000 * curve.mean, 1000 * curve.deviation
    axis.fill_between(curve.time, mean - deviation, mean + deviation, color=colour, alpha=0.18, lw=0)
    axis.plot(curve.time, mean, color=colour, lw=2.0, ls=dashes, label=label)
