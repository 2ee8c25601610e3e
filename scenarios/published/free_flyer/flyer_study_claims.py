"""Claims on the free-flyer's user study, [Fernandes2020] sec. 5.8, and on how skill decides failures."""

from collections.abc import Sequence
from typing import Any

from handover.scenarios.campaign.statistics import LEVEL, success_interval, two_proportions
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.parameters import Behaviour, Task
from handover.scenarios.published.free_flyer.study_runs import SKILLS, TASKS, Count, StudyRuns, failures
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.verdicts import (
    format_p_value,
    format_rate,
    format_share,
    nothing_measured,
    order_claim,
    rate_claim,
)

_WHERE = "table 5.1"
_PUBLISHED_TRIALS = 20
_SIMULATED = "The participants are simulated: no person took part."
_MIN_TRIALS = 10
"""Trials of a skill of which something is concluded."""


def published_failures(task: Task, behaviour: Behaviour) -> Count:
    """Return the thesis's failures of a task and behaviour, and its trials."""
    counts: list[list[int]] = paper_values("free_flyer", "published")["failures"]
    return counts[list(TASKS).index(task)][behaviour], _PUBLISHED_TRIALS


def claims_of_study(runs: StudyRuns) -> Sequence[Claim]:
    """Judge the thesis's counts and hypothesis H2, and beyond them nominal persons and what skill does."""
    counts = [_rate(runs, task, behaviour) for task in TASKS for behaviour in Behaviour]
    orders = [_rigid_is_better(runs, task) for task in TASKS if task is not Task.ROBOT_TO_HUMAN]
    return [*counts, *orders, _nominal_succeed(runs), *(_skill_counts(runs, task) for task in TASKS)]


def _rate(runs: StudyRuns, task: Task, behaviour: Behaviour) -> Claim:
    failed, n = published_failures(task, behaviour)
    ours, of = failures(runs.of_participants(task, behaviour))
    words = f"Handovers that succeed: {TASKS[task]}, {behaviour.item}"
    return rate_claim(words, _WHERE, (n - failed, n), (of - ours, of))


def _rigid_is_better(runs: StudyRuns, task: Task) -> Claim:
    first, second = (
        [bool(row["success"]) for row in runs.of_participants(task, b)] for b in (Behaviour.RIGID, Behaviour.COMPLIANT)
    )
    (r, n), (c, _) = (published_failures(task, b) for b in (Behaviour.RIGID, Behaviour.COMPLIANT))
    p = two_proportions(n - r, n, n - c, n)
    note = (
        f"The thesis's own counts do not show it: Fisher's exact test of {r} and {c} failures of {n} gives p = "
        f"{format_p_value(p)}. {_SIMULATED}"
    )
    published = f"{r} against {c} of {n} failed"
    words = f"The rigid robot succeeds more often (H2): {TASKS[task]}"
    same = len(first) == len(second)
    return order_claim(words, "sec. 5.8", published, first if same else [], second if same else [], note)


def _nominal_succeed(runs: StudyRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "Persons of nominal skill succeed in all tasks with both behaviours",
        "published": "",
        "beyond": True,
    }
    counts = [failures(runs.of_skill(1.0, task, b)) for task in TASKS for b in Behaviour]
    if not all(n for _, n in counts):
        return nothing_measured(**facts)
    failed, n = sum(k for k, _ in counts), sum(n for _, n in counts)
    interval = success_interval(n - failed, n)
    holds = all(k <= 0.05 * of for k, of in counts)
    return Claim(
        **facts,
        measured=format_rate(n - failed, n),
        interval=(interval.low, interval.high),
        verdict=_verdict(holds) if min(of for _, of in counts) >= _MIN_TRIALS else Verdict.NOT_COMPARABLE,
        reason="Holds if 95 % or more do in each of the six; the interval, of all, is Clopper and Pearson's.",
    )


def _skill_counts(runs: StudyRuns, task: Task) -> Claim:
    facts: dict[str, Any] = {"claim": f"Failures grow as skill falls: {TASKS[task]}", "published": "", "beyond": True}
    found = [(s, failures([r for b in Behaviour for r in runs.of_skill(s, task, b)])) for s in SKILLS]
    found = [(s, count) for s, count in found if count[1]]
    if len(found) < 2:
        return nothing_measured(**facts)
    (_, (k_0, n_0)), (_, (k_1, n_1)) = found[0], found[-1]
    p = two_proportions(k_0, n_0, k_1, n_1)
    shares = ", ".join(f"{format_share(k / n)} at {s:g}" for s, (k, n) in found)
    return Claim(
        **facts,
        measured=shares,
        verdict=_verdict(p < LEVEL and k_0 / n_0 > k_1 / n_1) if n_0 >= _MIN_TRIALS else Verdict.NOT_COMPARABLE,
        reason=f"Holds if Fisher's exact test of the least and the greatest skill, both behaviours together, rejects "
        f"at {format_share(LEVEL)} that they fail equally often, and the least fails more: p = {format_p_value(p)}.",
    )


def _verdict(holds: bool) -> Verdict:
    return Verdict.REPRODUCED if holds else Verdict.NOT_REPRODUCED
