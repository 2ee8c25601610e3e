"""Exact tests of a study's paired data: pure functions of numbers, which know nothing of plans and folders.

Every null distribution here is that of `sign_flip_test`, exact for any number of participants, with ties. SciPy's
`wilcoxon` is exact with ties only by going through all 2^n signs; the tests compare the two where that is possible.

[Wilcoxon1945] Wilcoxon, Individual comparisons by ranking methods.
[Pratt1959] Pratt, Remarks on zeros and ties in the Wilcoxon signed rank procedures.
[Hodges1963] Hodges, Lehmann, Estimates of location based on rank tests.
[Noether1967] Noether, Wilcoxon confidence intervals for location parameters in the discrete case.
[Streitberg1986] Streitberg, Röhmel, Exact distributions for permutation and rank tests.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import rankdata

from handover.cosim.blocks.ports import Floats
from handover.scenarios.runs.campaign.statistics import LEVEL, chosen_sums, sign_flip_test

MIN_PARTICIPANTS = 6
"""Fewer cannot reject at 5 % by any test of signs: five that differ alike have p = 2 / 2^5 = 0.0625."""

_DIGITS = 9
"""Decimals to which differences are compared: means of whole ratings that are equal have other last bits."""


@dataclass(frozen=True)
class SignedRankTest:
    """Wilcoxon's signed-rank test of differences, with the shift that belongs to it.

    Attributes:
        n: differences, one a participant.
        zeros: of these, how many are 0.
        rank_sum: of positive differences.
        p: two-sided.
        estimate: of Hodges and Lehmann: the median of the means of all pairs of differences.
        low, high: of its interval at 95 % at least.
    """

    n: int
    zeros: int
    rank_sum: float
    p: float
    estimate: float
    low: float
    high: float


def signed_rank_test(differences: Sequence[float]) -> SignedRankTest | None:
    """Return the exact test that differences are symmetric about 0; None of fewer than six.

    Absolute differences that are equal share their mean rank; zeros take part in the ranking and are then left out
    [Pratt1959]. Given the ranks, each sign is as likely as the other: the distribution of the sum of positive ranks is
    exact with ties and zeros [Streitberg1986].

    The interval has the means of pairs, of each difference with itself too, between which untied ranks would not
    reject. Closed, it covers with 95 % at least where values are tied, too [Noether1967]; it is then wider than the
    test, and may have 0 in it though p is just below 0.05.
    """
    d: Floats = np.round(np.asarray(differences, dtype=np.float64), _DIGITS)
    if len(d) < MIN_PARTICIPANTS:
        return None
    low, high = shift_interval(d)
    return SignedRankTest(
        n=len(d),
        zeros=int((d == 0.0).sum()),
        rank_sum=float(rankdata(np.abs(d))[d > 0.0].sum()),
        p=float(signed_rank_p(d)),
        estimate=float(np.median(pair_means(d))),
        low=low,
        high=high,
    )


def signed_rank_p(d: Floats) -> Floats:
    """Return the p-values of `signed_rank_test` along the last axis, whatever the number of differences."""
    signed = np.rint(2.0 * rankdata(np.abs(d), axis=-1) * np.sign(d)).astype(np.int64)  # mean ranks are halves
    p = [sign_flip_test(row) for row in signed.reshape(-1, d.shape[-1]).tolist()]
    return np.array(p).reshape(d.shape[:-1])


def pair_means(d: Floats) -> Floats:
    """Return the means of all pairs of differences, each with itself too, in order: Walsh's averages [Hodges1963]."""
    i, j = np.triu_indices(len(d))
    return np.sort((d[i] + d[j]) / 2)


def shift_interval(d: Floats) -> tuple[float, float]:
    """Return the closed interval of a shift, at 95 % at least, of at least six differences.

    [Hodges1963], [Noether1967]
    """
    below = np.cumsum(chosen_sums(tuple(range(1, len(d) + 1))))
    k = int(np.searchsorted(below, LEVEL / 2, side="right")) - 1  # the largest sum that is too improbable to keep
    means = pair_means(d)
    return float(means[k]), float(means[len(means) - 1 - k])


def within_condition_slopes(x: ArrayLike, y: Sequence[float], condition: Sequence[object]) -> list[float] | None:
    """Return by how much y grows with each column of x in one participant, all columns together.

    By least squares with a mean of its own each condition, so that no column's slope has another column's effect in it,
    whichever rounds are there. None where the columns cannot be told apart within conditions.

    Args:
        x: shape (rounds, columns).
        y: one a round.
        condition: of each round.
    """
    xs: Floats = np.array(x, dtype=np.float64).reshape(len(y), -1)
    ys: Floats = np.array(y, dtype=np.float64)
    for kind in dict.fromkeys(condition):
        same = np.array([c == kind for c in condition])
        xs[same] -= xs[same].mean(axis=0)
        ys[same] -= ys[same].mean()
    if np.linalg.matrix_rank(xs, tol=1e-6) < xs.shape[1]:
        return None
    return [float(slope) for slope in np.linalg.lstsq(xs, ys, rcond=None)[0]]
