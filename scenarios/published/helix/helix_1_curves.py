"""Curves of a Helix run by its record, at its control steps: their means, claims about them, and their figures.

[Vervloet2025] figs. 7 to 10 and 16 to 21 show such means. How they are formed, sec. 4 says in part: "the length of
these average values will be the median length of the measurements". What becomes of a run that is shorter than that it
does not say. Here a mean is over the runs that are still under way, so beyond the end of the shorter ones over fewer: a
run that is over has no error any more, and its last one, held, would pull the mean to the threshold.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.stats import binomtest

from handover.controllers.helix.servo.constant_curvature import W_FROM_B, forward_kinematics
from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.controllers.helix.servo.visual_servo import Phase
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import SOFT, Band, Drawable, Mark, Panel, drawn, level, records_of, upright
from handover.scenarios.published.published_experiment import Claim
from handover.scenarios.published.runs import Row, Runs
from handover.scenarios.published.verdicts import MIN_FOR_EVERY, format_p_value, format_rate
from handover.scenarios.robots.helix.evaluation import FIG_9_RESOLUTION
from handover.scenarios.runs.campaign.statistics import LEVEL, MIN_SAMPLES, success_interval, time_interval

_PRINTED = paper_values("helix", "published")
_BOUND = float(paper_values("helix", "thesis")["epsilon_pose_bound"])
_MIN_SIGNS = next(n for n in range(1, 64) if 2.0 ** (1 - n) < LEVEL)
"""Runs that must all go one way for a sign test to reject."""
_AT_BOUND = 0.01
"""How near to a bound counts as at it, as a part of it: to no more digits a length can be read off a figure."""
_SIMILAR = 2 * FIG_9_RESOLUTION
"""How much two lengths, as of fig. 9, may differ that are called very similar, m."""
_ON_BALL = [int(phase) for phase in (Phase.DESCEND, Phase.GRASP, Phase.HOLD)]
_MODEL_SIGNALS = ("servo.q_sys", "servo.q_est", "servo.p_WO_est", "servo.p_WR_est", "servo.p_WG_est")


@dataclass(frozen=True, eq=False)
class RunCurves:
    """What a run's controller had at each of its steps, shape (steps,), m, until the gripper began to close.

    At a step it measures X_meas, estimates q_est from it and from the command q_sys that has been in force until then
    ([Vervloet2025] algorithm 3, lines 6 to 11), and changes the command. So X_sys = f(q_sys) is of the command before.
    Ways are distances of the gripper from where it hangs after calibration, [0, 0, -0.7] m. NaN before it is seen.

    Attributes:
        period: control period, s.
        error: |X_goal - X_meas| over wrist and gripper.
        descent: step at which the goal changed from above the ball to the ball; None if it never did.
        rise: by how much that change made the error larger, for the measurement of that step; NaN if it never did.
        way_meas: of the measured gripper.
        way_sys: of the gripper of the commanded state.
        way_est: of the gripper of the estimated state.
        apart_sys: gripper of the commanded state to the measured one.
        apart_est: gripper of the estimated state to the measured one.
        pose_sys: |X_sys - X_meas| over wrist and gripper, which the bound of eq. (16) is about.
        pose_est: |X_est - X_meas| likewise.
    """

    period: float
    error: Floats
    descent: int | None
    rise: float
    way_meas: Floats
    way_sys: Floats
    way_est: Floats
    apart_sys: Floats
    apart_est: Floats
    pose_sys: Floats
    pose_est: Floats

    @classmethod
    def of(cls, record: Record, steps: int, period: float) -> "RunCurves":
        """Read the curves of a run that took so many control steps."""
        servo = vars(ServoParams())
        d_gripper, offset = float(servo["d_gripper"]), float(servo["d_grasp_offset"])
        index = rows_of_steps(record, steps, period)
        phase: NDArray[np.int64] = np.asarray(record["servo.phase"][index], dtype=np.int64)
        seen: NDArray[np.bool_] = phase != int(Phase.WAIT)
        q_est: Floats = record["servo.q_est"][index]
        l_calib: list[float] = servo["l_calib"]
        q_calib = np.array([x for l in l_calib for x in (0.0, 0.0, l)])
        q_sys: Floats = np.vstack([q_calib, record["servo.q_sys"][index[:-1]]])
        X_meas: Floats = np.hstack([record["servo.p_WR_est"][index], record["servo.p_WG_est"][index]])
        X_sys, X_est = (W_FROM_B * np.array([forward_kinematics(q, d_gripper) for q in of]) for of in (q_sys, q_est))
        p_WG_calib = np.array([0.0, 0.0, -sum(l_calib) - d_gripper])
        error: Floats = record["servo.error"][index]
        descents: NDArray[np.int64] = np.flatnonzero(np.isin(phase, _ON_BALL))
        descent = int(descents[0]) if len(descents) else None
        rise = np.nan
        if descent is not None:
            p_WO: list[float] = record["servo.p_WO_est"][index[descent]].tolist()
            X_goal = np.array([*p_WO, *p_WO]) + np.array([0.0, 0.0, offset + d_gripper, 0.0, 0.0, offset])
            goal: Floats = X_goal - X_meas[descent]
            on_ball: Floats = goal - offset * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0])
            rise = float(np.linalg.norm(on_ball)) - float(np.linalg.norm(goal))

        def known(values: Floats) -> Floats:
            return np.where(seen, values, np.nan)

        def norms(differences: Floats) -> Floats:
            return known(np.linalg.norm(differences, axis=1))

        return cls(
            period=period,
            error=known(error),
            descent=descent,
            rise=rise,
            way_meas=norms(X_meas[:, 3:] - p_WG_calib),
            way_sys=norms(X_sys[:, 3:] - p_WG_calib),
            way_est=norms(X_est[:, 3:] - p_WG_calib),
            apart_sys=norms((X_sys - X_meas)[:, 3:]),
            apart_est=norms((X_est - X_meas)[:, 3:]),
            pose_sys=norms(X_sys - X_meas),
            pose_est=norms(X_est - X_meas),
        )


@dataclass(frozen=True, eq=False)
class MeanCurve:
    """Mean and standard deviation over runs, by control step; steps at which no run has a value are left out.

    Attributes:
        time: of the steps, s.
        mean: over the runs that are still under way.
        deviation: likewise, of these runs as a population.
        runs: how many they are.
    """

    time: Floats
    mean: Floats
    deviation: Floats
    runs: NDArray[np.int64]


def rows_of_steps(record: Record, steps: int, period: float) -> NDArray[np.int64]:
    """Return the row of a record at which each control step's results are in force: in the middle between two steps."""
    middle = (np.arange(steps, dtype=np.float64) + 0.5) * period
    after = np.asarray(np.searchsorted(record.time, middle), dtype=np.int64)
    return np.minimum(after, len(record.time) - 1)


