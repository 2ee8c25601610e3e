"""Claims on the free-flyer's user study, [Fernandes2020] sec. 5.8, and on how skill decides failures."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from handover.scenarios.campaign.statistics import LEVEL, sign_flip_test, success_interval, two_proportions
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.parameters import Behaviour, Task
from handover.scenarios.published.free_flyer.study_runs import (
    SKILLS,
    STUDIED,
    Count,
    StudyRuns,
    failures,
    interval_by_person,
    paired,
)
from handover.scenarios.published.free_flyer.variations import TASKS, unfinished_note
from handover.scenarios.published.published_experiment import Claim
from handover.scenarios.published.verdicts import (
    format_interval,
    format_p_value,
    format_rate,
    format_share,
    nothing_measured,
    rate_claim,
    verdict_of,
)

_WHERE = "table 5.1"
_SIMULATED = "The participants are simulated: no person took part."
_MIN_PERSONS = 6
"""Participants of whom something is concluded: so many that differ alike let an exact sign-flip test reject."""
_MIN_TRIALS = 10
"""Trials of a skill of which something is concluded."""


def published_failures(task: Task, behaviour: Behaviour) -> Count:
    """Return the thesis's failures of a task and behaviour, and its trials."""
    published = paper_values("free_flyer", "published")
    return int(published["failures"][STUDIED.index(task)][behaviour]), int(published["trials"])


def claims_of_study(runs: StudyRuns) -> Sequence[Claim]:
    """Judge the thesis's counts and hypothesis H2, and beyond them nominal persons and what skill does."""
    counts = [_rate(runs, task, behaviour) for task in STUDIED for behaviour in Behaviour]
    orders = [_rigid_is_better(runs, task) for task in STUDIED if task is not Task.ROBOT_TO_HUMAN]
    return [*counts, *orders, _nominal_succeed(runs), *(_skill_counts(runs, task) for task in STUDIED)]


def _rate(runs: StudyRuns, task: Task, behaviour: Behaviour) -> Claim:
    failed, n = published_failures(task, behaviour)
    ours, of = failures(runs.of_participants(task, behaviour))
    words = f"Handovers that succeed: {TASKS[task]}, {behaviour.item}"
    claim = rate_claim(words, _WHERE, (n - failed, n), (of - ours, of))
    by_person = runs.by_participant(task, behaviour)
    if not by_person:
        return claim
    low, high = interval_by_person(by_person)
    rows = [row for rows_of in by_person.values() for row in rows_of]
    note = (
        f"The test takes trials of one participant for independent, the thesis's two of each as ours; if "
        f"{len(by_person)} whole participants are resampled instead, ours is "
        f"{format_interval(1.0 - high, 1.0 - low)}. {_SIMULATED} {unfinished_note(rows)}"
    )
    return replace(claim, reason=f"{claim.reason} {note}".strip())


def _rigid_is_better(runs: StudyRuns, task: Task) -> Claim:
    (r, n), (c, _) = (published_failures(task, b) for b in (Behaviour.RIGID, Behaviour.COMPLIANT))
    facts: dict[str, Any] = {
        "claim": f"The rigid robot succeeds more often (H2): {TASKS[task]}",
        "published": f"{r} against {c} of {n} failed",
        "where": "sec. 5.8",
    }
    rigid, compliant = (runs.by_participant(task, b) for b in (Behaviour.RIGID, Behaviour.COMPLIANT))
    pairs = [paired(rows, compliant.get(who, ())) for who, rows in rigid.items()]
    pairs = [of_person for of_person in pairs if of_person]
    if not pairs:
        return nothing_measured(**facts)
    every = [pair for of_person in pairs for pair in of_person]
    differences = [sum(a - b for a, b in of_person) for of_person in pairs]
    p, total = sign_flip_test(differences), len(every)
    left_out = sum(map(len, rigid.values())) + sum(map(len, compliant.values())) - 2 * total
    published_p = two_proportions(n - r, n, n - c, n)
    return Claim(
        **facts,
        measured=" against ".join(format_rate(sum(side), total) for side in zip(*every, strict=True)),
        verdict=verdict_of(p < LEVEL and sum(differences) > 0, could_be_either=len(pairs) >= _MIN_PERSONS),
        reason=f"Reproduced if an exact sign-flip test over the {len(pairs)} participants, each with the difference of "
        f"successes over all trials that share a seed, rejects at {format_share(LEVEL)}, in this direction: p = "
        f"{format_p_value(p)}; it does not take trials of one participant for independent. Trials without "
        f"their like, which are left out: {left_out}. The thesis's own counts do not show it: Fisher's exact "
        f"test of {r} and {c} failures of {n} gives p = "
        f"{format_p_value(published_p)}. {_SIMULATED}",
    )


def _nominal_succeed(runs: StudyRuns) -> Claim:
    facts: dict[str, Any] = {
        "claim": "Persons of nominal skill succeed in all tasks with both behaviours",
        "published": "",
        "beyond": True,
    }
    counts = [failures(runs.of_skill(1.0, task, b)) for task in STUDIED for b in Behaviour]
    if not all(n for _, n in counts):
        return nothing_measured(**facts)
    failed, n = sum(k for k, _ in counts), sum(n for _, n in counts)
    interval = success_interval(n - failed, n)
    holds = all(k <= 0.05 * of for k, of in counts)
    return Claim(
        **facts,
        measured=format_rate(n - failed, n),
        interval=(interval.low, interval.high),
        verdict=verdict_of(holds, could_be_either=min(of for _, of in counts) >= _MIN_TRIALS),
        reason="Holds if 95 % or more do in each of the six; the interval, of all, is Clopper and Pearson's.",
    )


def _skill_counts(runs: StudyRuns, task: Task) -> Claim:
    facts: dict[str, Any] = {"claim": f"Failures grow as skill falls: {TASKS[task]}", "published": "", "beyond": True}
    found = [(s, _failing_scenes(runs, s, task)) for s in SKILLS]
    found = [(s, count) for s, count in found if count[1]]
    if len(found) < 2:
        return nothing_measured(**facts)
    (_, (k_0, n_0)), (_, (k_1, n_1)) = found[0], found[-1]
    p = two_proportions(k_0, n_0, k_1, n_1)
    shares = ", ".join(f"{format_share(k / n)} at {s:g}" for s, (k, n) in found)
    return Claim(
        **facts,
        measured=shares,
        verdict=verdict_of(p < LEVEL and k_0 / n_0 > k_1 / n_1, could_be_either=min(n_0, n_1) >= _MIN_TRIALS),
        reason=f"Holds if Fisher's exact test of the least and the greatest skill rejects at {format_share(LEVEL)} "
        "that they fail equally often, and the least fails more. Both behaviours share their random numbers: a pair of "
        f"them counts once, and as failed if either does. p = {format_p_value(p)}.",
    )


def _failing_scenes(runs: StudyRuns, skill: float, task: Task) -> Count:
    """Return in how many pairs of trials of both behaviours that share a seed either failed, and how many there are."""
    rigid, compliant = (runs.of_skill(skill, task, b) for b in (Behaviour.RIGID, Behaviour.COMPLIANT))
    pairs = paired(rigid, compliant)
    return sum(not (a and b) for a, b in pairs), len(pairs)
