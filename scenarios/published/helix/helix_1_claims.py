"""Claims about table 1 and fig. 9 of [Vervloet2025], judged on the runs of `helix-1`.

Each rule was laid down before the runs. `time_claims` are those about the arm's time; the others are about success, the
model's mismatch, and our own settings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import page_trend_test, ttest_ind_from_stats

from handover.scenarios.campaign.statistics import (
    LEVEL,
    MIN_SAMPLES,
    RESAMPLES,
    time_interval,
)
from handover.scenarios.experiment.display_unit import counted
from handover.scenarios.helix.evaluation import FIG_9_RESOLUTION
from handover.scenarios.helix.parameters import settings_of
from handover.scenarios.published.helix.helix_1_runs import Helix1Runs, missing, published, too_few
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import (
    MIN_FOR_EVERY,
    every_claim,
    format_p_value,
    ratio_interval,
    verdict_of,
    with_shortfall,
)

NEAR = 0.005
"""How near to the ball the gripper is to end, m."""


def thesis_claims(arm: Helix1Runs) -> list[Claim]:
    """Judge the thesis's claims on the runs with its settings."""
    return [_closes(arm), _succeeds(arm), *time_claims(arm), _mismatch(arm), _timestep(arm)]


def on_fitted_arm(claims: Sequence[Claim]) -> list[Claim]:
    """Return claims that were judged on runs with the arm fitted to fig. 9, as claims beyond the paper."""
    return [
        replace(claim, claim=f"On the arm fitted to fig. 9: {claim.claim[0].lower()}{claim.claim[1:]}", beyond=True)
        for claim in claims
    ]


def fitted_claims(arm: Helix1Runs) -> list[Claim]:
    """Judge what the thesis says of success and times on the arm fitted to fig. 9, if there are runs with it."""
    return on_fitted_arm([_closes(arm), _succeeds(arm), *time_claims(arm)]) if arm.tried else []


def own_claims(thesis: Helix1Runs, own: Helix1Runs) -> list[Claim]:
    """Judge this project's claims about its own settings, if there are runs with them."""
    if not own.tried:
        return []
    taken = [row for row in own.every if row["success"]]
    return [_own_success(own), _nearer(thesis, own), ends_near("With our settings", taken)]


def ends_near(when: str, taken: Sequence[Mapping[str, Any]]) -> Claim:
    """Judge how far the gripper is from the ball at the end of handovers that succeeded.

    Args:
        when: circumstances, in words, with which the claim begins.
        taken: rows of their runs.
    """
    facts: dict[str, Any] = {
        "claim": f"{when} the gripper ends within {1e3 * NEAR:.0f} mm of the ball",
        "published": "",
        "beyond": True,
    }
    distances = np.array([row["final_distance"] for row in taken if row.get("final_distance") is not None])
    if not len(distances):
        return too_few(facts, "no handover succeeded")
    return Claim(
        **facts,
        measured=f"{1e3 * np.median(distances):.1f} mm in the median, {1e3 * distances.max():.1f} mm at most",
        verdict=verdict_of(bool(distances.max() <= NEAR), could_be_either=len(distances) >= MIN_FOR_EVERY),
        reason=with_shortfall(
            f"Holds if each of the {len(distances)} handovers that succeeded ends so near, by ground truth.",
            len(distances),
            MIN_FOR_EVERY,
        ),
    )


def time_claims(arm: Helix1Runs) -> list[Claim]:
    """Judge order, ratios, means and spreads of the times until the gripper begins to close."""
    halved = [_halves(arm, small, large) for small, large in pairwise(arm.alphas)]
    return [_falls(arm), *halved, _halves_unevenly(arm), *(_takes(arm, alpha) for alpha in arm.alphas), _narrows(arm)]


