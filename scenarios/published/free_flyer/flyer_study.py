"""The free-flyer's user study, [Fernandes2020] ch. 5, table 5.1, with simulated participants: no person took part."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import ClassVar

import numpy as np
from matplotlib.axes import Axes

from handover.cosim.blocks.ports import Floats
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS
from handover.scenarios.published.claims import Statement
from handover.scenarios.published.figures import Drawable, Mark, Panel, drawn, level
from handover.scenarios.published.free_flyer.handovers import STUDIED, TASKS, published_failures, unfinished_note
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.runs import Count, Point, Runs, is_known
from handover.scenarios.published.tables import of, table_of
from handover.scenarios.published.verdicts import (
    format_interval,
    format_p_value,
    format_rate,
    format_share,
    rate_claim,
)
from handover.scenarios.robots.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Task
from handover.scenarios.runs.campaign.plan import CampaignPlan
from handover.scenarios.runs.campaign.statistics import (
    LEVEL,
    RESAMPLES,
    sign_flip_test,
    success_interval,
    two_proportions,
)
from handover.scenarios.runs.campaign.table import CampaignTable

SKILLS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of persons who are alike in all else."""
_TRIALS = 20
"""Of each participant, task and behaviour; of each skill likewise."""
_SIMULATED = "The participants are simulated: no person took part."
_MIN_PERSONS = 6
"""Participants of whom something is concluded: so many that differ alike let an exact sign-flip test reject."""
_MIN_TRIALS = 10
"""Trials of a skill of which something is concluded."""
_STROKES = {Behaviour.RIGID: (0, (1, 1)), Behaviour.COMPLIANT: (0, (5, 2))}
"""Of the thesis's counts."""


@dataclass(frozen=True)
class Trait:
    """What participants differ in: a parameter, drawn evenly between two values. All of it is assumed.

    Attributes:
        name: of the scenario's parameter.
        label: what it is, with its unit.
        low, high: in SI units.
        scale: how many of the label's unit are one SI unit.
    """

    name: str
    label: str
    low: float
    high: float
    scale: float = 1.0


TRAITS = (
    Trait("skill", "skill", 0.3, 1.0),
    Trait("strength", "effort, N", 2.0, 6.0),
    Trait("person.arm_reach", "reach, m", 0.7, 0.95),
    Trait("person.tremor_rms", "tremor, mm", 0.0003, 0.0015, 1e3),
    Trait("depth_error", "depth error, mm", 0.004, 0.012, 1e3),
    Trait("interface_delay", "delay, ms", 0.04, 0.10, 1e3),
)
"""Newcomers to the interface, as the thesis's were: some skilled, none of them perfect, behind a delay of up to the
0.1 s that the thesis states."""

Way = tuple[Task, Behaviour]
WAYS: Mapping[str, Way] = {f"{TASKS[task]}, {b.item}": (task, b) for task in STUDIED for b in Behaviour}


@cache
def participants(count: int = 10, seed: int = 2020) -> tuple[Mapping[str, str], ...]:
    """Return participants, as parameters in texts: each trait is drawn by itself."""
    rng = np.random.default_rng(seed)
    drawn_traits = {t.name: rng.uniform(t.low, t.high, count) for t in TRAITS}
    return tuple({name: f"{values[k]:.4g}" for name, values in drawn_traits.items()} for k in range(count))


