"""Claims of [Vervloet2025] secs. 4.2, 5.1 and 5.2 about how error, model and estimate go over time.

They are judged on the records of the runs of `helix-1` with the thesis's settings. Each rule was laid down from the
thesis's words before these runs were looked at.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy import stats
from scipy.stats import binomtest

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.statistics import LEVEL, MIN_SAMPLES, success_interval, time_interval
from handover.scenarios.experiment.display_unit import counted
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.helix.evaluation import FIG_9_RESOLUTION
from handover.scenarios.published.helix.helix_1_curves import RunCurves, mean_curve
from handover.scenarios.published.helix.helix_1_runs import too_few
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import MIN_FOR_EVERY, format_p_value, format_rate, verdict_of, with_shortfall

Curves = Mapping[float, Sequence[RunCurves]]
"""Curves of runs by step size."""

_MIN_SIGNS = next(n for n in range(1, 64) if 2.0 ** (1 - n) < LEVEL)
"""Runs that must all go one way for a sign test to reject."""

_AT_BOUND = 0.01
"""How near to a bound counts as at it, as a part of it: to no more digits a length can be read off a figure."""

_SIMILAR = 2 * FIG_9_RESOLUTION
"""How much two lengths of fig. 9 and its likes may differ that are told as very similar, m."""


def error_claims(curves: Curves) -> list[Claim]:
    """Judge sec. 5.1: how the error falls, and what the second goal does to it."""
    return [_slows(curves), _jumps(curves), _roughens(curves)]


def model_claims(curves: Curves) -> list[Claim]:
    """Judge secs. 4.2 and 5.2: how far the model of the command and the estimated state are from what is measured."""
    return [_starts_off(curves), _grows(curves), _alike(curves), _beyond_bound(curves), _at_bound(curves)]


def _slows(curves: Curves) -> Claim:
    facts: dict[str, Any] = {
        "claim": "At every step size the error falls the faster the larger it is",
        "published": "so in fig. 8 (no figures)",
        "where": "sec. 5.1, fig. 8",
    }
    ratios = {alpha: _halves(runs) for alpha, runs in curves.items()}
    if short := _short(ratios, _MIN_SIGNS):
        return too_few(facts, f"{short}; it takes {_MIN_SIGNS} for a sign test to reject")
    ps = [float(binomtest(int(np.sum(x > 1.0)), len(x)).pvalue) for x in ratios.values()]
    holds = all(p < LEVEL and np.median(x) > 1.0 for p, x in zip(ps, ratios.values(), strict=True))
    return Claim(
        **facts,
        measured=", ".join(f"{np.median(x):.1f}" for x in ratios.values()) + " times as long (medians)",
        verdict=Verdict.REPRODUCED if holds else Verdict.NOT_REPRODUCED,
        reason="Reproduced if, on the way to the first goal, the error takes longer for the second half of its fall "
        "than for the first at each step size, by a sign test over the runs: p = "
        f"{', '.join(format_p_value(p) for p in ps)}. An error that fell evenly would take 1 time as long.",
    )


def _halves(runs: Sequence[RunCurves]) -> Floats:
    """Return, for each run that came to the first goal, the second half's time over the first half's of its fall."""
    ratios: list[float] = []
    for run in runs:
        if run.descent is None:
            continue
        error = run.error[: run.descent]
        error = error[~np.isnan(error)]
        if len(error) < 3 or error[-1] >= error[0]:
            continue
        middle = (error[0] + error[-1]) / 2
        k = int(np.flatnonzero(error <= middle)[0])
        first = k - (middle - error[k]) / (error[k - 1] - error[k])
        ratios.append((len(error) - 1 - first) / first)
    return np.array(ratios)


def _jumps(curves: Curves) -> Claim:
    facts: dict[str, Any] = {
        "claim": "The error rises at the change from the first goal to the second",
        "published": "it suddenly increases slightly (no figures)",
        "where": "sec. 5.1",
    }
    rises = np.array([run.rise for runs in curves.values() for run in runs if run.descent is not None])
    if not len(rises):
        return too_few(facts, "none came to the second goal")
    k, n = int(np.sum(rises > 0.0)), len(rises)
    interval = success_interval(k, n)
    spread = f"{1e3 * np.median(rises):.0f} mm in the median, {1e3 * rises.min():.0f} to {1e3 * rises.max():.0f} mm"
    return Claim(
        **facts,
        measured=f"in {format_rate(k, n)}; by {spread}",
        interval=(interval.low, interval.high),
        verdict=verdict_of(k == n, could_be_either=n >= MIN_FOR_EVERY),
        reason=with_shortfall(
            "Reproduced if it does in every run, with the measurement of the step at which the goal changes, over "
            "wrist and gripper. The interval is Clopper and Pearson's. Both goals are 50 mm apart, so that the norm "
            "over both points changes by 71 mm at most. The arm that hangs below its first goal is nearer to the "
            "second.",
            n,
            MIN_FOR_EVERY,
        ),
    )


def _roughens(curves: Curves) -> Claim:
    facts: dict[str, Any] = {
        "claim": "The average error falls smoothly at first, and more roughly later",
        "published": "so in fig. 8 (no figures)",
        "where": "sec. 5.1, fig. 8",
    }
    parts = [_roughness(runs) for runs in curves.values()]
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return too_few(facts, "at a step size the average has no three steps before, or after, the first new goal")
    return Claim(
        **facts,
        measured="; ".join(f"{before:.1f} then {after:.1f}" for before, after in known),
        verdict=Verdict.REPRODUCED if all(before < after for before, after in known) else Verdict.NOT_REPRODUCED,
        reason="Of the average over the runs, as in fig. 8, the mean size of the second differences over that of the "
        "first, before the first of the runs changes its goal and after, by step size: the step size for an error that "
        "falls exponentially, 2 for one that goes to and fro. Reproduced if it is larger after, at each.",
    )


def _roughness(runs: Sequence[RunCurves]) -> tuple[float, float] | None:
    """Return the average's roughness before and after the first run's change of goal; None if one is too short."""
    descents = [run.descent for run in runs if run.descent is not None]
    if not descents:
        return None
    curve = mean_curve([run.error for run in runs], runs[0].period)
    k = int(np.searchsorted(curve.time, (min(descents) - 0.5) * runs[0].period))
    parts = curve.mean[:k], curve.mean[max(k - 1, 0) :]
    if min(map(len, parts)) < 3:
        return None
    steps: list[Floats] = [np.diff(x) for x in parts]
    before, after = (float(np.abs(np.diff(x)).mean() / np.abs(x).mean()) for x in steps)
    return before, after


def _starts_off(curves: Curves) -> Claim:
    facts: dict[str, Any] = {
        "claim": "At the start the measured gripper is not where the calibrated arm should have it",
        "published": "so in fig. 9 (no figures)",
        "where": "sec. 5.2, fig. 9",
    }
    starts = np.array([_known(run.way_meas)[0] for runs in curves.values() for run in runs])
    interval = time_interval(starts, np.mean)
    if interval is None:
        return too_few(facts, f"{counted(len(starts), 'run')} with a record")
    return Claim(
        **facts,
        measured=f"{1e3 * np.mean(starts):.1f} mm away on average",
        interval=(interval.low, interval.high),
        unit="m",
        verdict=Verdict.REPRODUCED if interval.low > FIG_9_RESOLUTION else Verdict.NOT_REPRODUCED,
        reason=f"Reproduced if the interval of the mean lies above {1e3 * FIG_9_RESOLUTION:.0f} mm, to which the "
        "thesis gives the lengths of fig. 9. Here the tendons' zeros are exact: the arm hangs as its model does, and "
        "what is left are the cameras' calibration and the measurement.",
    )


def _grows(curves: Curves) -> Claim:
    facts: dict[str, Any] = {
        "claim": "The farther the arm has gone, the farther is the model of the command from it",
        "published": "so in figs. 9, 18, 20 (no figures)",
        "where": "sec. 5.2",
    }
    ranks = {alpha: np.array([_rank(run.way_meas, run.apart_sys) for run in runs]) for alpha, runs in curves.items()}
    if short := _short(ranks, MIN_SAMPLES):
        return too_few(facts, short)
    intervals = [time_interval(x, np.mean) for x in ranks.values()]
    lows = [x.min() if i is None else i.low for i, x in zip(intervals, ranks.values(), strict=True)]
    return Claim(
        **facts,
        measured=", ".join(f"{np.mean(x):.2f}" for x in ranks.values()) + " (Spearman's rank correlations)",
        verdict=Verdict.REPRODUCED if min(lows) > 0.0 else Verdict.NOT_REPRODUCED,
        reason="Of each run, Spearman's rank correlation over its steps of the measured gripper's way from the start "
        "and its distance from the model's. Reproduced if the interval of their mean (bootstrap) lies above 0 at each "
        "step size; where all are the same, it is that value.",
    )


def _rank(x: Floats, y: Floats) -> float:
    """Return Spearman's rank correlation of the values that are known; 0 where one of them never changes."""
    known = ~np.isnan(x) & ~np.isnan(y)
    if not np.ptp(x[known]) or not np.ptp(y[known]):
        return 0.0
    result: Any = stats.spearmanr(x[known], y[known])
    return float(result.statistic)


