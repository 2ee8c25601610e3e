"""Exact tests of a study beside brute force, SciPy, and values that textbooks print."""

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.statistics import sign_flip_test as flips_of_simulated_persons
from handover.scenarios.study.statistics.exact_tests import (
    pair_means,
    shift_interval,
    sign_flip_test,
    signed_rank_test,
    within_condition_slopes,
)

BEFORE = (1.83, 0.50, 1.62, 2.48, 1.68, 1.88, 1.55, 3.06, 1.30)
AFTER = (0.878, 0.647, 0.598, 2.05, 1.06, 1.29, 1.06, 3.14, 1.29)
"""Hollander and Wolfe's depression scale factors, the example of R's `wilcox.test`."""

HALVES = st.lists(st.integers(-8, 8).map(lambda k: k / 2), min_size=6, max_size=10)
"""Differences of participants' means of two ratings each: with ties and zeros."""


def by_all_signs(d: Sequence[float]) -> float:
    """Return the two-sided p-value of signed ranks by going through all signs of what is not 0, ranked with zeros."""
    ranks = stats.rankdata(np.abs(d))[np.array(d) != 0.0]
    found = abs(float(np.sum(stats.rankdata(np.abs(d)) * np.sign(d))))
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=len(ranks)))).reshape(2 ** len(ranks), len(ranks))
    return float(np.mean(np.abs(signs @ ranks) >= found - 1e-9))


def test_a_textbooks_example():
    found = signed_rank_test(np.subtract(BEFORE, AFTER).tolist())
    assert found is not None
    assert found.rank_sum == 40.0
    assert found.p == pytest.approx(0.0390625)
    assert found.estimate == pytest.approx(0.46)
    assert (found.low, found.high) == pytest.approx((0.010, 0.786))


@given(HALVES)
@settings(max_examples=25, deadline=None)
def test_ties_and_zeros_are_exact_by_all_signs(d: list[float]):
    found = signed_rank_test(d)
    assert found is not None
    assert found.zeros == d.count(0.0)
    assert found.p == pytest.approx(by_all_signs(d))


@pytest.mark.parametrize("seed", range(2))
def test_scipy_agrees_with_ties_and_without(seed: int):
    rng = np.random.default_rng(seed)
    tied = rng.choice([-2.0, -1.5, -1.0, -0.5, 0.5, 1.0, 1.5, 2.0], size=11)
    continuous = rng.normal(0.5, 1.0, 14)
    by_permutation = stats.wilcoxon(tied, method=stats.PermutationMethod(n_resamples=2**11))
    by_table = stats.wilcoxon(continuous, method="exact")
    for d, theirs in ((tied, by_permutation), (continuous, by_table)):
        ours = signed_rank_test(d.tolist())
        assert ours is not None
        assert ours.p == pytest.approx(float(theirs.pvalue))


def test_ratings_whose_means_have_other_last_bits_are_tied():
    d = [(5 + 5 + 6) / 3 - 4, (6 + 6 + 7) / 3 - 5, 1 / 3, -1 / 3, 2 / 3, (4 + 5 + 5) / 3 - 4, 1.0]
    assert len(set(d)) > len({round(x, 9) for x in d})
    found = signed_rank_test(d)
    assert found is not None
    assert found.p == pytest.approx(by_all_signs([round(3 * x) / 3 for x in d]))