Curves = Mapping[float, Sequence[RunCurves]]
"""Curves of runs by step size."""


def curves_of(by_alpha: Mapping[float, Runs], runs: Path) -> Curves:
    """Return the curves of each run in which the gripper began to close and that has a record of all signals.

    Args:
        by_alpha: runs by step size.
        runs: where their folders are.
    """
    return {
        alpha: [
            RunCurves.of(record, round(row["steps"]), row["control_period"])
            for row, record in _records(found, runs)
            if all(signal in record for signal in _MODEL_SIGNALS)
        ]
        for alpha, found in by_alpha.items()
    }


def errors_of(found: Runs, runs: Path) -> list[Floats]:
    """Return the error at each control step, m, of each run that has a record, until the gripper began to close."""
    errors: list[Floats] = []
    for row, record in _records(found, runs):
        index = rows_of_steps(record, round(row["steps"]), row["control_period"])
        seen: NDArray[np.bool_] = record["servo.phase"][index] != int(Phase.WAIT)
        errors.append(np.where(seen, record["servo.error"][index], np.nan))
    return errors


def _records(found: Runs, runs: Path) -> list[tuple[Row, Record]]:
    closed = [row for row in found if row.get("arm_time") is not None]
    return [(row, record) for row in closed for record in records_of([row["run"]], runs)]