class FlyerStudy(PublishedExperiment):
    """Ten simulated participants in three tasks with two behaviours, 200 trials each, beside the thesis's 20.

    No person took part. Participants differ in skill, effort, reach, tremor, error of depth and delay, drawn from
    ranges that are assumed, not fitted. What people felt, the thesis's statements S1 to S3, cannot be simulated.
    Besides, persons who differ in skill alone show how failures grow as it falls. Trials of both behaviours share their
    random numbers. The quick plan has four trials of each skill's extremes.
    """

    name: ClassVar[str] = "flyer-study"
    title: ClassVar[str] = (
        "simulated participants, and no person, hand objects over with a free-flyer ([Fernandes2020] ch. 5)"
    )
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return tasks x participants and skills x behaviours; if quick, the least and the greatest skill."""
        skills = [{"skill": f"{s:g}"} for s in (SKILLS[:: len(SKILLS) - 1] if quick else SKILLS)]
        persons = skills if quick else [*participants(), *skills]
        return self.campaign(
            [{"task": t.item, "behaviour": b.item, **p} for t, p, b in product(STUDIED, persons, Behaviour)],
            repetitions=4 if quick else _TRIALS,
            seed=510,
            paired=True,
            scenes=("task", *(trait.name for trait in TRAITS)),
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge table 5.1 and hypothesis H2, and beyond them how failures go by skill."""
        runs = StudyRuns(table)
        return [
            *(_rate(runs, name, way) for name, way in WAYS.items()),
            *(_rigid_is_better(runs, task) for task in STUDIED if task is not Task.ROBOT_TO_HUMAN),
            _nominal_succeed(runs),
            *(_skill_counts(runs, task) for task in STUDIED),
        ]

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return table 5.1 beside ours, what decided the failures, the participants, and failures by skill."""
        runs = StudyRuns(table)
        ours = {name: failures(runs.of_participants(*way)) for name, way in WAYS.items()}
        theirs = {name: _share(published_failures(*way)) for name, way in WAYS.items()}
        numbers = sorted({k for way in WAYS.values() for k in runs.by_participant(*way)})
        persons = [
            {
                "participant": str(k + 1),
                **{n: _share(failures(runs.by_participant(*way).get(k))) for n, way in WAYS.items()},
            }
            for k in numbers
        ]
        totals = [{"participant": "all", **{name: _share(count) for name, count in ours.items()}},
                  {"participant": "table 5.1", **theirs}]  # fmt: skip
        counted = {name: causes(runs.of_participants(*way)) for name, way in WAYS.items()}
        total = sum(counted.values(), start=Counter[Cause]())
        by_skill = {s: {name: failures(runs.of_skill(s, *way)) for name, way in WAYS.items()} for s in SKILLS}
        tables = [
            table_of(
                "Table 5.1: handovers that failed",
                [
                    {"task": TASKS[t], "behaviour": b.item, "published": theirs[name], "ours": _share(ours[name])}
                    for name, (t, b) in WAYS.items()
                    if ours[name][1]
                ],
                "Failures of trials, with the interval of Clopper and Pearson at 95 %. Published: ten persons, two "
                "rounds each. Ours: ten simulated participants; no person took part.",
            ),
            table_of(
                "Participants and tasks, beside table 5.1",
                [*persons, *totals] if persons else [],
                "Failures of each simulated participant's trials, with intervals of Clopper and Pearson at 95 %.",
            ),
            table_of(
                "What decided the failures",
                [
                    {"cause": cause.words, **{name: str(counted[name][cause] or "") for name in WAYS}}
                    for cause, _ in total.most_common()
                ],
                "By ground truth, of the simulated participants' trials; each run's reason says it with its figures.",
            ),
            table_of(
                "The participants",
                [
                    {"number": str(k + 1), **{t.label: f"{t.scale * float(participants()[k][t.name]):.3g}"
                                              for t in TRAITS}}
                    for k in numbers
                ],
                "Each trait is drawn evenly from a range that is assumed. Reach: how far the hand goes from its rest.",
            ),
            table_of(
                "Failures by skill",
                [
                    {"skill": f"{s:g}", **{name: _share(count) for name, count in counts.items()}}
                    for s, counts in by_skill.items()
                    if any(n for _, n in counts.values())
                ],
                "Persons who are nominal in all but their skill. Errors of sight, timing and effort at skill 0 are "
                "eight times those at skill 1, reactions take twice as long, and three of ten attempts do not wait.",
            ),
        ]  # fmt: skip
        return [t for t in tables if t.rows]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw failures by skill, and what decided those of the participants."""
        found = StudyRuns(table)
        counts = {way: [(s, failures(found.of_skill(s, *way))) for s in SKILLS] for way in WAYS.values()}
        counts = {way: [(s, c) for s, c in by_skill if c[1]] for way, by_skill in counts.items()}
        enough = all(len(by_skill) > 1 for by_skill in counts.values())
        panels = [_panel(task, counts) for task in STUDIED] if enough else []
        decided = {name: rows for name, way in WAYS.items() if len(rows := found.of_participants(*way))}
        shares = _Shares({name: (causes(rows), len(rows)) for name, rows in decided.items()})
        axes = {"xlabel": "trials that failed (%)", "xlim": (0.0, max(5.0, 1.05 * shares.most))}
        return [
            *drawn(folder / "skill", "Failures of simulated persons by skill, with intervals at 95 %, who are nominal "
                   "in all else. Dashed and dotted: the thesis's participants, table 5.1.", panels, 3, size=(9.0, 3.3)),
            *drawn(folder / "causes", "What decided the failures of the simulated participants, by ground truth.",
                   [Panel([shares], axes)] if shares.most else [], size=(8.0, 4.2), legend=4),
        ]  # fmt: skip


