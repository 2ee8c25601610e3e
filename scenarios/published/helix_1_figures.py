"""Figures of `helix-1`: times by step size beside table 1, and the error over time as in fig. 8 of [Vervloet2025]."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from handover.controllers.helix.visual_servo import Phase
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure
from handover.scenarios.published.helix_1_runs import Helix1Arm, published

_TICKS = (10, 20, 50, 100, 200, 500)
_PUBLISHED = COLOURS[5]


def draw_times(arms: Sequence[Helix1Arm], folder: Path) -> list[Figure]:
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
            axis.set_title(arm.title)
        axes[0].set_ylabel("time until the gripper begins to close (s)")
        axes[0].figure.legend(handles=_times_legend(), loc="outside lower center", ncols=2)
    caption = (
        "Time until the gripper begins to close, by step size, on a logarithmic axis: where the time halves as the "
        "step doubles, columns are equally far apart. Runs in which it never began to close are not there."
    )
    return [Figure("times", caption)]


def draw_errors(arms: Sequence[Helix1Arm], runs: Path, folder: Path) -> list[Figure]:
    """Draw the controller's error over time, mean and deviation by step size, from the runs' records."""
    errors = {arm.tuning: {alpha: _errors(arm, alpha, runs) for alpha in arm.alphas} for arm in arms}
    drawn = [arm for arm in arms if any(errors[arm.tuning].values())]
    if not drawn:
        return []
    longest = max(float(arm.times(alpha).max(initial=0.0)) for arm in drawn for alpha in arm.alphas)
    with figure(folder / "errors", len(drawn), size=(8.0, 0.7 + 2.9 * len(drawn))) as axes:
        for axis, arm in zip(axes, drawn, strict=True):
            for colour, (alpha, runs_of_it) in zip(COLOURS, errors[arm.tuning].items(), strict=False):
                if runs_of_it:
                    _mean_error(axis, runs_of_it, arm.rows[alpha][0]["control_period"], (colour, f"α = {alpha}"))
            axis.set(ylabel="error (mm)", ylim=(0, None), xlim=(0, 1.02 * longest))
            axis.set_title(arm.title)
            axis.legend(loc="upper right")
        axes[-1].set_xlabel("time (s)")
    caption = (
        "Distance to the goal that the controller sees, over wrist and gripper, until the gripper begins to close, "
        "like fig. 8. Thick: mean of the runs still under way, up to the median length, with its standard deviation; "
        "thin: the runs. The error jumps where the goal changes from above the ball to the ball."
    )
    return [Figure("errors", caption)]


def _published_times(axis: Axes, i: int) -> None:
    printed = published()
    x, width = i - 0.2, 0.22
    low, high = printed["arm_time_min"][i], printed["arm_time_max"][i]
    axis.bar(x, high - low, width, bottom=low, color="#d5dae2", lw=0, zorder=1)
    axis.plot([x - width / 2, x + width / 2], [printed["arm_time_median"][i]] * 2, color=_PUBLISHED, lw=2.0)


def _our_times(axis: Axes, i: int, arm: Helix1Arm, alpha: float) -> None:
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


def _range_of_times(arms: Sequence[Helix1Arm]) -> tuple[float, float]:
    printed = published()
    ours = np.concatenate([arm.times(alpha) for arm in arms for alpha in arm.alphas])
    every = np.concatenate([ours, printed["arm_time_min"], printed["arm_time_max"]])
    return 0.85 * float(every.min()), 1.15 * float(every.max())


def _errors(arm: Helix1Arm, alpha: float, runs: Path) -> list[Floats]:
    """Return the error at each control step, m, of each run that has a record, until the gripper began to close."""
    errors: list[Floats] = []
    for row in arm.rows[alpha]:
        path = runs / row["run"] / "signals.parquet"
        if row.get("arm_time") is None or not path.exists():
            continue
        record = Record(path)
        middle = (np.arange(round(row["steps"]), dtype=np.float64) + 0.5) * row["control_period"]  # between updates
        after = np.asarray(np.searchsorted(record.time, middle), dtype=np.int64)
        index = np.minimum(after, len(record.time) - 1)
        seen: NDArray[np.bool_] = record["servo.phase"][index] != int(Phase.WAIT)
        errors.append(np.where(seen, record["servo.error"][index], np.nan))
    return errors


def _mean_error(axis: Axes, runs: Sequence[Floats], period: float, style: tuple[str, str]) -> None:
    """Draw runs of one control period, s; style is colour and label."""
    colour, label = style
    for run in runs:
        axis.plot(period * np.arange(len(run)), 1000 * run, color=colour, lw=0.6, alpha=0.4)
    length = int(np.median([len(run) for run in runs]))
    padded = np.full((len(runs), length), np.nan)
    for line, run in zip(padded, runs, strict=True):
        line[: len(run)] = run[:length]
    known: NDArray[np.int64] = np.flatnonzero(~np.all(np.isnan(padded), axis=0))
    mean, deviation = 1000 * np.nanmean(padded[:, known], axis=0), 1000 * np.nanstd(padded[:, known], axis=0)
    axis.fill_between(period * known, mean - deviation, mean + deviation, color=colour, alpha=0.18, lw=0)
    axis.plot(period * known, mean, color=colour, lw=2.0, label=label)