def _alike(curves: Curves) -> Claim:
    alphas = tuple(curves)
    facts: dict[str, Any] = {
        "claim": "The model's mismatch at the end is very similar at all step sizes",
        "published": "very similar (no figures)",
        "where": "sec. 4.2, figs. 9, 18, 20",
    }
    ends = {alpha: np.array([_known(run.apart_sys)[-1] for run in runs]) for alpha, runs in curves.items()}
    if short := _short(ends, MIN_SAMPLES):
        return too_few(facts, short)
    means = [float(np.mean(x)) for x in ends.values()]
    return Claim(
        **facts,
        measured=", ".join(f"{1e3 * m:.0f}" for m in means) + f" mm (α = {', '.join(map(str, alphas))})",
        verdict=Verdict.REPRODUCED if np.ptp(means) <= _SIMILAR else Verdict.NOT_REPRODUCED,
        reason=f"Reproduced if the means over the runs differ by no more than {1e3 * _SIMILAR:.0f} mm, twice the "
        "resolution to which the thesis gives such lengths.",
    )


def _beyond_bound(curves: Curves) -> Claim:
    bound = 1e3 * _bound()
    facts: dict[str, Any] = {
        "claim": "The model of the command is always farther from the measured pose than ε_pose,bound",
        "published": "always, at all steps",
        "where": "sec. 5.2",
    }
    return _at_all_steps(
        facts,
        curves,
        lambda run: run.pose_sys > _bound(),
        f"farther than {bound:g} mm",
        "Reproduced if |X_sys - X_meas| over wrist and gripper is larger at every step of every run.",
    )