class StudyRuns:
    """Runs of participants, and of persons of a given skill.

    Those that did not come to their end are among them, and count as failures.
    """

    def __init__(self, table: CampaignTable) -> None:
        self._runs = FlyerStudy().runs(table, is_known)

    def of_participants(self, task: Task, behaviour: Behaviour) -> Runs:
        """Return the trials of the participants, in the order of persons and seeds."""
        return Runs([row for runs in self.by_participant(task, behaviour).values() for row in runs], {})

    def by_participant(self, task: Task, behaviour: Behaviour) -> dict[int, Runs]:
        """Return the trials of each participant, from 0, that there are trials of, in the order of their seeds."""
        way = {"task": task.item, "behaviour": behaviour.item}
        found = {k: self._runs.of({**way, **person}) for k, person in enumerate(participants())}
        return {k: Runs(sorted(runs, key=lambda row: row["seed"]), {}) for k, runs in found.items() if len(runs)}

    def of_skill(self, skill: float, task: Task, behaviour: Behaviour) -> Runs:
        """Return the trials of persons with a skill, who are nominal in all else."""
        given: Point = {"task": task.item, "behaviour": behaviour.item, "skill": f"{skill:g}"}
        return self._runs.of(given)


def paired(first: Runs, second: Runs | None) -> list[tuple[bool, bool]]:
    """Return the successes of trials that share a seed; one whose like is missing is left out."""
    others = {row.get("seed"): done for row, done in zip(second or (), second.succeeded if second else (), strict=True)}
    own = zip(first, first.succeeded, strict=True)
    return [(done, others[row.get("seed")]) for row, done in own if row.get("seed") in others]


def failures(runs: Runs | None) -> Count:
    """Return how many trials failed, of how many; one that did not come to its end failed."""
    return (0, 0) if runs is None else (len(runs) - runs.count[0], len(runs))


def causes(runs: Runs) -> Counter[Cause]:
    """Return what decided the trials that failed, with how often; one that did not come to its end has no cause."""
    return Counter(Cause(int(row["decided_by"])) for row in runs.failed)


def _interval_by_person(by_person: Mapping[int, Runs]) -> str:
    """Return the interval of a rate of success by bootstrap, in which whole persons with all their trials are drawn."""
    counts: Floats = np.array([failures(rows) for rows in by_person.values()], dtype=np.float64)
    resampled = np.random.default_rng(0).integers(len(counts), size=(RESAMPLES, len(counts)))
    totals: Floats = counts[resampled].sum(axis=1)
    low, high = (float(q) for q in np.quantile(totals[:, 0] / totals[:, 1], [LEVEL / 2, 1.0 - LEVEL / 2]))
    return format_interval(1.0 - high, 1.0 - low)


def _rate(runs: StudyRuns, name: str, way: Way) -> Claim:
    (failed, n), (ours, total) = published_failures(*way), failures(runs.of_participants(*way))
    claim = rate_claim(f"Handovers that succeed: {name}", "table 5.1", (n - failed, n), (total - ours, total))
    by_person = runs.by_participant(*way)
    if not by_person:
        return claim
    note = (
        f"With {len(by_person)} whole participants resampled ours is {_interval_by_person(by_person)}. {_SIMULATED} "
        f"{unfinished_note(runs.of_participants(*way))}"
    )
    return replace(claim, reason=f"{claim.reason} {note}".strip())


def _rigid_is_better(runs: StudyRuns, task: Task) -> Claim:
    (r, n), (c, _) = (published_failures(task, b) for b in Behaviour)
    says = Statement(
        f"The rigid robot succeeds more often (H2): {TASKS[task]}", "sec. 5.8", f"{r} against {c} of {n} failed"
    )
    rigid, compliant = (runs.by_participant(task, b) for b in Behaviour)
    pairs = [both for who, rows in rigid.items() if (both := paired(rows, compliant.get(who)))]
    if not pairs:
        return says.unknown()
    every = [pair for of_person in pairs for pair in of_person]
    differences = [sum(a - b for a, b in of_person) for of_person in pairs]
    p, total = sign_flip_test(differences), len(every)
    left_out = sum(map(len, rigid.values())) + sum(map(len, compliant.values())) - 2 * total
    return says.judged(
        " against ".join(format_rate(sum(side), total) for side in zip(*every, strict=True)),
        p < LEVEL and sum(differences) > 0,
        f"an exact sign-flip test over the {len(pairs)} participants, each with the difference of successes over all "
        f"trials that share a seed, rejects at {format_share(LEVEL)}, in this direction: p = {format_p_value(p)}; "
        f"trials without their like, which are left out: {left_out}",
        f"The thesis's own counts do not show it, by Fisher's exact test with p = "
        f"{format_p_value(two_proportions(n - r, n, n - c, n))}. {_SIMULATED}",
        enough=len(pairs) >= _MIN_PERSONS,
    )


