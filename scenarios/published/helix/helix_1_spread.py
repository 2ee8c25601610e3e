"""What may spread the times at the smallest step size of [Vervloet2025] table 1: one thing at a time.

The thesis has times from 42.9 to 214.9 s there, and does not say why.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats
from scipy.stats import ttest_ind_from_stats

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.tendon_parameters import Params as ArmParams
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import SOFT, Band, Drawable, Mark, strips, upright
from handover.scenarios.published.helix.helix_cases import Case, levels_of
from handover.scenarios.published.published_experiment import Claim, ComparisonTable
from handover.scenarios.published.runs import Runs
from handover.scenarios.published.tables import median_and_range, of, table_of
from handover.scenarios.published.verdicts import format_p_value
from handover.scenarios.runs.campaign.statistics import LEVEL, MIN_SAMPLES

PRINTED = paper_values("helix", "published")


def _fitted() -> dict[str, str]:
    """Return what makes the arm and the ball's place agree with fig. 9, as texts."""
    values = paper_values("helix", "fitted_arm")
    of_arm = {"arm.EA": f"{values['EA']:g}", "arm.natural_length": ",".join(map(str, values["natural_length"]))}
    return {**of_arm, "radius": str(values["radius"]), "height": str(values["height"])}


NOTHING = Case("nothing", "", {})
FITTED = Case("arm fitted to fig. 9", "", _fitted())
"""Arm and ball's place as of `fit_arm`: fitted to fig. 9 at the step size 0.1, to no time; tried at all step sizes."""
CASES = (
    *levels_of("pictures lost", "%", "lost_pictures", {"60": "0.6", "80": "0.8"}, ()),
    *levels_of("hand's tremor", "mm", "tremor", {"10": "0.01"}, ()),
    *levels_of("hand's drift", "mm", "drift", {"30": "0.03"}, ()),
    *levels_of("jitter of the control period", "%", "jitter", {"30": "0.3"}, ()),
    Case("the thesis's detector", "", {"detector": "published"}),
    Case("ε_control", "4.5 mm", {"servo.epsilon_control": "0.0045"}),
    Case("arm's axial stiffness", "0.5 times", {"arm.EA": f"{0.5 * ArmParams().EA:g}"}),
    FITTED,
)
"""Each is larger than a steady hand and a working camera have it: the published time steps jitter by 2.5 % if they do
so evenly. ε_control parts two bounds of the controller that appendix A has equal, 5 mm: which of them is larger decides
whether the Jacobian loop goes on. An arm that is softer along its axis presses less on its tendons, so that some fall
slack as it lifts its gripper (sec. 5.2); that this makes long runs was known from `fit_arm` when it became a case."""


def spread_tables(found: Mapping[Case, Runs]) -> list[ComparisonTable]:
    """Return the times by disturbance beside the published ones; nothing if no such run is there."""
    if not found:
        return []
    mean, std, median, low, high = (PRINTED[f"arm_time_{x}"][0] for x in ("mean", "std", "median", "min", "max"))
    every = f"{PRINTED['runs']} of {PRINTED['runs']}"
    texts = ("published", "", every, every, f"{median} ({low} to {high})", f"{mean} ± {std}", "", "")
    rows = [_spread_row(case, runs) for case, runs in found.items()]
    note = (
        "One disturbance at a time, with the thesis's settings at its four places. p: of Welch's test that the mean, "
        "and of the F test that the standard deviation is the published one, of the published eight runs and ours; "
        "small where it cannot be. The F test takes times as normally distributed."
    )
    first = dict(zip(rows[0], texts, strict=True))
    return [table_of("What spreads the times at step size 0.1", [first, *rows], note)]


def _spread_row(case: Case, runs: Runs) -> dict[str, str]:
    times = runs.metric("arm_time")
    enough = len(times) >= MIN_SAMPLES
    p_mean, p_spread = map(format_p_value, _p_values(times)) if enough else ("", "")
    return {
        "disturbance": case.what,
        "size": case.size,
        "gripper began to close": of((len(times), len(runs))),
        "ball taken": of(runs.count),
        "time, median (range), s": median_and_range(times) or "never",
        "mean, s": f"{np.mean(times):.1f} ± {np.std(times, ddof=1):.1f}" if enough else "",
        "p, mean": p_mean,
        "p, spread": p_spread,
    }


def spread_claims(found: Mapping[Case, Runs]) -> list[Claim]:
    """Judge, beyond the paper, whether one of the cases makes times like the published ones; nothing without runs."""
    if not found:
        return []
    says = Statement("One of the disturbances makes the times at step size 0.1 those published")
    times = {case: runs.metric("arm_time") for case, runs in found.items() if case is not NOTHING}
    enough = {case: x for case, x in times.items() if len(x) >= MIN_SAMPLES}
    if not enough:
        return [says.unknown(f"Too few runs: no case has {MIN_SAMPLES} times.")]
    alike = [c.label for c, x in enough.items() if len(x) == len(found[c]) and min(_p_values(x)) >= LEVEL]
    claim = says.judged(
        ", ".join(alike) or f"none of {len(enough)}",
        bool(alike),
        "in a case the gripper closes in every run, and neither Welch's test of the means nor the F test of the "
        "standard deviations separates its times from the published ones",
    )
    return [claim]


def _p_values(times: Floats) -> tuple[float, float]:
    """Return p of Welch's test of the means and of the F test of the variances, two-sided, against the published."""
    n, (mean, std), theirs = len(times), (PRINTED[f"arm_time_{x}"][0] for x in ("mean", "std")), PRINTED["runs"]
    ours = float(np.std(times, ddof=1))
    welch: Any = ttest_ind_from_stats(float(np.mean(times)), ours, n, mean, std, theirs, equal_var=False)
    of_variances: Any = stats.f
    below = float(of_variances.cdf((ours / std) ** 2, n - 1, theirs - 1))
    return float(welch.pvalue), 2.0 * min(below, 1.0 - below)


def draw_spread(found: Mapping[Case, Runs], folder: Path) -> list[Figure]:
    """Draw every run's time by disturbance, beside the published range; nothing without such runs."""
    if not found:
        return []
    low, high, median = (PRINTED[f"arm_time_{name}"][0] for name in ("min", "max", "median"))
    cases: dict[str, Sequence[Drawable]] = {}
    for case, runs in found.items():
        marks: list[Drawable] = []
        for of_kind, form, colour, label in ((runs.successful, "o", COLOURS[0], "ball taken (bar: median of all)"),
                                             (runs.failed, "x", COLOURS[1], "ball not taken")):  # fmt: skip
            times = of_kind.metric("arm_time")
            marks.append(Mark(times, np.zeros(len(times)), form, colour, label))
        times = runs.metric("arm_time")
        bar = [Mark([np.median(times)] * 2, [-0.3, 0.3], "-", COLOURS[0], style={"lw": 2.0})] if len(times) else []
        cases[case.label] = [*marks, *bar]
    key: list[Drawable] = [
        Band(low, high, "published: shortest to longest"),
        upright(median, SOFT, "published: median"),
    ]
    caption = (
        "Times at the step size 0.1 with one disturbance at a time, with the thesis's settings, beside those that the "
        "thesis has. Runs in which the gripper never began to close are not there."
    )
    axes = {"xlabel": "time until the gripper begins to close (s)", "xlim": (0, None)}
    return strips(folder / "spread", caption, cases, axes, key, legend=2)