def _falls(arm: Helix1Runs) -> Claim:
    medians = published()["arm_time_median"]
    facts: dict[str, Any] = {
        "claim": "The arm's time falls with the step size",
        "published": " > ".join(f"{m:.1f}" for m in medians) + " s (medians)",
        "where": "table 1, sec. 5.1",
    }
    blocks = arm.blocks()
    if len(blocks) < 2:
        return too_few(facts, f"{counted(len(blocks), 'place')} with runs at every step size")
    p = float(page_trend_test(blocks[:, ::-1], method="exact").pvalue)
    ours = np.median(blocks, axis=0)
    falls = bool(np.all(ours[:-1] > ours[1:])) and p < LEVEL
    return Claim(
        **facts,
        measured=", ".join(f"{m:.1f}" if np.isfinite(m) else "never" for m in ours) + " s (medians)",
        verdict=Verdict.REPRODUCED if falls else Verdict.NOT_REPRODUCED,
        reason=f"Reproduced if the medians fall, and Page's exact test of a trend within places rejects: p = "
        f"{format_p_value(p)}, {counted(len(blocks), 'pair')} of place and repetition. A run that "
        "never closes the gripper counts as longer than any.",
    )


def _halves(arm: Helix1Runs, small: float, large: float) -> Claim:
    medians, half = published()["arm_time_median"], published()["halving"]
    i, j = arm.alphas.index(small), arm.alphas.index(large)
    facts: dict[str, Any] = {
        "claim": f"Doubling the step size from {small} to {large} about halves the arm's time",
        "published": f"{medians[i] / medians[j]:.2f} times (medians)",
        "where": "sec. 5.1",
    }
    x, y = arm.times(small), arm.times(large)
    if min(len(x), len(y)) < MIN_SAMPLES:
        return too_few(facts, f"{counted(len(x), 'run')} and {len(y)}")
    interval = ratio_interval(x, y, np.median)
    if interval is None:
        return too_few(facts, "no times to divide by")
    low, high = interval
    halves, stays = low <= half <= high, low <= 1.0 <= high
    verdict = Verdict.REPRODUCED if halves else Verdict.NOT_REPRODUCED
    return Claim(
        **facts,
        measured=f"{np.median(x) / np.median(y):.2f} times (medians)",
        interval=interval,
        verdict=Verdict.NOT_COMPARABLE if halves and stays else verdict,
        reason=f"Reproduced if the bootstrap's interval of the ratio of medians holds {half:g} and not 1; not "
        f"comparable if it holds both, as the runs are then too few.{missing(arm, small, large)}",
    )


def _halves_unevenly(arm: Helix1Runs) -> Claim:
    medians = published()["arm_time_median"]
    ratio = medians[0] * medians[2] / medians[1] ** 2
    facts: dict[str, Any] = {
        "claim": "Doubling the smallest step size shortens the arm's time by more than doubling the middle one",
        "published": f"{medians[0] / medians[1]:.2f} against {medians[1] / medians[2]:.2f} times (medians)",
        "where": "sec. 5.1",
    }
    times = [arm.times(alpha) for alpha in arm.alphas]
    if min(map(len, times)) < MIN_SAMPLES:
        return too_few(facts, f"{counted(min(map(len, times)), 'run')} at a step size")
    ours = [float(np.median(x)) for x in times]
    low, high = _uneven_interval(times)
    holds_1 = low <= 1.0 <= high
    undecided = holds_1 and low <= ratio <= high
    return Claim(
        **facts,
        measured=f"{ours[0] / ours[1]:.2f} against {ours[1] / ours[2]:.2f} times (medians)",
        interval=(low, high),
        verdict=Verdict.NOT_COMPARABLE if undecided else (Verdict.REPRODUCED if low > 1.0 else Verdict.NOT_REPRODUCED),
        reason="Reproduced if the bootstrap's interval of the first ratio over the second lies above 1; not comparable "
        f"if it holds both 1 and the published {ratio:.2f}, as the runs are then too few."
        f"{missing(arm, *arm.alphas)}",
    )


