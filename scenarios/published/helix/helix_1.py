"""Table 1 of [Vervloet2025]: how long the Helix takes to reach a ball by step size, and whether it takes it.

Besides its figs. 7 to 10 and 16 to 21: error, model of the command and estimated state over time.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter
from scipy.stats import page_trend_test, ttest_ind_from_stats

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import SOFT, Drawable, Mark, Panel, Spans, drawn
from handover.scenarios.published.helix.helix_1_curves import (
    curve_claims,
    curves_of,
    draw_curves,
    draw_errors,
    draw_single_errors,
)
from handover.scenarios.published.helix.helix_1_spread import (
    CASES,
    FITTED,
    NOTHING,
    PRINTED,
    draw_spread,
    spread_claims,
    spread_tables,
)
from handover.scenarios.published.helix.helix_cases import Case, ends_near
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Point, Row, Runs, is_done
from handover.scenarios.published.tables import number, of, span, table_of
from handover.scenarios.published.verdicts import every_claim, format_median, format_p_value, ratio_interval
from handover.scenarios.robots.helix.evaluation import FIG_9_RESOLUTION
from handover.scenarios.robots.helix.parameters import HandPlace, Tuning, settings_of
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import LEVEL, MIN_SAMPLES, RESAMPLES, Statistic, time_interval
from handover.scenarios.runs.campaign.table import CampaignTable

_SETUP = paper_values("helix", "experiment")
ALPHAS: Sequence[float] = _SETUP["alpha"]
"""The step sizes, ascending."""
_PERIODS = dict(zip(ALPHAS, PRINTED["timestep_mean"], strict=True))
"""What the thesis's loop took at each, s: our control period."""
_PATIENCE = 600.0
"""Time by which the gripper must begin to close, s: as long as the scenario allows; the longest published is 214.9."""
_QUICK_PLACES = (HandPlace.FRONT, HandPlace.LEFT, HandPlace.BACK_LEFT)
"""Where a quick plan offers the ball: as many places as a bootstrap needs values (`MIN_SAMPLES`)."""


