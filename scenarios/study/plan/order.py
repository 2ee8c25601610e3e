"""The order of a participant's rounds: a Williams square, forwards and backwards, and the seeds of the rounds.

[Williams1949] Williams, Experimental designs balanced for the estimation of residual effects of treatments, 1949.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from handover.scenarios.catalog import named_scenario
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.study.plan.plan import Condition, StudyPlan

_SEEDS = 2**31
_RATING = 8.0
"""Seconds for a statement. Assumed."""


@dataclass(frozen=True)
class Round:
    """A round as planned.

    Attributes:
        number: from 1.
        period: from 1; in each period every condition comes once.
        condition: what is played.
        seed: of all its random numbers.
    """

    number: int
    period: int
    condition: Condition
    seed: int


def williams_square(n: int) -> list[list[int]]:
    """Return n rows of n treatments, 0 to n - 1: each once in every row and column, each once next after each other.

    Row r is 0, 1, n - 1, 2, n - 2, ..., all plus r, modulo n. [Williams1949]

    Raises:
        ValueError: n is odd, for which there is no such square of n rows.
    """
    if n < 2 or n % 2:
        raise ValueError(f"{n} treatments: a Williams square of as many rows needs an even number of them")
    first = [0, *(k for pair in zip(range(1, n // 2 + 1), range(n - 1, n // 2 - 1, -1), strict=True) for k in pair)][:n]
    return [[(k + row) % n for k in first] for row in range(n)]


def order_row(plan: StudyPlan, participant: int) -> int:
    """Return the row of the square that a participant has, from 1, by the participant's number, from 1."""
    return (participant - 1) % len(plan.conditions) + 1


def rounds_of(plan: StudyPlan, participant: int) -> list[Round]:
    """Return a participant's rounds in order, by the participant's number, from 1.

    Odd periods are the participant's row of the square, even ones the same row backwards. So each condition has the
    same mean place in a pair of periods, and a steady gain by practice cancels within each participant; the condition
    at the turn comes twice in a row. The square's rows backwards are its rows: carry-over stays balanced.
    """
    row = williams_square(len(plan.conditions))[order_row(plan, participant) - 1]
    rounds: list[Round] = []
    for period in range(1, plan.repetitions + 1):
        for k in row if period % 2 else row[::-1]:
            number = len(rounds) + 1
            rounds.append(Round(number, period, plan.conditions[k], _seed(plan.seed, participant, number)))
    return rounds


def _seed(plan_seed: int, participant: int, number: int) -> int:
    """Return the seed of a round, which depends on these three alone."""
    return int(np.random.SeedSequence([plan_seed, participant, number]).generate_state(1)[0]) % _SEEDS


def session_duration(plan: StudyPlan) -> dict[str, float]:
    """Return how long a session takes at most, s, by its parts: every round may last until its scenario's stop time.

    Reading and rating a statement takes 8 s, which is assumed.
    """
    parts = {
        "practice": plan.practice,
        "rounds": plan.repetitions * sum(_longest(c) for c in plan.conditions),
        "ratings": plan.rounds * len(plan.statements) * _RATING,
    }
    return {**parts, "together": sum(parts.values())}


def _longest(condition: Condition) -> float:
    scenario = named_scenario(condition.scenario)
    return float(scenario().stop_time(parse_parameters(scenario, condition.given)))


def balance(plan: StudyPlan, participants: int | None = None) -> str:
    """Return whether orders are balanced with so many participants, in a sentence; by default with those planned."""
    n, of = plan.participants if participants is None else participants, len(plan.conditions)
    multiples = f"{of}, {2 * of}, {3 * of} ..."
    whose = "The order of one participant is" if n == 1 else f"The orders of {n} participants are"
    if n and n % of == 0:
        return f"{whose} balanced: each condition follows each other equally often."
    return (
        f"{whose} not balanced: {of} conditions need {multiples} participants, so that each "
        f"condition has each place, and follows each other, equally often."
    )


def balance_of_complete(plan: StudyPlan, numbers: Sequence[int]) -> str:
    """Return whether the orders of complete sessions are balanced, in a sentence, by the participants' numbers.

    They are if each row of the square was played equally often. A number of sessions says nothing of it: who withdrew,
    or broke off, leaves a gap in a row that the next participants' rows do not fill.
    """
    if not numbers:
        return "No session is complete yet, so that no orders can be balanced."
    rows = Counter(order_row(plan, n) for n in numbers)
    played = [rows[row] for row in range(1, len(plan.conditions) + 1)]
    whose = (
        "The orders of the one complete session"
        if len(numbers) == 1
        else f"The orders of {len(numbers)} complete sessions"
    )
    if len(set(played)) == 1:
        return f"{whose} are balanced: each of the square's {len(played)} rows was played {_times(played[0])}."
    each = ", ".join(f"row {row}: {n}" for row, n in enumerate(played, 1))
    return f"{whose} are not balanced, as the square's rows were not played equally often ({each})."


def _times(n: int) -> str:
    return {1: "once", 2: "twice"}.get(n, f"{n} times")