def _uneven_interval(times: Sequence[Any]) -> tuple[float, float]:
    """Return the percentile interval of the first of three medians times the third over the second's square."""
    rng = np.random.default_rng(0)
    small, middle, large = (np.median(x[rng.integers(len(x), size=(RESAMPLES, len(x)))], axis=-1) for x in times)
    low, high = np.quantile(small * large / middle**2, [LEVEL / 2, 1.0 - LEVEL / 2])
    return float(low), float(high)


def _takes(arm: Helix1Runs, alpha: float) -> Claim:
    printed, i = published(), arm.alphas.index(alpha)
    mean, std, median = (printed[f"arm_time_{name}"][i] for name in ("mean", "std", "median"))
    facts: dict[str, Any] = {
        "claim": f"At step size {alpha} the arm takes {mean} s on average",
        "published": f"{mean} ± {std} s (median {median} s)",
        "where": "table 1",
    }
    x = arm.times(alpha)
    interval = time_interval(x, np.mean)
    if interval is None:
        return too_few(facts, counted(len(x), "run"))
    ours = float(np.mean(x)), float(np.std(x, ddof=1))
    p = float(ttest_ind_from_stats(*ours, len(x), mean, std, printed["runs"], equal_var=False).pvalue)
    return Claim(
        **facts,
        measured=f"{ours[0]:.1f} ± {ours[1]:.1f} s (median {np.median(x):.1f} s)",
        interval=(interval.low, interval.high),
        unit="s",
        verdict=Verdict.REPRODUCED if p >= LEVEL else Verdict.NOT_REPRODUCED,
        reason=f"Reproduced if Welch's test does not tell the two means apart: p = {format_p_value(p)}, "
        f"{counted(len(x), 'run')} against {printed['runs']}. The interval is the mean's ({interval.method})."
        f"{missing(arm, alpha)}{_stall(arm, alpha)}",
    )


def _stall(arm: Helix1Runs, alpha: float) -> str:
    """Return a sentence on a step size at which the error can stall above the threshold; "" for the others."""
    settings = settings_of(arm.tuning)
    stall = round(settings["epsilon_pose_bound"] / alpha, 6)
    if settings["epsilon_control"] > settings["epsilon_pose_bound"] or stall < settings["threshold_grasp"]:
        return ""
    return (
        f" At this step size the error can stall near ε_pose,bound / α = {1000 * stall:.0f} mm, the threshold, and the "
        "last digits of two equal bounds decide whether it does: see the note on control steps."
    )


def _narrows(arm: Helix1Runs) -> Claim:
    std = published()["arm_time_std"]
    facts: dict[str, Any] = {
        "claim": "The spread of the arm's time falls with the step size",
        "published": " > ".join(f"{s:.1f}" for s in std) + " s (standard deviations)",
        "where": "table 1",
    }
    times = [arm.times(alpha) for alpha in arm.alphas]
    if min(map(len, times)) < MIN_SAMPLES:
        return too_few(facts, f"{counted(min(map(len, times)), 'run')} at a step size")
    interval = ratio_interval(times[-1], times[0], _spread)
    ours = [float(np.std(x, ddof=1)) for x in times]
    narrows = all(a > b for a, b in pairwise(ours)) and interval is not None and interval[1] < 1.0
    return Claim(
        **facts,
        measured=", ".join(f"{s:.1f}" for s in ours) + " s (standard deviations)",
        interval=interval,
        verdict=Verdict.REPRODUCED if narrows else Verdict.NOT_REPRODUCED,
        reason="Reproduced if the standard deviations fall and the bootstrap's interval of the ratio of the last to "
        f"the first lies below 1.{missing(arm, *arm.alphas)}",
    )


def _spread(values: Any, axis: int = -1) -> Any:
    return np.std(values, axis=axis, ddof=1)


def _closes(arm: Helix1Runs) -> Claim:
    return _rate(arm, "The arm reaches the ball and the gripper begins to close in every run", arm.closed)


def _succeeds(arm: Helix1Runs) -> Claim:
    return _rate(arm, "Every handover succeeds", arm.succeeded)


