"""Rules by which claims get their verdicts. They were laid down before the runs; every reason states its rule.

A verdict is given only if the runs could have led to either: where so few can never meet a rule, or never break it, the
claim is not comparable.

Besides: rates, intervals, medians and p-values as texts, and the bootstrap interval of a ratio.
"""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.runs.campaign.statistics import (
    LEVEL,
    RESAMPLES,
    Interval,
    Statistic,
    compatible_counts,
    paired_test,
    success_interval,
    time_interval,
    two_proportions,
)

FEW = 0.10
"""Share of runs below which something counts as not happening."""

MIN_FOR_EVERY = 4
"""Trials of which something is concluded that is to succeed every time."""

_MIN_DIFFERING = next(k for k in range(1, 64) if 2.0 ** (1 - k) < LEVEL)
"""Pairs that must differ, all in one direction, for McNemar's exact test to reject."""


def rate_claim(claim: str, where: str, published: tuple[int, int], measured: tuple[int, int]) -> Claim:
    """Judge a rate of success, each given as successes and trials.

    It is reproduced if Fisher's exact test of both counts, two-sided, does not reject at 5 % that the rates are equal.
    The reason states which counts the test would have let pass; if these are all counts, it is not comparable.
    """
    if not measured[1]:
        return nothing_measured(claim, where, format_rate(*published))
    ours, theirs = success_interval(*measured), success_interval(*published)
    p, n = two_proportions(*measured, *published), measured[1]
    low, high = compatible_counts(*published, n)
    power = f"any count of ours from {low} to {high} of {n} would have passed"
    if (low, high) == (0, n):
        power = f"with so few trials no count of ours out of {n} would have differed from theirs"
    reason = (
        f"Reproduced if Fisher's exact test of both counts does not reject at {format_share(LEVEL)} that the rates are "
        f"equal: p = {format_p_value(p)}. Their own interval is {format_interval(theirs.low, theirs.high)}; {power}."
    )
    return Claim(
        claim=claim,
        published=format_rate(*published),
        measured=format_rate(*measured),
        interval=(ours.low, ours.high),
        verdict=verdict_of(p >= LEVEL, could_be_either=(low, high) != (0, n)),
        reason=reason,
        where=where,
    )


def every_claim(claim: str, where: str, published: tuple[int, int], measured: tuple[int, int], note: str = "") -> Claim:
    """Judge that every trial succeeds: it is reproduced if ours all do; of fewer than four nothing is concluded.

    Beyond the paper, `published` is (0, 0), and it holds or not.
    """
    published_rate = format_rate(*published) if published[1] else ""
    if not measured[1]:
        return nothing_measured(claim, where, published_rate, beyond=not published[1])
    interval, all_do = success_interval(*measured), measured[0] == measured[1]
    rule = f"{'Reproduced' if published[1] else 'Holds'} if every run succeeds; the interval is Clopper and Pearson's."
    if published[1]:
        p = two_proportions(*measured, *published)
        rule += f" Fisher's exact test against the published rate: p = {format_p_value(p)}."
    return Claim(
        claim=claim,
        published=published_rate,
        measured=format_rate(*measured),
        interval=(interval.low, interval.high),
        verdict=verdict_of(all_do, could_be_either=measured[1] >= MIN_FOR_EVERY),
        reason=with_shortfall(f"{rule} {note}", measured[1], MIN_FOR_EVERY),
        where=where,
        beyond=not published[1],
    )


def order_claim(
    claim: str,
    where: str,
    published: str,
    first: Sequence[bool],
    second: Sequence[bool],
    note: str = "",
    beyond: bool = False,
) -> Claim:
    """Judge that a first way succeeds more often than a second, each tried in the same scenes, in the same order.

    It is reproduced if McNemar's exact test of the pairs, two-sided, rejects at 5 % that neither does better, and the
    first does better.
    """
    if not first:
        return nothing_measured(claim, where, published, beyond)
    test, n = paired_test(first, second), len(first)
    reason = (
        f"{'Holds' if beyond else 'Reproduced'} if McNemar's exact test of runs in the same scenes rejects at "
        f"{format_share(LEVEL)}, in this direction. Of {counted(n, 'pair')} only the first succeeded in "
        f"{test.only_first}, only the second in {test.only_second}: p = {format_p_value(test.p)}. {note}"
    )
    return Claim(
        claim=claim,
        published=published,
        measured=f"{format_rate(sum(first), n)} against {format_rate(sum(second), n)}",
        verdict=verdict_of(test.first_is_better, could_be_either=n >= _MIN_DIFFERING),
        reason=with_shortfall(reason, n, _MIN_DIFFERING),
        where=where,
        beyond=beyond,
    )


def no_worse_claim(claim: str, first: Sequence[bool], second: Sequence[bool]) -> Claim:
    """Judge, beyond the paper, that a first way does no worse than a second, each tried in the same scenes.

    It holds if the share of scenes in which only the second succeeds has an interval below 10 %. That a test of
    difference does not reject would not do: with few pairs it never does.
    """
    if not first:
        return nothing_measured(claim, "", "", beyond=True)
    test, n = paired_test(first, second), len(first)
    interval = success_interval(test.only_second, n)
    reason = (
        "Holds if the share of scenes in which only the second succeeds has an interval (Clopper-Pearson) below "
        f"{format_share(FEW)}. Of {counted(n, 'pair')} that is so in {test.only_second}, "
        f"{format_interval(interval.low, interval.high)}; the reverse in {test.only_first}; McNemar's p = "
        f"{format_p_value(test.p)}."
    )
    return Claim(
        claim=claim,
        published="",
        measured=f"{format_rate(sum(first), n)} against {format_rate(sum(second), n)}",
        interval=(interval.low, interval.high),
        verdict=verdict_of(interval.high < FEW, could_be_either=n >= min_trials_for(FEW)),
        reason=with_shortfall(reason, n, min_trials_for(FEW)),
        beyond=True,
    )


