"""Intervals and tests for campaigns, by scipy.stats."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from math import comb
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats
from scipy.stats import beta, binomtest, bootstrap, fisher_exact, wilcoxon

from handover.cosim.blocks.ports import Floats

LEVEL = 0.05
"""Of all tests; intervals are at 1 - LEVEL."""

MIN_SAMPLES = 3
"""Values below which a bootstrap says nothing: two values have only three different resamples."""

RESAMPLES = 9999
"""Of a bootstrap."""

_METHODS: tuple[tuple[Literal["BCa", "percentile"], str], ...] = (
    ("BCa", "BCa bootstrap"),
    ("percentile", "percentile bootstrap, as BCa is not defined"),
)

Statistic = Callable[..., Any]
"""Takes values and `axis`, like np.median."""


@dataclass(frozen=True)
class Interval:
    """A confidence interval, and the method that gave it."""

    low: float
    high: float
    method: str


@dataclass(frozen=True)
class PairedTest:
    """McNemar's exact test of pairs of successes.

    Attributes:
        only_first: pairs in which only the first succeeded.
        only_second: pairs in which only the second did.
        p: how probable so uneven a split, either way, is if neither does better.
    """

    only_first: int
    only_second: int
    p: float

    @property
    def first_is_better(self) -> bool:
        """Whether the test rejects, and the first succeeded where the second did not more often than the reverse."""
        return self.p < LEVEL and self.only_first > self.only_second


@dataclass(frozen=True)
class DifferenceTest:
    """A test of the values of two groups.

    Attributes:
        n: pairs, or values of the smaller group where they are not paired.
        difference: median of second minus first over the pairs; without pairs, the difference of the medians.
        interval: of the difference of pairs; None without pairs, or where they are too few or all the same.
        p: how probable so large a difference, either way, is if there is none.
        least_p: below which p cannot fall with so many values, whatever they are.
        method: the test's name.
    """

    n: int
    difference: float
    interval: Interval | None
    p: float
    least_p: float
    method: str


def success_interval(successes: int, n: int) -> Interval:
    """Return the interval of Clopper and Pearson for a rate of success, whose ends are quantiles of beta distributions.

    Raises:
        ValueError: there are no trials, or more successes than trials.
    """
    if n < 1 or not 0 <= successes <= n:
        raise ValueError(f"{successes} successes of {n} trials: there must be a trial, and a success is one of them")
    low = float(beta.ppf(LEVEL / 2, successes, n - successes + 1)) if successes else 0.0
    high = float(beta.ppf(1.0 - LEVEL / 2, successes + 1, n - successes)) if successes < n else 1.0
    return Interval(low, high, "Clopper-Pearson")


def time_interval(values: ArrayLike, statistic: Statistic = np.median) -> Interval | None:
    """Return the bootstrap's interval (BCa) for a statistic of values, such as np.median or np.mean.

    Where BCa is not defined, as where no single value left out moves the statistic, it is the percentile interval, and
    says so. None if there are fewer than three values. Values that are NaN do not count.
    """
    x = np.asarray(values, dtype=np.float64)
    x = x[~np.isnan(x)]
    if len(x) < MIN_SAMPLES:
        return None
    for method, name in _METHODS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # that BCa is not defined shows in its interval, which is NaN
            ci = bootstrap(
                (x,),
                statistic,
                n_resamples=RESAMPLES,
                confidence_level=1.0 - LEVEL,
                method=method,
                rng=np.random.default_rng(0),
            ).confidence_interval
        if np.isfinite(ci.low) and np.isfinite(ci.high):
            return Interval(float(ci.low), float(ci.high), name)
    return None


def paired_test(first: Sequence[bool], second: Sequence[bool]) -> PairedTest:
    """Return McNemar's exact test of successes in the same scenes: a sign test on the pairs that differ.

    Raises:
        ValueError: the two are not of one length.
    """
    pairs = list(zip(first, second, strict=True))
    only_first = sum(a and not b for a, b in pairs)
    only_second = sum(b and not a for a, b in pairs)
    differ = only_first + only_second
    return PairedTest(only_first, only_second, float(binomtest(only_first, differ).pvalue) if differ else 1.0)


def least_p_of_pairs(n: int) -> float:
    """Return below what p cannot fall in tests of n pairs, McNemar's and Wilcoxon's: all of them differ in one way.

    Of the 2^n ways in which signs can fall, these are two: 0.0625 of five pairs.
    """
    return min(1.0, 2.0 ** (1 - n))


def sign_flip_test(differences: Sequence[int]) -> float:
    """Return the exact p-value, two-sided, that whole differences of independent pairs have a sum so far from 0.

    If neither of two ways does better, each difference is as likely to have the other sign. What makes up a difference,
    as several runs of one scene or one participant, may depend on each other as it likes. Where all are -1, 0 or 1,
    this is McNemar's exact test. E. S. Edgington, P. Onghena, Randomization tests.
    """
    return _p_of_sum(tuple(sorted(abs(x) for x in differences if x)), abs(sum(differences)))


@lru_cache(maxsize=65536)
def _p_of_sum(sizes: tuple[int, ...], found: int) -> float:
    """Return how probable a sum of terms of either sign is as far from 0; a study's recur thousands of times."""
    p = chosen_sums(sizes)
    sums = 2 * np.arange(len(p)) - (len(p) - 1)
    return min(1.0, float(p[np.abs(sums) >= found].sum()))