def _at_bound(curves: Curves) -> Claim:
    bound = 1e3 * _bound()
    facts: dict[str, Any] = {
        "claim": "The estimate is always as far from the measured pose as ε_pose,bound lets it be",
        "published": f"always {bound:g} mm, at all step sizes and steps",
        "where": "sec. 5.2, figs. 10, 19, 21",
    }
    return _at_all_steps(
        facts,
        curves,
        lambda run: np.abs(run.pose_est - _bound()) <= _AT_BOUND * _bound(),
        f"at {bound:g} mm",
        f"Reproduced if |X_est - X_meas| over wrist and gripper is within {_AT_BOUND:.0%} of the bound at every step "
        "of every run. Where the model of the command is nearer than the bound, the estimate is that model and as "
        "near.".replace("%", " %"),
    )


def _at_all_steps(
    facts: dict[str, Any], curves: Curves, is_so: Callable[[RunCurves], Any], what: str, rule: str
) -> Claim:
    """Judge that something is so at all steps; the reason says at which steps of the runs it is not."""
    every = [run for runs in curves.values() for run in runs]
    if not every:
        return too_few(facts, "no run has a record")
    known = [~np.isnan(run.pose_sys) for run in every]
    so = [np.asarray(is_so(run), dtype=bool) for run in every]
    k, n = sum(int((x & y).sum()) for x, y in zip(so, known, strict=True)), sum(int(y.sum()) for y in known)
    failing = np.concatenate([np.flatnonzero(~x & y) for x, y in zip(so, known, strict=True)])
    where = ""
    if k < n:
        where = (
            f" It is not so at {counted(n - k, 'step')}, the last of which is number {failing.max() + 1} of its run."
        )
    return Claim(
        **facts,
        measured=f"{what} at {k} of {counted(n, 'step')}",
        verdict=verdict_of(k == n, could_be_either=len(every) >= MIN_FOR_EVERY),
        reason=with_shortfall(rule + where, len(every), MIN_FOR_EVERY),
    )


def _bound() -> float:
    return float(paper_values("helix", "thesis")["epsilon_pose_bound"])


def _known(values: Floats) -> Floats:
    return values[~np.isnan(values)]


def _short(by_alpha: Mapping[float, Sequence[Any] | Floats], least: int) -> str:
    """Return, in words, at which step size there are too few values; "" if there are enough."""
    few = [f"{counted(len(x), 'run')} at step size {alpha}" for alpha, x in by_alpha.items() if len(x) < least]
    return ", ".join(few)