def majority_claim(claim: str, where: str, published: str, measured: tuple[int, int], note: str = "") -> Claim:
    """Judge that most trials succeed: it is reproduced if the rate's interval lies above one half."""
    if not measured[1]:
        return nothing_measured(claim, where, published)
    interval, min_trials = success_interval(*measured), min_trials_for(0.5)
    rule = f"Reproduced if the rate's interval (Clopper-Pearson) lies above one half. {note}"
    met = interval.low > 0.5
    return _of_rate(claim, where, published, measured, interval, rule, met=met, min_trials=min_trials)


def rare_claim(claim: str, where: str, published: str, measured: tuple[int, int], note: str = "") -> Claim:
    """Judge that something does not happen, given how often it did: it is reproduced if its interval is below 10 %."""
    if not measured[1]:
        return nothing_measured(claim, where, published)
    interval, min_trials = success_interval(*measured), min_trials_for(FEW)
    rule = (
        f"Reproduced if the interval of how often it happens (Clopper-Pearson) lies below {format_share(FEW)}. {note}"
    )
    met = interval.high < FEW
    return _of_rate(claim, where, published, measured, interval, rule, met=met, min_trials=min_trials)


def nothing_measured(
    claim: str,
    where: str = "",
    published: str = "",
    beyond: bool = False,
    reason: str = "None of the runs that it is judged by has come to its end, or a quick plan leaves them out.",
) -> Claim:
    """Return a claim on which there is no run, or there are too few."""
    return Claim(
        claim=claim,
        published=published,
        measured="",
        verdict=Verdict.NOT_COMPARABLE,
        reason=reason,
        where=where,
        beyond=beyond,
    )


def without_verdict(claim: Claim, reason: str) -> Claim:
    """Return a claim that a rule has judged as not comparable, with a reason that stands before the rule's."""
    text = f"{reason} For what it is worth: {claim.reason[:1].lower()}{claim.reason[1:]}"
    return replace(claim, verdict=Verdict.NOT_COMPARABLE, reason=text)


def _of_rate(
    claim: str,
    where: str,
    published: str,
    measured: tuple[int, int],
    interval: Interval,
    rule: str,
    met: bool,
    min_trials: int,
) -> Claim:
    return Claim(
        claim=claim,
        published=published,
        measured=format_rate(*measured),
        interval=(interval.low, interval.high),
        verdict=verdict_of(met, could_be_either=measured[1] >= min_trials),
        reason=with_shortfall(rule, measured[1], min_trials),
        where=where,
    )


def verdict_of(met: bool, could_be_either: bool = True) -> Verdict:
    """Return the verdict on a rule that was met or not, by runs that could have led to either or not."""
    if not could_be_either:
        return Verdict.NOT_COMPARABLE
    return Verdict.REPRODUCED if met else Verdict.NOT_REPRODUCED


def min_trials_for(share: float) -> int:
    """Return how many trials it takes until none that fails leaves an interval below a share.

    The interval of Clopper and Pearson then ends at 1 - (LEVEL / 2)^(1 / n).
    """
    return math.floor(math.log(LEVEL / 2) / math.log1p(-share)) + 1


def with_shortfall(reason: str, n: int, min_trials: int) -> str:
    """Add to a reason that the trials are too few for its rule to be met, if they are."""
    shortfall = (
        f"With {counted(n, 'run')} nothing could have met this rule: it takes at least {min_trials}."
        if n < min_trials
        else ""
    )
    return f"{reason.strip()} {shortfall}".strip()


def format_rate(successes: int, n: int) -> str:
    """Return a text such as `11/15 (73 %)`."""
    return f"{successes}/{n} ({format_share(successes / n)})"


def format_share(share: float) -> str:
    """Return a text such as `73 %`."""
    return f"{100 * share:.0f} %"


def format_interval(low: float, high: float) -> str:
    """Return the interval of a rate such as `45 to 92 %`."""
    return f"{100 * low:.0f} to {format_share(high)}"


def format_p_value(p: float) -> str:
    """Return a p-value, such as `0.031` or `2e-12`."""
    return f"{p:.2g}"


def format_median(values: Floats, digits: int) -> str:
    """Return a median with its interval by bootstrap, such as `5.2 (4.8 to 6.1)`; "" of no values."""
    if not len(values):
        return ""
    interval, median = time_interval(values), f"{np.median(values):.{digits}f}"
    return median if interval is None else f"{median} ({interval.low:.{digits}f} to {interval.high:.{digits}f})"


def ratio_interval(x: Floats, y: Floats, statistic: Statistic) -> tuple[float, float] | None:
    """Return the percentile interval, at 1 - LEVEL, of statistic(x) / statistic(y); each group is resampled by itself.

    A resample whose denominator is 0 counts as an infinite ratio, or as none if its numerator is 0 too. None if that
    leaves the interval an end that is not finite.
    """
    rng = np.random.default_rng(0)
    above, below = (statistic(v[rng.integers(len(v), size=(RESAMPLES, len(v)))], axis=-1) for v in (x, y))
    with np.errstate(divide="ignore", invalid="ignore"):
        ratios = above / below
    ratios = ratios[~np.isnan(ratios)]
    if not len(ratios):
        return None
    low, high = (float(v) for v in np.quantile(ratios, [LEVEL / 2, 1.0 - LEVEL / 2], method="inverted_cdf"))
    return (low, high) if np.isfinite(high) else None
