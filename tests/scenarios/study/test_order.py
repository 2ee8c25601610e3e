"""Orders of rounds: Williams squares, whose periods turn back, and seeds by plan, participant and round."""

import itertools
from collections import Counter

import pytest
from support.wording import Wording

from handover.scenarios.study.plan.order import balance, balance_of_complete, order_row, rounds_of, williams_square
from handover.scenarios.study.plan.plan import default_plan, parse_plan

PLAN = parse_plan(default_plan())


@pytest.mark.parametrize("n", [2, 4, 6, 8])
def test_a_square_has_each_treatment_in_each_place_and_next_after_each_other_once(n: int):
    square = williams_square(n)
    assert all(sorted(line) == list(range(n)) for line in (*square, *zip(*square, strict=True)))
    follows = Counter(pair for row in square for pair in itertools.pairwise(row))
    assert set(follows.values()) == {1}
    assert len(follows) == n * (n - 1)


def test_six_people_meet_each_condition_twice_each_after_each_other_twice():
    orders = [[PLAN.conditions.index(r.condition) for r in rounds_of(PLAN, p)] for p in range(1, 7)]
    assert all(Counter(order) == dict.fromkeys(range(6), 2) for order in orders)
    assert all(Counter(place) == dict.fromkeys(range(6), 1) for place in zip(*orders, strict=True))
    follows = Counter(pair for order in orders for pair in itertools.pairwise(order))
    assert {follows[a, b] for a in range(6) for b in range(6) if a != b} == {2}
    assert {follows[a, a] for a in range(6)} == {1}


def test_each_condition_has_the_same_mean_place_in_every_persons_rounds():
    for participant in range(1, 19):
        rounds = rounds_of(PLAN, participant)
        assert [r.number for r in rounds] == list(range(1, 13))
        assert [r.period for r in rounds] == [1] * 6 + [2] * 6
        for condition in PLAN.conditions:
            assert sum(r.number for r in rounds if r.condition == condition) == 13


def test_rows_go_by_number_and_come_again():
    assert [order_row(PLAN, p) for p in (1, 2, 6, 7, 18)] == [1, 2, 6, 1, 6]
    assert [r.condition for r in rounds_of(PLAN, 1)] == [r.condition for r in rounds_of(PLAN, 7)]


def test_seeds_differ_by_round_and_person_and_come_again_with_the_plan():
    seeds = [r.seed for p in range(1, 100) for r in rounds_of(PLAN, p)]
    assert len(set(seeds)) == len(seeds)
    assert seeds[:12] == [r.seed for r in rounds_of(PLAN, 1)]
    other = parse_plan(default_plan().replace("seed = 2020", "seed = 2021"))
    assert not set(seeds[:12]) & {r.seed for r in rounds_of(other, 1)}


@pytest.mark.parametrize("n", [0, 1, 3])
def test_odd_numbers_have_none(n: int):
    with pytest.raises(ValueError):  # noqa: PT011
        williams_square(n)


def test_balance_is_reported_and_that_of_complete_sessions_by_their_rows(wording: Wording):
    for reported in (
        balance(PLAN),
        balance(PLAN, 10),
        balance_of_complete(PLAN, range(1, 13)),
        balance_of_complete(PLAN, [1, *range(3, 14)]),
        balance_of_complete(PLAN, []),
    ):
        wording.check(reported)
