"""Claims get their verdicts by the rules that they state."""

import pytest

from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.published.verdicts import (
    FEW,
    majority_claim,
    min_trials_for,
    no_worse_claim,
    order_claim,
    rare_claim,
    rate_claim,
    without_verdict,
)

REPRODUCED, NOT_REPRODUCED, NOT_COMPARABLE = Verdict


@pytest.mark.parametrize(
    ("measured", "verdict"),
    [((60, 80), REPRODUCED), ((80, 80), NOT_REPRODUCED), ((20, 80), NOT_REPRODUCED), ((0, 0), NOT_COMPARABLE)],
)
def test_a_rate_is_reproduced_if_the_counts_are_compatible(measured: tuple[int, int], verdict: Verdict):
    assert rate_claim("It holds 11 of 15.", "table I", (11, 15), measured).verdict is verdict


def test_a_rate_shows_both_counts_the_interval_and_what_would_have_passed():
    claim = rate_claim("It holds 11 of 15.", "table I", (11, 15), (80, 80))
    assert (claim.published, claim.measured) == ("11/15 (73 %)", "80/80 (100 %)")
    assert claim.interval == pytest.approx((0.025 ** (1 / 80), 1.0))
    assert "Their own interval is 45 to 92 %" in claim.reason
    assert "any count of ours from 36 to 73 of 80 would have passed" in claim.reason


def test_a_rate_of_so_few_trials_that_nothing_could_be_distinguished_gets_no_verdict():
    claim = rate_claim("It holds 2 of 3.", "table I", (2, 3), (3, 3))
    assert claim.verdict is NOT_COMPARABLE
    assert "no count of ours out of 3 could have been told from theirs" in claim.reason


@pytest.mark.parametrize(
    ("first", "second", "verdict"),
    [
        ([True] * 6 + [False] * 4, [False] * 10, REPRODUCED),
        ([True] * 5 + [False] * 5, [False] * 10, NOT_REPRODUCED),
        ([False] * 10, [True] * 10, NOT_REPRODUCED),
        ([True] * 5, [False] * 5, NOT_COMPARABLE),
        ([], [], NOT_COMPARABLE),
    ],
)
def test_an_order_is_reproduced_if_pairs_show_it(first: list[bool], second: list[bool], verdict: Verdict):
    assert order_claim("The first does better.", "table I", "", first, second).verdict is verdict


def test_an_order_that_so_few_pairs_cannot_show_says_how_many_it_takes():
    claim = order_claim("The first does better.", "table I", "", [True] * 5, [False] * 5)
    assert "it takes at least 6" in claim.reason


@pytest.mark.parametrize(
    ("worse", "n", "verdict"),
    [(0, 36, REPRODUCED), (2, 80, REPRODUCED), (3, 80, NOT_REPRODUCED), (0, 35, NOT_COMPARABLE)],
)
def test_no_worse_takes_an_interval_below_the_margin(worse: int, n: int, verdict: Verdict):
    claim = no_worse_claim("The first does no worse.", [False] * worse + [True] * (n - worse), [True] * n)
    assert claim.verdict is verdict
    assert claim.beyond


@pytest.mark.parametrize("share", [0.01, 0.05, FEW, 0.2, 1 / 3, 0.5, 0.8, 0.9, 0.975, 0.99])
def test_the_fewest_trials_are_the_first_whose_interval_can_end_below_a_share(share: float):
    assert min_trials_for(share) == next(n for n in range(1, 1000) if success_interval(0, n).high < share)


def test_runs_in_which_only_the_first_succeeds_do_not_count_against_it():
    assert no_worse_claim("The first does no worse.", [True] * 40, [False] * 40).verdict is REPRODUCED


@pytest.mark.parametrize(
    ("measured", "verdict"), [((60, 80), REPRODUCED), ((45, 80), NOT_REPRODUCED), ((5, 5), NOT_COMPARABLE)]
)
def test_most_is_more_than_half_with_the_whole_interval(measured: tuple[int, int], verdict: Verdict):
    assert majority_claim("Most succeed.", "sec. V-D", "most", measured).verdict is verdict


@pytest.mark.parametrize(
    ("measured", "verdict"), [((0, 80), REPRODUCED), ((4, 80), NOT_REPRODUCED), ((0, 30), NOT_COMPARABLE)]
)
def test_what_does_not_happen_has_its_whole_interval_below_a_tenth(measured: tuple[int, int], verdict: Verdict):
    assert rare_claim("It does not touch.", "sec. I", "", measured).verdict is verdict


def test_a_claim_without_a_verdict_keeps_its_figures_and_says_why():
    judged = rate_claim("Blind holds 2 of 15.", "table I", (2, 15), (16, 80))
    claim = without_verdict(judged, "It was chosen so.")
    assert claim.verdict is NOT_COMPARABLE
    assert claim.measured == judged.measured
    assert claim.reason.startswith("It was chosen so. For what it is worth: Reproduced if")
