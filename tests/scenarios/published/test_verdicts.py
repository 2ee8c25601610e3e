"""Claims get their verdicts by the rules that they state, go to JSON and back, and are counted."""

import json
import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from support.wording import Wording

from handover.scenarios.published.published_experiment import Claim, ComparisonTable, Verdict, verdict_counts
from handover.scenarios.published.verdicts import (
    FEW,
    majority_claim,
    min_trials_for,
    no_worse_claim,
    order_claim,
    rare_claim,
    rate_claim,
    ratio_interval,
    without_verdict,
)
from handover.scenarios.runs.campaign.statistics import success_interval

REPRODUCED, NOT_REPRODUCED, NOT_COMPARABLE = Verdict
CLAIM = Claim(
    claim="It holds.",
    published="11/15",
    measured="79/80",
    interval=(0.93, 1.0),
    verdict=NOT_REPRODUCED,
    reason="By this rule.",
    where="table I",
)


def of(successes: int, n: int) -> list[bool]:
    return [False] * (n - successes) + [True] * successes


rate = partial(rate_claim, "It holds 11 of 15.", "table I", (11, 15))
order = partial(order_claim, "The first does better.", "table I", "")
no_worse = partial(no_worse_claim, "The first does no worse.")
most = partial(majority_claim, "Most succeed.", "sec. V-D", "most")
rare = partial(rare_claim, "It does not touch.", "sec. I", "")


@pytest.mark.parametrize(
    ("claim", "verdict"),
    [
        (rate((60, 80)), REPRODUCED),
        (rate((80, 80)), NOT_REPRODUCED),
        (rate((20, 80)), NOT_REPRODUCED),
        (rate((0, 80)), NOT_REPRODUCED),
        (rate((0, 0)), NOT_COMPARABLE),
        (rate_claim("It holds 2 of 3.", "table I", (2, 3), (3, 3)), NOT_COMPARABLE),
        (order(of(6, 10), of(0, 10)), REPRODUCED),
        (order(of(5, 10), of(0, 10)), NOT_REPRODUCED),
        (order(of(0, 10), of(10, 10)), NOT_REPRODUCED),
        (order(of(5, 5), of(0, 5)), NOT_COMPARABLE),
        (order([], []), NOT_COMPARABLE),
        (no_worse(of(36, 36), of(36, 36)), REPRODUCED),
        (no_worse(of(78, 80), of(80, 80)), REPRODUCED),
        (no_worse(of(77, 80), of(80, 80)), NOT_REPRODUCED),
        (no_worse(of(35, 35), of(35, 35)), NOT_COMPARABLE),
        (no_worse(of(40, 40), of(0, 40)), REPRODUCED),  # runs in which only the first succeeds do not count against it
        (most((60, 80)), REPRODUCED),
        (most((45, 80)), NOT_REPRODUCED),
        (most((0, 80)), NOT_REPRODUCED),
        (most((5, 5)), NOT_COMPARABLE),
        (rare((0, 80)), REPRODUCED),
        (rare((4, 80)), NOT_REPRODUCED),
        (rare((0, 30)), NOT_COMPARABLE),
        (without_verdict(rate((60, 80)), "It was chosen so."), NOT_COMPARABLE),
    ],
)
def test_a_claim_gets_its_verdict_by_the_rule_that_it_states(claim: Claim, verdict: Verdict, wording: Wording):
    assert claim.verdict is verdict
    assert claim.beyond == (claim.claim == "The first does no worse.")
    wording.check(f"{claim.published} | {claim.measured} | {claim.reason}")


def test_a_rate_has_the_interval_of_what_was_counted():
    assert rate((80, 80)).interval == pytest.approx((0.025 ** (1 / 80), 1.0))


@pytest.mark.parametrize("share", [0.01, 0.05, FEW, 0.2, 1 / 3, 0.5, 0.8, 0.9, 0.975, 0.99])
def test_the_fewest_trials_are_the_first_whose_interval_can_end_below_a_share(share: float):
    assert min_trials_for(share) == next(n for n in range(1, 1000) if success_interval(0, n).high < share)


def test_the_interval_of_a_ratio_is_the_normal_one_where_both_means_are_certain_enough():
    """By the delta method: the ratio's standard error is ratio sqrt(cv_x^2 / n + cv_y^2 / n)."""
    rng = np.random.default_rng(2)
    x, y = rng.normal(40, 4, 100), rng.normal(20, 2, 100)
    low, high = ratio_interval(x, y, np.mean) or (0.0, 0.0)
    (a, da), (b, db) = ((float(np.mean(v)), float(np.std(v)) / 10.0) for v in (x, y))
    error = a / b * math.hypot(da / a, db / b)
    assert high - low == pytest.approx(2 * 1.96 * error, rel=0.1)
    assert low < a / b < high
    assert ratio_interval(np.array([1.0, 2.0, 3.0]), np.full(3, 5.0), np.std) is None  # divided by nothing


def test_a_claim_comes_back_from_json_as_it_was_and_those_beyond_the_paper_are_counted_apart():
    both = [replace(CLAIM, verdict=v, beyond=b) for b in (True, False) for v in (*reversed(Verdict), NOT_REPRODUCED)]
    for claim in [*both, replace(CLAIM, interval=None)]:
        assert Claim.from_data(json.loads(json.dumps(claim.as_data()))) == claim
    counts = [(n, words) for n, _, words in verdict_counts(both, beyond=True)]
    assert counts == [(1, "holds"), (2, "does not hold"), (1, "too few runs")]
    assert [words for _, _, words in verdict_counts(both, beyond=False)] == [v.value for v in Verdict]


@pytest.mark.parametrize(
    ("change", "error"),
    [({"verdict": "perhaps"}, ValueError), ({"interval": [0.5]}, IndexError), ({"colour": "red"}, TypeError)],
)
def test_a_claim_of_another_form_is_refused(change: dict[str, object], error: type[Exception]):
    with pytest.raises(error):
        Claim.from_data({**CLAIM.as_data(), **change})


def test_a_table_has_rows_as_long_as_its_header_and_shows_no_column_that_a_quick_plan_leaves_empty(wording: Wording):
    table = ComparisonTable(title="t", header=["a", "b", "c"], rows=[["1", "", "3"], ["4", "", ""]], note="n")
    assert table.without_empty_columns() == replace(table, header=["a", "c"], rows=[["1", "3"], ["4", ""]])
    with pytest.raises(ValueError) as refused:  # noqa: PT011
        replace(table, rows=[["1"]])
    wording.check(refused.value)
