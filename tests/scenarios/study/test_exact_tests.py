"""Exact tests of a study beside brute force, SciPy, and values that textbooks print."""

import itertools
from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from handover.scenarios.study.statistics.exact_tests import (
    pair_means,
    shift_interval,
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


def test_ratings_whose_means_have_other_last_bits_are_tied():
    d = [(5 + 5 + 6) / 3 - 4, (6 + 6 + 7) / 3 - 5, 1 / 3, -1 / 3, 2 / 3, (4 + 5 + 5) / 3 - 4, 1.0]
    assert len(set(d)) > len({round(x, 9) for x in d})
    found = signed_rank_test(d)
    assert found is not None
    assert found.p == pytest.approx(by_all_signs([round(3 * x) / 3 for x in d]))


def test_five_are_too_few_and_no_difference_at_all_is_no_evidence():
    assert signed_rank_test([1.0] * 5) is None
    six, none = signed_rank_test([1.0, 2.0, 3.0, 4.0, 5.0, 6.0]), signed_rank_test([0.0] * 8)
    assert six is not None
    assert (six.p, six.low, six.high) == (pytest.approx(2 / 2**6), 1.0, 6.0)
    assert none is not None
    assert (none.p, none.estimate, none.low, none.high) == (1.0, 0.0, 0.0, 0.0)


@given(st.lists(st.integers(-99, 99).map(float), min_size=6, max_size=12, unique_by=abs).filter(lambda d: 0.0 not in d))
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


def test_the_closed_interval_covers_with_ties():
    d = np.random.default_rng(10).integers(-2, 3, size=(2000, 10)) / 2 + 0.5  # symmetric about 0.5, with many ties
    assert np.mean([low <= 0.5 <= high for low, high in map(shift_interval, d)]) >= 0.95


def test_slopes_are_those_of_least_squares_with_means_of_conditions():
    rng = np.random.default_rng(2)
    condition = [0, 1, 2, 0, 1, 2, 0, 1]
    x, y = rng.normal(size=(8, 2)), rng.normal(size=8)
    design = np.column_stack([[c == k for c in condition] for k in range(3)] + [x]).astype(float)
    slopes = np.linalg.lstsq(design, y, rcond=None)[0][3:].tolist()
    assert within_condition_slopes(x, y.tolist(), condition) == pytest.approx(slopes)
    assert within_condition_slopes([0.0, 1.0, 2.0], [1.0, 2.0, 3.0], ["a", "b", "c"]) is None
    assert within_condition_slopes([[k, 2 * k] for k in range(8)], y.tolist(), condition) is None