def _rate(arm: Helix1Runs, claim: str, successes: int) -> Claim:
    k, n = published()["success"]
    return every_claim(claim, "sec. 4", (k, n), (successes, arm.tried), _broken(arm))


def _mismatch(arm: Helix1Runs) -> Claim:
    printed, alpha = published(), arm.alphas[0]
    named = ("model_mismatch", "arm_travel", "model_travel")
    facts: dict[str, Any] = {
        "claim": "At the goal the model's gripper is far from the measured one",
        "published": "{:.2f} m (arm {:.2f} m, model {:.2f} m from the start)".format(*(printed[n] for n in named)),
        "where": "sec. 5.2, fig. 9",
    }
    values = [arm.metric(name, alpha) for name in named]
    interval = time_interval(values[0], np.mean)
    if interval is None:
        return too_few(facts, f"{counted(len(values[0]), 'run')} at step size {alpha}")
    agrees = interval.low - FIG_9_RESOLUTION <= printed["model_mismatch"] <= interval.high + FIG_9_RESOLUTION
    return Claim(
        **facts,
        measured="{:.3f} m (arm {:.3f} m, model {:.3f} m from the start)".format(*map(np.mean, values)),
        interval=(interval.low, interval.high),
        unit="m",
        verdict=Verdict.NOT_COMPARABLE if agrees else Verdict.NOT_REPRODUCED,
        reason="The arm's stiffness and masses were chosen such that it is as far off as in fig. 9 in one state at "
        "rest, so that agreement would prove nothing and would not be comparable. Not reproduced if the interval of "
        f"the mean, widened by the figure's resolution of {FIG_9_RESOLUTION} m, leaves the published length out. Where "
        "the ball is offered is assumed, and with it how far the arm goes.",
    )


def _timestep(arm: Helix1Runs) -> Claim:
    mean, std = published()["timestep_mean"], published()["timestep_std"]
    periods = {alpha: sorted({row["control_period"] for row in arm.rows[alpha]}) for alpha in arm.alphas}
    return Claim(
        claim="A control step takes about 1.4 s",
        published=", ".join(f"{m} ± {s}" for m, s in zip(mean, std, strict=True)) + " s",
        measured=", ".join(f"{p:.2f}" for of_alpha in periods.values() for p in of_alpha) + " s (as set)",
        verdict=Verdict.NOT_COMPARABLE,
        reason="The published time is what the thesis's program took to compute a step on its laptop; here it is the "
        "control period that runs are given.",
        where="table 1",
    )


def _own_success(own: Helix1Runs) -> Claim:
    return every_claim(
        "With our settings every handover succeeds", "", (0, 0), (own.succeeded, own.tried), _broken(own)
    )


def _nearer(thesis: Helix1Runs, own: Helix1Runs) -> Claim:
    facts: dict[str, Any] = {
        "claim": "With our settings the gripper takes the ball nearer to its axis than with the thesis's",
        "published": "",
        "beyond": True,
    }
    theirs, ours = (
        np.concatenate([a.metric("grasp_offset_lateral", alpha) for alpha in a.alphas]) for a in (thesis, own)
    )
    if min(len(theirs), len(ours)) < MIN_SAMPLES:
        return too_few(facts, f"{len(theirs)} and {len(ours)} balls taken")
    interval = ratio_interval(ours, theirs, np.median)
    return Claim(
        **facts,
        measured=f"{np.median(ours):.4f} m against {np.median(theirs):.4f} m (medians)",
        interval=interval,
        verdict=Verdict.REPRODUCED if interval and interval[1] < 1.0 else Verdict.NOT_REPRODUCED,
        reason="Holds if the bootstrap's interval of the ratio of medians, ours to the thesis's, lies below 1.",
    )


def _broken(arm: Helix1Runs) -> str:
    return f"Not counted: {counted(arm.broken, 'run')} that did not come to an end." if arm.broken else ""