def mean_curve(curves: Sequence[Floats], period: float) -> MeanCurve:
    """Return mean and deviation of curves of one control period, s, up to their median length."""
    length = int(np.median([len(curve) for curve in curves]))
    padded = np.full((len(curves), length), np.nan)
    for line, curve in zip(padded, curves, strict=True):
        line[: len(curve)] = curve[:length]
    count: NDArray[np.int64] = np.sum(~np.isnan(padded), axis=0)
    known: NDArray[np.int64] = np.flatnonzero(count)
    return MeanCurve(
        time=np.asarray(period * known, dtype=np.float64),
        mean=np.nanmean(padded[:, known], axis=0),
        deviation=np.nanstd(padded[:, known], axis=0),
        runs=count[known],
    )


def curve_claims(curves: Curves) -> list[Claim]:
    """Judge secs. 4.2, 5.1 and 5.2: how the error falls, and how far model and estimate are from what is measured.

    Each rule was laid down from the thesis's words before the runs were looked at.
    """
    bound = 1e3 * _BOUND
    return [
        _slows(curves),
        _jumps(curves),
        _roughens(curves),
        _starts_off(curves),
        _grows(curves),
        _alike(curves),
        _at_all_steps(
            Statement("The model of the command is always farther from the measured pose than ε_pose,bound", "sec. 5.2",
                      "always, at all steps"),
            curves,
            lambda run: run.pose_sys > _BOUND,
            f"farther than {bound:g} mm",
            "|X_sys - X_meas| over wrist and gripper is larger at every step of every run",
        ),
        _at_all_steps(
            Statement("The estimate is always as far from the measured pose as ε_pose,bound lets it be",
                      "sec. 5.2, figs. 10, 19, 21", f"always {bound:g} mm, at all step sizes and steps"),
            curves,
            lambda run: np.abs(run.pose_est - _BOUND) <= _AT_BOUND * _BOUND,
            f"at {bound:g} mm",
            f"|X_est - X_meas| over wrist and gripper is within {100 * _AT_BOUND:.0f} % of the bound at every step of "
            "every run",
        ),
    ]  # fmt: skip