class Helix1(PublishedExperiment):
    """Three step sizes, four places, two runs each, with the thesis's settings; and the same with ours beside it.

    The claims are judged on the runs with the thesis's settings. The control period is what the thesis's loop took at
    each step size. At the smallest step size, whose times the thesis has widely spread, there are runs with one thing
    wrong at a time. On an arm that is fitted to fig. 9 all step sizes are tried again. The quick plan is a run with the
    thesis's settings at each of three places: three minutes on two cores.
    """

    name: ClassVar[str] = "helix-1"
    title: ClassVar[str] = "the Helix takes a ball at four places with three step sizes ([Vervloet2025] table 1)"
    scenario: ClassVar[str] = "helix_handover"

    def plan(self, quick: bool) -> CampaignPlan:
        """Return alpha x place for the thesis's settings and ours, and what may spread the times; if quick, a part."""
        tunings, places = ((Tuning.THESIS,), _QUICK_PLACES) if quick else ((Tuning.THESIS, Tuning.OWN), HandPlace)
        tried = [*product(tunings, (NOTHING,), ALPHAS, places)]
        if not quick:
            spread = product((Tuning.THESIS,), CASES, ALPHAS, HandPlace)
            tried += [case for case in spread if case[2] == ALPHAS[0] or case[1] is FITTED]
        return self.campaign(
            [_point(tuning, alpha, case, place) for tuning, case, alpha, place in tried],
            fixed={"patience": str(_PATIENCE), "help_speed": str(_SETUP["help_speed"])},
            repetitions=1 if quick else int(PRINTED["runs"]) // len(_SETUP["places"]),
            seed=1,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge table 1, its discussion and fig. 9 with the thesis's settings; those beyond are on other arms."""
        thesis, fitted, own = self.arms(table)
        on_fitted = _on_fitted_arm([*_rates(fitted), *_times(fitted)]) if fitted.tried else []
        judged = [*_rates(thesis), *_times(thesis), _mismatch(thesis), _timestep(thesis)]
        return [*judged, *on_fitted, *_own_claims(thesis, own), *spread_claims(self.spread(table))]

    def record_claims(self, table: CampaignTable, runs: Path) -> Sequence[Claim]:
        """Judge what secs. 4.2, 5.1 and 5.2 say of the curves of figs. 8 to 10, with the thesis's settings."""
        thesis, fitted, _ = self.arms(table)
        on_fitted = _on_fitted_arm(curve_claims(curves_of(fitted.rows, runs))) if fitted.tried else []
        return [*curve_claims(curves_of(thesis.rows, runs)), *on_fitted]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return table 1, its steps, its times by place and the lengths of fig. 9; and what spreads the times."""
        arms = [arm for arm in self.arms(table) if arm.tried]
        of_arms = [made for arm in arms for made in (_table_1(arm), _steps(arm), _by_place(arm), _fig_9(arm))]
        return [*of_arms, *spread_tables(self.spread(table))]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:
        """Draw the times by step size, and figs. 7 to 10 and 16 to 21: errors, model and estimate over time."""
        arms = [arm for arm in self.arms(table) if arm.tried]
        figures = [*_draw_times(arms, folder), *draw_errors({arm.title: arm.rows for arm in arms}, runs, folder)]
        for arm in arms:
            if arm.tuning is Tuning.THESIS:
                words, bound = (arm.title, arm.suffix), settings_of(arm.tuning)["epsilon_pose_bound"]
                figures += draw_single_errors(arm.rows, words, runs, folder)
                figures += draw_curves(curves_of(arm.rows, runs), words, bound, folder)
        return [*figures, *draw_spread(self.spread(table), folder)]

    def arms(self, table: CampaignTable) -> tuple["Arm", "Arm", "Arm"]:
        """Return the runs with the thesis's settings, the same on the arm fitted to fig. 9, and those with ours."""
        tried = self.runs(table, lambda _: True, free=("place",))
        kinds = ((Tuning.THESIS, NOTHING), (Tuning.THESIS, FITTED), (Tuning.OWN, NOTHING))
        thesis, fitted, own = (Arm.of(tried, *kind) for kind in kinds)
        return thesis, fitted, own

    def spread(self, table: CampaignTable) -> dict[Case, Runs]:
        """Return the runs at the smallest step size by disturbance, first those without; nothing without a case."""
        runs = self.runs(table, free=("place",))
        found = {case: runs.of(_point(Tuning.THESIS, ALPHAS[0], case)) for case in (NOTHING, *CASES)}
        found = {case: rows for case, rows in found.items() if len(rows)}
        return found if found.keys() - {NOTHING} else {}


def _point(tuning: Tuning, alpha: float, case: Case, place: HandPlace | None = None) -> Point:
    given = {"tuning": tuning.name.lower(), "alpha": str(alpha), "control_period": str(_PERIODS[alpha])}
    return {**given, **({} if place is None else {"place": place.name.lower()}), **case.parameters}


@dataclass(frozen=True)
class Arm:
    """Runs that came to their end with one tuning on one arm, by step size.

    Attributes:
        tuning: the settings.
        rows: by alpha, in the plan's order: by place, then repetition.
        broken: how many a unit's failure, a crash or a lost worker ended: they do not count.
        fitted: whether arm and ball's place are those fitted to fig. 9.
    """

    tuning: Tuning
    rows: Mapping[float, Runs]
    broken: int
    fitted: bool

    @classmethod
    def of(cls, runs: Runs, tuning: Tuning, case: Case) -> "Arm":
        """Pick the runs of a tuning on an arm."""
        tried = {alpha: runs.of(_point(tuning, alpha, case)) for alpha in ALPHAS}
        done = {alpha: found.where(is_done) for alpha, found in tried.items()}
        broken = sum(map(len, tried.values())) - sum(map(len, done.values()))
        return cls(tuning, done, broken, case is FITTED)

    @property
    def title(self) -> str:
        """Whose settings, and on which arm, in words."""
        settings = "with the thesis's settings" if self.tuning is Tuning.THESIS else "with our settings"
        return f"{settings}, arm fitted to fig. 9" if self.fitted else settings

    @property
    def suffix(self) -> str:
        """What is added to the name of a figure that there is for more than one arm."""
        return "_fitted" if self.fitted else ""

    @property
    def every(self) -> Runs:
        """All runs."""
        first, *others = self.rows.values()
        return first.together_with(*others)

    @property
    def tried(self) -> int:
        """Number of runs."""
        return len(self.every)

    def times(self, alpha: float) -> Floats:
        """Return the times until the gripper began to close, s, of the runs in which it did."""
        return self.rows[alpha].metric("arm_time")

    def fewest(self) -> int:
        """Return the least number of times at a step size."""
        return min(len(self.times(alpha)) for alpha in ALPHAS)

    def blocks(self) -> Floats:
        """Return times by (place, repetition) and alpha, shape (blocks, 3), s, of the blocks with a run at each alpha.

        A run in which the gripper never began to close took longer than any: infinity.
        """
        by_place = [{(row["place"], row["repetition"]): _time(row) for row in runs} for runs in self.rows.values()]
        shared = [key for key in by_place[0] if all(key in times for times in by_place)]
        return np.array([[times[key] for times in by_place] for key in shared]).reshape(-1, len(by_place))

    def missing(self, *alphas: float) -> str:
        """Return a sentence on how many runs have no time, as the gripper never began to close; "" if all have one."""
        left = sum(len(self.rows[alpha]) - len(self.times(alpha)) for alpha in alphas or ALPHAS)
        return f"Without {counted(left, 'run')} in which the gripper never began to close." if left else ""


def _time(row: Row) -> float:
    time = row.get("arm_time")
    return np.inf if time is None else float(time)


def _on_fitted_arm(claims: Sequence[Claim]) -> list[Claim]:
    """Return claims that were judged on runs with the arm fitted to fig. 9, as claims beyond the paper."""
    begin = "On the arm fitted to fig. 9: "
    return [replace(c, claim=f"{begin}{c.claim[0].lower()}{c.claim[1:]}", beyond=True) for c in claims]


def _rates(arm: Arm) -> list[Claim]:
    k, n = PRINTED["success"]
    closed = len(arm.every.metric("arm_time"))
    return [
        every_claim("The arm reaches the ball and the gripper begins to close in every run", "sec. 4", (k, n),
                    (closed, arm.tried), _broken(arm)),
        every_claim("Every handover succeeds", "sec. 4", (k, n), arm.every.count, _broken(arm)),
    ]  # fmt: skip


def _broken(arm: Arm) -> str:
    return f"Not counted: {counted(arm.broken, 'run')} that did not come to an end." if arm.broken else ""


def _times(arm: Arm) -> list[Claim]:
    """Judge order, ratios, means and spreads of the times until the gripper begins to close."""
    halved = [_halves(arm, small, large) for small, large in pairwise(ALPHAS)]
    return [_falls(arm), *halved, _halves_unevenly(arm), *(_takes(arm, alpha) for alpha in ALPHAS), _narrows(arm)]


def _falls(arm: Arm) -> Claim:
    theirs = " > ".join(f"{m:.1f}" for m in PRINTED["arm_time_median"]) + " s (medians)"
    says, blocks = Statement("The arm's time falls with the step size", "table 1, sec. 5.1", theirs), arm.blocks()
    if len(blocks) < 2:
        return says.unknown(f"Too few runs: {len(blocks)} places with runs at every step size.")
    p, ours = float(page_trend_test(blocks[:, ::-1], method="exact").pvalue), np.median(blocks, axis=0)
    return says.judged(
        ", ".join(f"{m:.1f}" if np.isfinite(m) else "never" for m in ours) + " s (medians)",
        bool(np.all(ours[:-1] > ours[1:])) and p < LEVEL,
        f"the medians fall, and Page's exact test of a trend within places rejects: p = {format_p_value(p)}, "
        f"{counted(len(blocks), 'pair')} of place and repetition",
        "A run that never closes the gripper counts as longer than any.",
    )


def _halves(arm: Arm, small: float, large: float) -> Claim:
    a, b = (PRINTED["arm_time_median"][ALPHAS.index(alpha)] for alpha in (small, large))
    half, x, y = PRINTED["halving"], arm.times(small), arm.times(large)
    says = Statement(
        f"Doubling the step size from {small} to {large} about halves the arm's time",
        "sec. 5.1",
        f"{a / b:.2f} times (medians)",
    )
    interval = ratio_interval(x, y, np.median) if min(len(x), len(y)) >= MIN_SAMPLES else None
    if interval is None:
        return says.unknown(f"Too few runs: {len(x)} and {len(y)}.")
    halves, stays = (interval[0] <= ratio <= interval[1] for ratio in (half, 1.0))
    return says.judged(
        f"{np.median(x) / np.median(y):.2f} times (medians)",
        halves,
        f"the bootstrap's interval of the ratio of medians holds {half:g} and not 1; not comparable if it holds both",
        arm.missing(small, large),
        enough=not (halves and stays),
        interval=interval,
    )


def _halves_unevenly(arm: Arm) -> Claim:
    a, b, c = PRINTED["arm_time_median"]
    says = Statement(
        "Doubling the smallest step size shortens the arm's time by more than doubling the middle one",
        "sec. 5.1",
        f"{a / b:.2f} against {b / c:.2f} times (medians)",
    )
    if arm.fewest() < MIN_SAMPLES:
        return says.unknown(f"Too few runs: {arm.fewest()} at a step size.")
    times = [arm.times(alpha) for alpha in ALPHAS]
    x, y, z = (float(np.median(t)) for t in times)
    rng = np.random.default_rng(0)
    small, middle, large = (np.median(t[rng.integers(len(t), size=(RESAMPLES, len(t)))], axis=-1) for t in times)
    low, high = (float(q) for q in np.quantile(small * large / middle**2, [LEVEL / 2, 1.0 - LEVEL / 2]))
    ratio = a * c / b**2
    return says.judged(
        f"{x / y:.2f} against {y / z:.2f} times (medians)",
        low > 1.0,
        "the bootstrap's interval of the first ratio over the second lies above 1; not comparable if it holds both 1 "
        f"and the published {ratio:.2f}",
        arm.missing(),
        enough=not (low <= 1.0 <= high and low <= ratio <= high),
        interval=(low, high),
    )


def _takes(arm: Arm, alpha: float) -> Claim:
    mean, std, median = (PRINTED[f"arm_time_{name}"][ALPHAS.index(alpha)] for name in ("mean", "std", "median"))
    says = Statement(
        f"At step size {alpha} the arm takes {mean} s on average", "table 1", f"{mean} ± {std} s (median {median} s)"
    )
    x = arm.times(alpha)
    interval = time_interval(x, np.mean)
    if interval is None:
        return says.unknown(f"Too few runs: {len(x)}.")
    ours = float(np.mean(x)), float(np.std(x, ddof=1))
    p = float(ttest_ind_from_stats(*ours, len(x), mean, std, PRINTED["runs"], equal_var=False).pvalue)
    return says.judged(
        f"{ours[0]:.1f} ± {ours[1]:.1f} s (median {np.median(x):.1f} s)",
        p >= LEVEL,
        f"Welch's test does not tell the two means apart: p = {format_p_value(p)}, {counted(len(x), 'run')} against "
        f"{PRINTED['runs']}",
        f"{arm.missing(alpha)} {_stall(arm, alpha)}".strip(),
        interval=interval,
        unit="s",
    )


def _stall(arm: Arm, alpha: float) -> str:
    """Return a sentence on a step size at which the error can stall above the threshold; "" for the others."""
    settings = settings_of(arm.tuning)
    stall = round(settings["epsilon_pose_bound"] / alpha, 6)
    if settings["epsilon_control"] > settings["epsilon_pose_bound"] or stall < settings["threshold_grasp"]:
        return ""
    return (
        f"At this step size the error can stall near ε_pose,bound / α = {1000 * stall:.0f} mm, the threshold: see the "
        "note on control steps."
    )


def _narrows(arm: Arm) -> Claim:
    theirs = " > ".join(f"{s:.1f}" for s in PRINTED["arm_time_std"]) + " s (standard deviations)"
    says = Statement("The spread of the arm's time falls with the step size", "table 1", theirs)
    if arm.fewest() < MIN_SAMPLES:
        return says.unknown(f"Too few runs: {arm.fewest()} at a step size.")
    times = [arm.times(alpha) for alpha in ALPHAS]
    interval, ours = ratio_interval(times[-1], times[0], _deviation), [float(_deviation(x)) for x in times]
    return says.judged(
        ", ".join(f"{s:.1f}" for s in ours) + " s (standard deviations)",
        all(a > b for a, b in pairwise(ours)) and interval is not None and interval[1] < 1.0,
        "the standard deviations fall and the bootstrap's interval of the ratio of the last to the first lies below 1",
        arm.missing(),
        interval=interval,
    )


def _deviation(values: Any, axis: int = -1) -> Any:
    return np.std(values, axis=axis, ddof=1)


def _mismatch(arm: Arm) -> Claim:
    named, alpha = ("model_mismatch", "arm_travel", "model_travel"), ALPHAS[0]
    says = Statement(
        "At the goal the model's gripper is far from the measured one",
        "sec. 5.2, fig. 9",
        "{:.2f} m (arm {:.2f} m, model {:.2f} m from the start)".format(*(PRINTED[n] for n in named)),
    )
    values = [arm.rows[alpha].metric(name) for name in named]
    interval = time_interval(values[0], np.mean)
    if interval is None:
        return says.unknown(f"Too few runs: {len(values[0])} at step size {alpha}.")
    low, high = interval.low - FIG_9_RESOLUTION, interval.high + FIG_9_RESOLUTION
    return says.judged(
        "{:.3f} m (arm {:.3f} m, model {:.3f} m from the start)".format(*map(np.mean, values)),
        False,
        "the interval of the mean, widened by the figure's resolution, held the published length; but stiffness and "
        "masses were chosen so, and it then is not comparable",
        "Where the ball is offered is assumed, and with it how far the arm goes.",
        enough=not low <= PRINTED["model_mismatch"] <= high,
        interval=interval,
        unit="m",
    )


def _timestep(arm: Arm) -> Claim:
    theirs = zip(PRINTED["timestep_mean"], PRINTED["timestep_std"], strict=True)
    periods = [p for runs in arm.rows.values() for p in sorted({row["control_period"] for row in runs})]
    says = Statement("A control step takes about 1.4 s", "table 1", ", ".join(f"{m} ± {s}" for m, s in theirs) + " s")
    return says.not_comparable(
        ", ".join(f"{p:.2f}" for p in periods) + " s (as set)",
        "The published time is what the thesis's program took to compute a step on its laptop; here it is the control "
        "period that runs are given.",
    )


def _own_claims(thesis: Arm, own: Arm) -> list[Claim]:
    """Judge this project's claims about its own settings, if there are runs with them."""
    if not own.tried:
        return []
    says = Statement("With our settings the gripper takes the ball nearer to its axis than with the thesis's")
    theirs, ours = (arm.every.metric("grasp_offset_lateral") for arm in (thesis, own))
    nearer = says.unknown(f"Too few runs: {len(theirs)} and {len(ours)} balls taken.")
    if min(len(theirs), len(ours)) >= MIN_SAMPLES:
        interval = ratio_interval(ours, theirs, np.median)
        nearer = says.judged(
            f"{np.median(ours):.4f} m against {np.median(theirs):.4f} m (medians)",
            interval is not None and interval[1] < 1.0,
            "the bootstrap's interval of the ratio of medians, ours to the thesis's, lies below 1",
            interval=interval,
        )
    sentence = "With our settings every handover succeeds"
    every = every_claim(sentence, "", (0, 0), own.every.count, _broken(own))
    return [every, nearer, ends_near("With our settings", own.every)]


_ON_EQUAL_BOUNDS = (
    " The thesis's ε_pose,bound and ε_control are both 5 mm. One iteration of the Jacobian loop leaves about "
    "ε_pose,bound, so that the last digits decide whether the loop goes on. Where it does, it takes that much back "
    "from the step, and the error stalls near ε_pose,bound / α: at α = 0.1 that is 50 mm, the threshold itself."
)
_ON_ASSUMED = (
    "The arm's stiffness and masses were chosen for these three lengths in one state at rest, and the ball's place is "
    "assumed: 0.19 m from there."
)
_ON_FITTED = (
    "The arm's axial stiffness and prestress were fitted to these lengths at α = 0.1, on average over the places, with "
    "the ball 0.16 m from there; times were not fitted, but known when arm and place were chosen."
)


def _table_1(arm: Arm) -> ComparisonTable:
    """Return the times for the arm's movement by step size, published beside ours."""

    def row(name: str, theirs: Sequence[Any], text: Callable[[float], str]) -> dict[str, str]:
        cells = [(f"{alpha} published", str(t), f"{alpha} ours", text(alpha))
                 for alpha, t in zip(ALPHAS, theirs, strict=True)]  # fmt: skip
        return {"α": name, **{head: cell for a, b, c, d in cells for head, cell in ((a, b), (c, d))}}

    def statistic(which: Statistic) -> Callable[[float], str]:
        return lambda alpha: number(arm.times(alpha), ".1f", which)

    def mean(alpha: float) -> str:
        x = arm.times(alpha)
        return f"{np.mean(x):.1f} ± {np.std(x, ddof=1):.1f}" if len(x) > 1 else number(x, ".1f", np.mean)

    def timestep(alpha: float) -> str:
        return ", ".join(sorted({f"{r['control_period']:.2f}" for r in arm.rows[alpha]}))

    medians = [format_median(arm.times(alpha), 1) for alpha in ALPHAS]
    every = [f"{PRINTED['runs']} of {PRINTED['runs']}"] * len(ALPHAS)
    return table_of(
        f"Table 1, {arm.title}",
        [
            row("Minimum", PRINTED["arm_time_min"], statistic(np.min)),
            row("Median", PRINTED["arm_time_median"], lambda alpha: format_median(arm.times(alpha), 1)),
            row("Maximum", PRINTED["arm_time_max"], statistic(np.max)),
            row("Mean", _plus_minus("arm_time"), mean),
            row("Timestep", _plus_minus("timestep"), timestep),
            row("Gripper began to close", every, lambda a: of((len(arm.times(a)), len(arm.rows[a])))),
            row("Handover succeeded", every, lambda alpha: of(arm.rows[alpha].count)),
        ],
        f"Time until the gripper begins to close, in s; the handover takes another 10 s.{_brackets(medians)} ±: "
        "standard deviation of the runs. Our time step is set, the published one is what computing took.",
    )


def _brackets(medians: Sequence[str]) -> str:
    """Return a sentence on the intervals of medians; "" where so few runs leave them none."""
    return " In brackets: 95 % interval by bootstrap." if any("(" in median for median in medians) else ""


def _plus_minus(name: str) -> list[str]:
    return [f"{v} ± {d}" for v, d in zip(PRINTED[f"{name}_mean"], PRINTED[f"{name}_std"], strict=True)]


def _steps(arm: Arm) -> ComparisonTable:
    """Return how many control steps the arm takes, which does not depend on the time of a step."""
    medians = [format_median(arm.rows[alpha].metric("steps"), 0) for alpha in ALPHAS]
    note = f"Published: times of table 1 over its mean time steps.{_brackets(medians)}"
    return table_of(
        f"Control steps, {arm.title}",
        [
            {
                "α": str(alpha),
                "published median": str(PRINTED["steps_median"][i]),
                "published range": "–".join(f"{PRINTED[f'arm_time_{end}'][i] / step:.0f}" for end in ("min", "max")),
                "our median": median,
                "our range": span(x, ".0f", "–"),
            }
            for i, ((alpha, step), median) in enumerate(zip(_PERIODS.items(), medians, strict=True))
            for x in [arm.rows[alpha].metric("steps")]
        ],
        note + (_ON_EQUAL_BOUNDS if arm.tuning is Tuning.THESIS else ""),
    )


def _by_place(arm: Arm) -> ComparisonTable:
    """Return the times at each place, which the paper does not give."""

    def at(place: HandPlace, alpha: float) -> str:
        here = [row for row in arm.rows[alpha] if row["place"] == place.name.lower()]
        times = ["never" if row.get("arm_time") is None else f"{row['arm_time']:.1f}" for row in here]
        return ", ".join(time if row["success"] else f"{time} ✗" for time, row in zip(times, here, strict=True))

    rows = [
        {"place": place.name.lower().replace("_", "-"), **{f"α = {alpha}": at(place, alpha) for alpha in ALPHAS}}
        for place in HandPlace
    ]
    note = "Time of each run until the gripper begins to close, in s."
    note += "" if all(arm.every.succeeded) else " ✗: the handover did not succeed."
    return table_of(f"Times by place, {arm.title}", rows, note)


def _fig_9(arm: Arm) -> ComparisonTable:
    """Return how far the model is from the arm at the end, in the words of sec. 5.2."""
    lengths = {"model to arm": "model_mismatch", "arm": "arm_travel", "model": "model_travel"}
    rows = [
        {
            "m": name,
            "α = 0.1, published": f"{PRINTED[metric]:.2f}",
            **{f"α = {alpha}, ours": number(runs.metric(metric), ".3f", np.mean) for alpha, runs in arm.rows.items()},
        }
        for name, metric in lengths.items()
    ]
    note = (
        "When the gripper begins to close, in m, means of the runs: gripper of the commanded state to the measured "
        f"one, and both from where the gripper hangs after calibration. {_ON_FITTED if arm.fitted else _ON_ASSUMED}"
    )
    return table_of(f"Model and arm as in fig. 9, {arm.title}", rows, note)


def _draw_times(arms: Sequence[Arm], folder: Path) -> list[Figure]:
    """Draw every run's time until the gripper begins to close beside the published minimum, median and maximum."""
    low, high = PRINTED["arm_time_min"], PRINTED["arm_time_max"]
    ours = [x for arm in arms for alpha in ALPHAS for x in arm.times(alpha).tolist()]
    limits = (0.85 * min(*ours, *low), 1.15 * max(*ours, *high)) if ours else (0.0, 0.0)
    panels: list[Panel] = []
    for arm in arms:
        spans = [(i - 0.2, low[i], high[i]) for i in range(len(ALPHAS))]
        marks: list[Drawable] = [Spans(spans, 0.22, "published: minimum to maximum")]
        for i, alpha in enumerate(ALPHAS):
            found = arm.rows[alpha].where(lambda row: row.get("arm_time") is not None)
            places, times = i + 0.2 + _beside(len(found)), found.metric("arm_time")
            held, median = np.array(found.succeeded, dtype=bool), PRINTED["arm_time_median"][i]
            marks += [
                Mark([i - 0.31, i - 0.09], [median] * 2, "-", SOFT, "published: median", style={"lw": 2.0}),
                Mark(places[held], times[held], "o", COLOURS[0], "our runs, ball taken"),
                Mark(places[~held], times[~held], "x", COLOURS[1], "our runs, ball not taken"),
                Mark([i + 0.08, i + 0.32], [np.median(times)] * 2 if len(times) else [np.nan] * 2, "-", COLOURS[0]),
            ]
        axes = {"title": arm.title.replace(", ", ",\n"), "xlabel": "step size α", "yscale": "log", "ylim": limits}
        axes |= {"ylabel": "time until the gripper begins to close (s)", "xlim": (-0.6, len(ALPHAS) - 0.4)}
        ticks = {float(t): str(t) for t in (10, 20, 50, 100, 200, 500) if limits[0] <= t <= limits[1]}
        panels.append(Panel([*marks, _NoMinor()], axes, {float(i): str(a) for i, a in enumerate(ALPHAS)}, ticks))
    caption = (
        "Time until the gripper begins to close, by step size, on a logarithmic axis: where the time halves as the "
        "step doubles, columns are equally far apart. Runs in which it never began to close are not there."
    )
    n = len(arms)
    return drawn(folder / "times", caption, panels if ours else [], n, size=(1.2 + 3.6 * n, 4.4), legend=min(n, 2))


def _beside(n: int) -> Floats:
    return 0.2 * (np.linspace(-0.5, 0.5, n) if n > 1 else np.zeros(n))


class _NoMinor:
    """Leaves minor ticks without texts."""

    def draw(self, axes: Axes) -> None:
        axes.yaxis.set_minor_formatter(NullFormatter())