def _nominal_succeed(runs: StudyRuns) -> Claim:
    says = Statement("Persons of nominal skill succeed in all tasks with both behaviours")
    counts = [failures(runs.of_skill(1.0, *way)) for way in WAYS.values()]
    least = min(n for _, n in counts)
    if not least:
        return says.unknown()
    failed, n = (sum(numbers) for numbers in zip(*counts, strict=True))
    return says.judged(
        format_rate(n - failed, n),
        all(k <= 0.05 * tried for k, tried in counts),
        "95 % or more do in each of the six; the interval, of all, is Clopper and Pearson's",
        enough=least >= _MIN_TRIALS,
        interval=success_interval(n - failed, n),
    )


def _skill_counts(runs: StudyRuns, task: Task) -> Claim:
    says = Statement(f"Failures grow as skill falls: {TASKS[task]}")
    found: list[tuple[float, int, int]] = []
    for skill in SKILLS:
        pairs = paired(*(runs.of_skill(skill, task, b) for b in Behaviour))
        if pairs:
            found.append((skill, sum(not (a and b) for a, b in pairs), len(pairs)))
    if len(found) < 2:
        return says.unknown()
    (_, k_0, n_0), (_, k_1, n_1) = found[0], found[-1]
    p = two_proportions(k_0, n_0, k_1, n_1)
    return says.judged(
        ", ".join(f"{format_share(k / n)} at {s:g}" for s, k, n in found),
        p < LEVEL and k_0 / n_0 > k_1 / n_1,
        f"Fisher's exact test of the least and the greatest skill rejects at {format_share(LEVEL)} that they fail "
        f"equally often, and the least fails more: p = {format_p_value(p)}",
        "Both behaviours share their random numbers: a pair counts once, and as failed if either does.",
        enough=min(n_0, n_1) >= _MIN_TRIALS,
    )


def _share(count: Count) -> str:
    if not count[1]:
        return ""
    interval = success_interval(*count)
    return f"{of(count)}, {format_share(count[0] / count[1])} ({format_interval(interval.low, interval.high)})"


def _panel(task: Task, found: Mapping[Way, Sequence[tuple[float, Count]]]) -> Panel:
    marks: list[Drawable] = []
    for b in Behaviour:
        rates = np.array([100.0 * k / n for _, (k, n) in found[task, b]])
        intervals = [success_interval(*count) for _, count in found[task, b]]
        bars = [rates - [100 * i.low for i in intervals], [100 * i.high for i in intervals] - rates]
        skills = np.array([s for s, _ in found[task, b]]) + 0.012 * (2 * b - 1)
        failed, n = published_failures(task, b)
        marks.append(Mark(skills, rates, "o-", COLOURS[b], b.item, bars=bars))
        marks.append(level(100 * failed / n, COLOURS[b], f"{b.item}, published", ls=_STROKES[b]))
    axes = {"title": TASKS[task], "xlabel": "skill (1)", "ylabel": "handovers that failed (%)"}
    return Panel(marks, {**axes, "ylim": (-3.0, 103.0)})


@dataclass(frozen=True)
class _Shares:
    """Shares of trials that failed by their causes, a bar for each task and behaviour."""

    found: Mapping[str, tuple[Counter[Cause], int]]

    @property
    def most(self) -> float:
        """The greatest share of failures, %."""
        return max((100 * count.total() / n for count, n in self.found.values()), default=0.0)

    def draw(self, axes: Axes) -> None:
        names, left = list(self.found)[::-1], np.zeros(len(self.found))
        shown = [cause for cause in Cause if any(count[cause] for count, _ in self.found.values())]
        for k, cause in enumerate(shown):
            share = np.array([100 * self.found[name][0][cause] / self.found[name][1] for name in names])
            axes.barh(names, share, left=left, height=0.6, color=COLOURS[k % len(COLOURS)], label=cause.words)
            left += share