def _slows(curves: Curves) -> Claim:
    says = Statement(
        "At every step size the error falls the faster the larger it is",
        "sec. 5.1, fig. 8",
        "so in fig. 8 (no figures)",
    )
    ratios = {alpha: _halves(runs) for alpha, runs in curves.items()}
    if short := _short(ratios, _MIN_SIGNS):
        return says.unknown(f"Too few runs: {short}; it takes {_MIN_SIGNS} for a sign test to reject.")
    ps = [float(binomtest(int(np.sum(x > 1.0)), len(x)).pvalue) for x in ratios.values()]
    return says.judged(
        ", ".join(f"{np.median(x):.1f}" for x in ratios.values()) + " times as long (medians)",
        all(p < LEVEL and np.median(x) > 1.0 for p, x in zip(ps, ratios.values(), strict=True)),
        "on the way to the first goal the error takes longer for the second half of its fall than for the first at "
        f"each step size, by a sign test over the runs: p = {', '.join(map(format_p_value, ps))}",
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
    says = Statement(
        "The error rises at the change from the first goal to the second",
        "sec. 5.1",
        "it suddenly increases slightly (no figures)",
    )
    rises = np.array([run.rise for runs in curves.values() for run in runs if run.descent is not None])
    if not len(rises):
        return says.unknown("Too few runs: none came to the second goal.")
    k, n = int(np.sum(rises > 0.0)), len(rises)
    spread = f"{1e3 * np.median(rises):.0f} mm in the median, {1e3 * rises.min():.0f} to {1e3 * rises.max():.0f} mm"
    return says.judged(
        f"in {format_rate(k, n)}; by {spread}",
        k == n,
        "it does in every run, with the measurement of the step at which the goal changes, over wrist and gripper",
        "Both goals are 50 mm apart; the arm that hangs below its first goal is nearer to the second.",
        runs=(n, MIN_FOR_EVERY),
        interval=success_interval(k, n),
    )


def _roughens(curves: Curves) -> Claim:
    says = Statement(
        "The average error falls smoothly at first, and more roughly later",
        "sec. 5.1, fig. 8",
        "so in fig. 8 (no figures)",
    )
    parts = [_roughness(runs) for runs in curves.values()]
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        return says.unknown("At a step size the average has no three steps before, or after, the first new goal.")
    return says.judged(
        "; ".join(f"{before:.1f} then {after:.1f}" for before, after in known),
        all(before < after for before, after in known),
        "the mean size of the average's second differences over that of the first is larger after the first of the "
        "runs changes its goal than before, at each step size",
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
    says = Statement(
        "At the start the measured gripper is not where the calibrated arm should have it",
        "sec. 5.2, fig. 9",
        "so in fig. 9 (no figures)",
    )
    starts = np.array([_known(run.way_meas)[0] for runs in curves.values() for run in runs])
    interval = time_interval(starts, np.mean)
    if interval is None:
        return says.unknown(f"Too few runs: {len(starts)} with a record.")
    return says.judged(
        f"{1e3 * np.mean(starts):.1f} mm away on average",
        interval.low > FIG_9_RESOLUTION,
        f"the interval of the mean lies above {1e3 * FIG_9_RESOLUTION:.0f} mm, the resolution of fig. 9",
        "Here the tendons' zeros are exact: what is left are the cameras' calibration and the measurement.",
        interval=interval,
        unit="m",
    )


def _grows(curves: Curves) -> Claim:
    says = Statement(
        "The farther the arm has gone, the farther is the model of the command from it",
        "sec. 5.2",
        "so in figs. 9, 18, 20 (no figures)",
    )
    ranks = {alpha: np.array([_rank(run.way_meas, run.apart_sys) for run in runs]) for alpha, runs in curves.items()}
    if short := _short(ranks, MIN_SAMPLES):
        return says.unknown(f"Too few runs: {short}.")
    intervals = [time_interval(x, np.mean) for x in ranks.values()]
    lows = [x.min() if i is None else i.low for i, x in zip(intervals, ranks.values(), strict=True)]
    return says.judged(
        ", ".join(f"{np.mean(x):.2f}" for x in ranks.values()) + " (Spearman's rank correlations)",
        min(lows) > 0.0,
        "the bootstrap's interval of the mean over runs of Spearman's rank correlation, of the measured gripper's way "
        "and its distance from the model's, lies above 0 at each step size",
    )


def _rank(x: Floats, y: Floats) -> float:
    """Return Spearman's rank correlation of the values that are known; 0 where one of them never changes."""
    known = ~np.isnan(x) & ~np.isnan(y)
    if not np.ptp(x[known]) or not np.ptp(y[known]):
        return 0.0
    result: Any = stats.spearmanr(x[known], y[known])
    return float(result.statistic)


def _alike(curves: Curves) -> Claim:
    says = Statement(
        "The model's mismatch at the end is very similar at all step sizes",
        "sec. 4.2, figs. 9, 18, 20",
        "very similar (no figures)",
    )
    ends = {alpha: np.array([_known(run.apart_sys)[-1] for run in runs]) for alpha, runs in curves.items()}
    if short := _short(ends, MIN_SAMPLES):
        return says.unknown(f"Too few runs: {short}.")
    means = [float(np.mean(x)) for x in ends.values()]
    return says.judged(
        ", ".join(f"{1e3 * m:.0f}" for m in means) + f" mm (α = {', '.join(map(str, curves))})",
        bool(np.ptp(means) <= _SIMILAR),
        f"the means over the runs differ by no more than {1e3 * _SIMILAR:.0f} mm, twice the resolution of such lengths",
    )


def _at_all_steps(says: Statement, curves: Curves, is_so: Callable[[RunCurves], Any], what: str, rule: str) -> Claim:
    """Judge that something is so at all steps."""
    every = [run for runs in curves.values() for run in runs]
    if not every:
        return says.unknown("Too few runs: no run has a record.")
    known = [~np.isnan(run.pose_sys) for run in every]
    so = [np.asarray(is_so(run), dtype=bool) for run in every]
    k, n = sum(int((x & y).sum()) for x, y in zip(so, known, strict=True)), sum(int(y.sum()) for y in known)
    failing = np.concatenate([np.flatnonzero(~x & y) for x, y in zip(so, known, strict=True)])
    note = f"The last step at which it is not so is number {failing.max() + 1} of its run." if k < n else ""
    return says.judged(f"{what} at {k} of {counted(n, 'step')}", k == n, rule, note, runs=(len(every), MIN_FOR_EVERY))


def _known(values: Floats) -> Floats:
    return values[~np.isnan(values)]


def _short(by_alpha: Mapping[float, Sequence[Any] | Floats], least: int) -> str:
    """Return, in words, at which step size there are too few values; "" if there are enough."""
    return ", ".join(
        f"{counted(len(x), 'run')} at step size {alpha}" for alpha, x in by_alpha.items() if len(x) < least
    )


_OVER_RUNS = "Mean of the runs still under way, up to the median length, with their standard deviation."
_SEEN = "Distance to the goal that the controller sees, over wrist and gripper, until the gripper begins to close"
_ERROR = {"xlabel": "time (s)", "ylabel": "error (mm)", "ylim": (0, None)}


def mean_mark(curves: Sequence[Floats], period: float, colour: str, label: str, form: str = "-") -> Mark:
    """Return the mean of curves, m, in mm, with a band of one standard deviation to either side."""
    of = mean_curve(curves, period)
    return Mark(of.time, 1000 * of.mean, form, colour, label, band=1000 * of.deviation, style={"lw": 2.0})


def error_marks(errors: Sequence[Floats], period: float, colour: str, label: str) -> list[Mark]:
    """Return the errors of runs, thin, and their mean."""
    thin = {"lw": 0.6, "alpha": 0.4}
    runs = [Mark(period * np.arange(len(e)), 1000 * e, "-", colour, style=thin) for e in errors]
    return [*runs, mean_mark(errors, period, colour, label)]


def draw_errors(arms: Mapping[str, Mapping[float, Runs]], runs: Path, folder: Path) -> list[Figure]:
    """Draw the mean error over time with its deviation, by step size and settings, as in fig. 8."""
    panels: list[Panel] = []
    for title, by_alpha in arms.items():
        marks: list[Drawable] = [Mark(form="^", label="published medians of the times", style={"ms": 7})]
        found = {alpha: errors_of(of_alpha, runs) for alpha, of_alpha in by_alpha.items()}
        for i, (alpha, errors) in enumerate(found.items()):
            if errors:
                period = by_alpha[alpha].rows[0]["control_period"]
                marks.append(mean_mark(errors, period, COLOURS[i], f"α = {alpha}"))
            style = {"ms": 7, "clip_on": False, "zorder": 5}
            marks.append(Mark([_PRINTED["arm_time_median"][i]], [0.0], "^", COLOURS[i], style=style))
        panels += [Panel(marks, {"title": title, "xlim": (0, None), **_ERROR})] if any(found.values()) else []
    size = (8.0, 1.0 + 2.9 * len(panels))
    return drawn(folder / "errors", f"{_SEEN}, like fig. 8. {_OVER_RUNS}", panels, size=size, legend=4)


def draw_single_errors(
    by_alpha: Mapping[float, Runs], words: tuple[str, str], runs: Path, folder: Path
) -> list[Figure]:
    """Draw every run's error over time with mean and deviation, a panel a step size, as in figs. 7, 16 and 17.

    Args:
        by_alpha: runs by step size.
        words: whose settings they are, and what is added to the figure's name.
        runs: where the folders of the runs are.
        folder: where the figure goes.
    """
    panels: list[Panel] = []
    for i, (alpha, found) in enumerate(by_alpha.items()):
        if errors := errors_of(found, runs):
            low, high = _PRINTED["arm_time_min"][i], _PRINTED["arm_time_max"][i]
            longest = max(float(found.metric("arm_time").max()), high)
            marks: list[Drawable] = [
                Band(low, high, "published: when the runs ended"),
                upright(_PRINTED["arm_time_median"][i], SOFT, "published: median of the times"),
                *error_marks(errors, found.rows[0]["control_period"], COLOURS[i], ""),
                Mark(label="mean of our runs, with deviation", style={"lw": 2.0}),
                Mark(label="our runs", style={"lw": 0.6}),
            ]
            title = f"α = {alpha}, as fig. {(7, 16, 17)[i]}"
            panels.append(Panel(marks, {"title": title, "xlim": (0, 1.02 * longest), **_ERROR}))
    title, suffix = words
    caption = f"{_SEEN}, like figs. 7, 16 and 17, {title}. {_OVER_RUNS} Grey: when the thesis's runs ended."
    size = (8.0, 0.8 + 2.3 * len(panels))
    return drawn(folder / f"single_errors{suffix}", caption, panels, size=size, legend=2)


def draw_curves(curves: Curves, words: tuple[str, str], bound: float, folder: Path) -> list[Figure]:
    """Draw the gripper by command and by estimate beside the measured one: figs. 9, 10 and 18 to 21.

    Args:
        curves: of runs that have a record, by step size.
        words: whose settings they are, and what is added to the figures' names.
        bound: of the estimate's distance, m.
        folder: where the figures go.
    """
    (title, suffix), model, estimate = words, list[Panel](), list[Panel]()
    axes = {"xlabel": "time (s)", "ylabel": "distance (mm)", "xlim": (0, None), "ylim": (0, None)}
    measured = "measured, from the start"
    for i, (alpha, runs) in enumerate(curves.items()):
        if not runs:
            continue
        period = runs[0].period

        def marked(name: str, k: int, label: str, form: str = "-", runs: Any = runs, period: float = period) -> Mark:
            return mean_mark([getattr(run, name) for run in runs], period, COLOURS[k], label, form)

        ends = (("model_travel", 0), ("arm_travel", 1), ("model_mismatch", 2)) if i == 0 else ()
        crosses = [
            Mark([_PRINTED["arm_time_median"][0]], [1000 * _PRINTED[name]], "x", COLOURS[k], style={"ms": 8, "mew": 2})
            for name, k in ends
        ]
        crosses += [Mark(form="x", label="published ends", style={"ms": 8, "mew": 2})] if crosses else []
        ways = [marked("way_sys", 0, "model of the command, from the start"), marked("way_meas", 1, measured),
                marked("apart_sys", 2, "model to measured")]  # fmt: skip
        model.append(Panel([*ways, *crosses], {"title": f"α = {alpha}, as fig. {(9, 18, 20)[i]}", **axes}))
        ways = [marked("way_est", 0, "estimate, from the start"), marked("way_meas", 1, measured, "--")]
        estimate.append(Panel(ways, {"title": f"α = {alpha}, as fig. {(10, 19, 21)[i]}", **axes}))
        apart = [marked("pose_est", 2, "over wrist and gripper"), marked("apart_est", 3, "of the gripper"),
                 level(1000 * bound, SOFT, "ε_pose,bound")]  # fmt: skip
        limits = {"ylim": (0, 1500 * bound)}
        estimate.append(Panel(apart, {**axes, "title": "estimate to measured", **limits}))
    of = f"their distances from where it hangs after calibration, and from each other, {title}. {_OVER_RUNS}"
    ends_drawn = bool(next(iter(curves.values()), ()))
    of_crosses = " Crosses: the ends of the thesis's curves, by sec. 5.2, at its median time." if ends_drawn else ""
    return [
        *drawn(folder / f"model{suffix}", "Gripper of the commanded state, f(q_sys), and measured one, like figs. 9, "
               f"18 and 20. Shown are {of}{of_crosses}",
               model, size=(8.0, 0.9 + 2.3 * len(model)), legend=2),
        *drawn(folder / f"estimate{suffix}", "Gripper of the estimated state, f(q_est), and measured one, like figs. "
               f"10, 19 and 21. Shown are {of}", estimate, 2, size=(9.0, 0.9 + 1.1 * len(estimate)), legend=3),
    ]  # fmt: skip