def test_five_are_too_few_and_six_are_not():
    assert signed_rank_test([1.0] * 5) is None
    six = signed_rank_test([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert six is not None
    assert six.p == pytest.approx(2 / 2**6)
    assert (six.low, six.high) == (1.0, 6.0)


def test_no_difference_at_all_is_no_evidence():
    found = signed_rank_test([0.0] * 8)
    assert found is not None
    assert (found.p, found.estimate, found.low, found.high) == (1.0, 0.0, 0.0, 0.0)


@given(st.lists(st.integers(-99, 99).map(float), min_size=6, max_size=16, unique_by=abs).filter(lambda d: 0.0 not in d))
@settings(max_examples=25, deadline=None)
def test_the_interval_has_the_shifts_that_the_test_does_not_reject(d: list[float]):
    low, high = shift_interval(np.array(d))
    means = np.unique(pair_means(np.array(d)))
    between = np.concatenate([[means[0] - 1.0], (means[1:] + means[:-1]) / 2, [means[-1] + 1.0]])
    for shift in between:
        shifted = np.array(d) - shift
        if len(np.unique(np.abs(shifted))) < len(d):  # a tie: another distribution
            continue
        found = signed_rank_test(shifted.tolist())
        assert found is not None
        assert (found.p > 0.05) == (low < shift < high)


@pytest.mark.parametrize("n", [6, 10, 18])
def test_the_closed_interval_covers_with_ties(n: int):
    rng = np.random.default_rng(n)
    d = rng.integers(-2, 3, size=(4000, n)) / 2 + 0.5  # symmetric about 0.5, with many ties
    covered = [low <= 0.5 <= high for low, high in map(shift_interval, d)]
    assert np.mean(covered) >= 0.95


@pytest.mark.parametrize("differences", [[2, 1, 0, -1, 1, 1], [1, 1, 1, 1, 1, 1], [0, 0], [3, -3, 1]])
def test_flips_of_persons_agree_with_all_signs(differences: list[int]):
    assert sign_flip_test(differences) == pytest.approx(flips_of_simulated_persons(differences))


def by_all_flips(pairs: Sequence[tuple[int, int]]) -> float:
    """Return the p-value by giving the rounds of each pair the behaviours both ways round."""
    ways: Floats = np.array([sum(way) for way in itertools.product(*((a - b, b - a) for a, b in pairs))], dtype=float)
    return float(np.mean(np.abs(ways) >= abs(sum(a - b for a, b in pairs))))


@pytest.mark.parametrize("seed", range(2))
def test_flips_within_matched_pairs_agree_with_all_flips_and_with_mcnemars_test(seed: int):
    pairs = [(int(a), int(b)) for a, b in np.random.default_rng(seed).binomial(1, (0.2, 0.7), size=(11, 2))]
    discordant = [a - b for a, b in pairs if a != b]
    found = sign_flip_test([a - b for a, b in pairs])
    assert found == pytest.approx(by_all_flips(pairs))
    assert found == pytest.approx(stats.binomtest(discordant.count(1), len(discordant)).pvalue)


def test_people_who_differ_are_not_pooled():
    skilled, clumsy = [0, 0], [-1, 0]  # of each clumsy person's two pairs, one has a success with the first alone
    within = sign_flip_test((skilled + clumsy) * 5)
    pooled = stats.fisher_exact(np.array([[5, 15], [10, 10]])).pvalue
    assert within == pytest.approx(0.0625)
    assert pooled == pytest.approx(0.19, abs=0.01)


def test_flips_within_pairs_keep_their_level_where_periods_differ_and_use_it():
    """Most fail in the first period and few in the second: arrangements over periods would be conservative."""
    rng = np.random.default_rng(5)
    rejected = 0
    for _ in range(2000):
        p = np.stack([rng.beta(6.0, 4.0, 40), rng.beta(1.0, 8.0, 40)])
        first, second = rng.binomial(1, p), rng.binomial(1, p)
        rejected += sign_flip_test((first - second).reshape(-1).tolist()) < 0.05
    assert 0.02 < rejected / 2000 < 0.05


def test_slopes_are_those_of_least_squares_with_means_of_conditions():
    rng = np.random.default_rng(2)
    condition = [0, 1, 2, 0, 1, 2, 0, 1]
    x, y = rng.normal(size=(8, 2)), rng.normal(size=8)
    design = np.column_stack([[c == k for c in condition] for k in range(3)] + [x]).astype(float)
    assert within_condition_slopes(x, y.tolist(), condition) == pytest.approx(
        np.linalg.lstsq(design, y, rcond=None)[0][3:].tolist()
    )
    assert within_condition_slopes([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], ["a", "b", "c"]) is None
    assert within_condition_slopes([[k, 2 * k] for k in range(8)], y.tolist(), condition) is None
