"""Intervals and tests give what textbooks and closed forms say."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import binomtest

from handover.scenarios.runs.campaign.statistics import (
    compatible_counts,
    holm,
    least_p_of_pairs,
    paired_difference,
    paired_test,
    sign_flip_test,
    success_interval,
    time_interval,
    two_proportions,
    unpaired_difference,
)


@pytest.mark.parametrize("n", [1, 7, 80])
def test_an_interval_of_successes_is_that_which_scipy_finds_by_searching(n: int):
    for k in range(n + 1):
        ours, searched = success_interval(k, n), binomtest(k, n).proportion_ci(method="exact")
        assert (ours.low, ours.high) == pytest.approx((searched.low, searched.high), abs=1e-9)


@pytest.mark.parametrize(("successes", "n"), [(0, 0), (4, 3), (-1, 3)])
def test_successes_without_trials_are_refused(successes: int, n: int):
    with pytest.raises(ValueError, match=f"{successes} successes of {n} trials"):
        success_interval(successes, n)


def test_a_bootstrapped_mean_of_many_values_has_about_the_interval_of_the_normal_distribution():
    x = np.random.default_rng(1).normal(5.0, 2.0, 400)
    interval = time_interval(x, np.mean)
    assert interval is not None
    assert interval.method == "BCa bootstrap"
    half = 1.96 * float(np.std(x, ddof=1)) / len(x) ** 0.5
    assert (interval.low, interval.high) == pytest.approx((np.mean(x) - half, np.mean(x) + half), abs=0.1 * half)


def test_a_bootstrap_leans_to_the_side_on_which_values_are_spread():
    x = np.random.default_rng(2).exponential(1.0, 40)
    interval = time_interval(x, np.mean)
    assert interval is not None
    assert interval == time_interval(x, np.mean)
    assert time_interval([1.0, 2.0, float("nan")]) is None  # fewer than three values say nothing
    assert interval.high - np.mean(x) > 1.1 * (np.mean(x) - interval.low)


@pytest.mark.parametrize(("values", "bounds"), [([2.0, 2.0, 2.0, 2.0], (2.0, 2.0)), ([1.0, 1.0, 1.0, 2.0], (1.0, 2.0))])
def test_where_bca_is_not_defined_it_says_that_it_is_the_percentile_interval(
    values: list[float], bounds: tuple[float, float]
):
    interval = time_interval(values)
    assert interval is not None
    assert (interval.low, interval.high) == bounds
    assert interval.method.startswith("percentile bootstrap")


def test_pairs_that_differ_decide_the_paired_test():
    first = [True] * 9 + [False] * 1 + [True] * 30 + [False] * 5
    second = [False] * 9 + [True] * 1 + [True] * 30 + [False] * 5
    test = paired_test(first, second)
    assert (test.only_first, test.only_second) == (9, 1)
    assert test.p == pytest.approx(2 * (1 + 10) / 2**10)
    assert test.first_is_better
    assert not paired_test(second, first).first_is_better


def test_five_pairs_that_differ_are_too_few_for_any_verdict_and_none_say_nothing():
    assert not paired_test([True] * 5, [False] * 5).first_is_better
    assert paired_test([True] * 6, [False] * 6).first_is_better
    assert paired_test([True, False], [True, False]).p == 1.0
    with pytest.raises(ValueError):  # noqa: PT011 (zip's own)
        paired_test([True], [True, False])


def test_the_lady_tasting_tea_and_few_trials_of_theirs():
    assert two_proportions(3, 4, 1, 4) == pytest.approx(34 / 70)
    assert compatible_counts(2, 3, 3) == (0, 3)
    assert compatible_counts(0, 4, 4) == (0, 3)  # 4 of 4: p = 2 / C(8, 4)


def test_a_signed_rank_test_of_differences_of_one_sign():
    test = paired_difference([1.0, 2.0, 3.0, 4.0, np.nan], [1.5, 2.6, 3.7, 4.8, 9.0])
    assert test is not None
    assert (test.n, test.p) == (4, pytest.approx(2 / 2**4))
    assert test.difference == pytest.approx(0.65)


def test_values_that_are_all_alike_do_not_differ():
    test = paired_difference([1.0, 2.0], [1.0, 2.0])
    assert test is not None
    assert (test.p, test.difference, test.interval) == (1.0, 0.0, None)
    assert paired_difference([np.nan], [1.0]) is None


def test_groups_that_do_not_overlap():
    test = unpaired_difference([1.0, 2.0, 3.0], [4.0, 5.0, 6.0, np.nan])
    assert test is not None
    assert (test.n, test.difference, test.p) == (3, 3.0, pytest.approx(2 / 20))  # two of the 6 choose 3 orders
    assert unpaired_difference([], [1.0]) is None


@pytest.mark.parametrize("n", [1, 2, 5, 6])
def test_tests_of_pairs_reach_their_least_p_where_all_pairs_differ_in_one_way(n: int):
    least = least_p_of_pairs(n)
    assert least == (1.0, 0.5, None, None, 0.0625, 0.03125)[n - 1]
    assert paired_test([True] * n, [False] * n).p == pytest.approx(least)
    test = paired_difference(np.zeros(n), np.arange(1.0, n + 1.0))
    assert test is not None
    assert (test.p, test.least_p) == (pytest.approx(least), least)


@pytest.mark.parametrize(
    ("first", "second", "p"),
    [
        ([1.0], [1.0], 1.0),
        ([1.0], [2.0], 1.0),
        ([0.0], [*range(1, 40)], 2 / 40),  # the first of 40 orders, or the last
        ([*range(1, 40), 39.0], [40.0], 2 / 41),
        ([9.0], [*range(9), 9.0], 4 / 11),  # two of eleven are the largest
    ],
)
def test_a_group_of_one_has_the_exact_p(first: list[float], second: list[float], p: float):
    test = unpaired_difference(first, second)
    assert test is not None
    assert test.p == pytest.approx(p)


@pytest.mark.parametrize("first", [[1.0, 2.0, 3.0], [1.0, 1.0, 1.0]])  # the normal distribution would give 0.047
def test_groups_of_equal_values_have_the_exact_p(first: list[float]):
    test = unpaired_difference(first, [4.0, 4.0, 4.0])
    assert test is not None
    assert test.p == pytest.approx(2 / 20)
    assert test.least_p == pytest.approx(2 / 20)


def test_holms_correction():  # [Holm1979], each p times the number of those not smaller, never falling
    assert holm([0.04, 0.01, 0.03]) == pytest.approx([0.06, 0.03, 0.06])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []


def test_signs_flipped_are_counted_as_by_brute_force():
    rng = np.random.default_rng(2)
    for _ in range(20):
        differences = rng.integers(-4, 5, 9).tolist()
        flipped = [
            abs(sum(s * d for s, d in zip(signs, differences, strict=True))) for signs in product((-1, 1), repeat=9)
        ]
        p = np.mean([total >= abs(sum(differences)) for total in flipped])
        assert sign_flip_test(differences) == pytest.approx(p, abs=1e-12)
    assert sign_flip_test([]) == 1.0
    only_first, only_second = [True] * 7 + [False] * 2, [False] * 7 + [True] * 2
    assert sign_flip_test([1] * 7 + [0] + [-1] * 2) == pytest.approx(paired_test(only_first, only_second).p)