@lru_cache(maxsize=4096)
def chosen_sums(weights: tuple[int, ...]) -> Floats:
    """Return the probabilities of sums from 0, if each weight is added or not with the same probability."""
    p: Floats = np.ones(1)
    for w in weights:
        longer: Floats = np.zeros(len(p) + w)  # np.pad takes several times as long
        longer[: len(p)] += p / 2
        longer[w:] += p / 2
        p = longer
    return p


def two_proportions(successes: int, n: int, others: int, n_others: int) -> float:
    """Return the p-value, two-sided, of Fisher's exact test of two rates of success in trials that are not paired."""
    table = np.array([[successes, n - successes], [others, n_others - others]])
    return float(fisher_exact(table).pvalue)


@cache
def compatible_counts(successes: int, n: int, n_others: int) -> tuple[int, int]:
    """Return the smallest and the largest count of `n_others` that Fisher's test cannot tell from `successes` of `n`.

    They say what the test could have found: where they span all counts, nothing.
    """
    counts = range(n_others + 1)
    low, high = (
        next(k for k in from_end if two_proportions(k, n_others, successes, n) >= LEVEL)
        for from_end in (counts, reversed(counts))
    )
    return low, high


def paired_difference(first: ArrayLike, second: ArrayLike) -> DifferenceTest | None:
    """Return Wilcoxon's signed-rank test of pairs of values, two-sided; None without a pair of finite values.

    Raises:
        ValueError: the two are not of one length.
    """
    d = np.asarray(second, dtype=np.float64) - np.asarray(first, dtype=np.float64)
    d = d[np.isfinite(d)]
    if not len(d):
        return None
    p = float(wilcoxon(d).pvalue) if d.any() else 1.0
    interval = time_interval(d) if np.ptp(d) > 0.0 else None
    return DifferenceTest(len(d), float(np.median(d)), interval, p, least_p_of_pairs(len(d)), "Wilcoxon")


def unpaired_difference(first: ArrayLike, second: ArrayLike) -> DifferenceTest | None:
    """Return the test of Mann and Whitney of two groups of values, two-sided; None if one has no finite value.

    It is exact for small groups, also where values are the same, for which the normal distribution gives too small a p.
    """
    x, y = (values[np.isfinite(values)] for values in (np.asarray(first, float), np.asarray(second, float)))
    if not len(x) or not len(y):
        return None
    orders = comb(len(x) + len(y), len(x))
    if 1 in (len(x), len(y)):  # SciPy permutes no group of one
        ranks: Floats = stats.rankdata(np.concatenate([x, y] if len(x) == 1 else [y, x]))
        sides = np.count_nonzero(ranks <= ranks[0]), np.count_nonzero(ranks >= ranks[0])
        p = min(1.0, 2.0 * min(sides) / len(ranks))
    else:
        p = _rank_sum_p(x, y, orders)
    difference = float(np.median(y) - np.median(x))
    return DifferenceTest(min(len(x), len(y)), difference, None, p, min(1.0, 2.0 / orders), "Mann-Whitney")


def _rank_sum_p(x: Floats, y: Floats, orders: int) -> float:
    has_ties = len(np.unique(np.concatenate([x, y]))) < len(x) + len(y)
    method: Any = stats.PermutationMethod(n_resamples=orders) if has_ties and orders <= RESAMPLES else "auto"
    test: Any = stats.mannwhitneyu(x, y, method=method)
    return float(test.pvalue)


def holm(p: Sequence[float]) -> list[float]:
    """Return p-values corrected for their number by Holm's step-down method."""
    corrected, largest = [0.0] * len(p), 0.0
    for rank, k in enumerate(sorted(range(len(p)), key=lambda k: p[k])):
        largest = max(largest, min(1.0, (len(p) - rank) * p[k]))
        corrected[k] = largest
    return corrected
