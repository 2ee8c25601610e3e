"""The free-flyer's user study, [Fernandes2020] ch. 5, table 5.1, with simulated participants: no person took part."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from matplotlib.lines import Line2D

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.statistics import success_interval
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import COLOURS, figure, legend_below
from handover.scenarios.free_flyer.handover.handovers import HandoverOfTask
from handover.scenarios.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.free_flyer.parameters import Behaviour
from handover.scenarios.published.free_flyer.flyer_study_claims import claims_of_study, published_failures
from handover.scenarios.published.free_flyer.study_runs import (
    SKILLS,
    STUDIED,
    TRAITS,
    StudyRuns,
    causes,
    failures,
    participants,
    trials,
)
from handover.scenarios.published.free_flyer.variations import TASKS
from handover.scenarios.published.published_experiment import Claim, ComparisonTable, PublishedExperiment
from handover.scenarios.published.verdicts import format_interval, format_share

_STROKES = {Behaviour.RIGID: (0, (1, 1)), Behaviour.COMPLIANT: (0, (5, 2))}
"""Of the thesis's counts."""
_WORDS = tuple(TASKS[task] for task in STUDIED)
_TRIALS = 20
"""Of each participant, task and behaviour; of each skill likewise."""


class FlyerStudy(PublishedExperiment):
    """Ten simulated participants in three tasks with two behaviours, 200 trials each, beside the thesis's 20.

    No person took part. Participants differ in skill, effort, reach, tremor, error of depth and delay, drawn from
    ranges that are assumed, not fitted; what people felt, the thesis's statements S1 to S3, cannot be simulated.
    Besides, persons who differ in skill alone show how failures grow as it falls. Trials of both behaviours share
    their random numbers. The quick plan has four trials of each skill's extremes.
    """

    name: ClassVar[str] = "flyer-study"
    title: ClassVar[str] = (
        "simulated participants, and no person, hand objects over with a free-flyer ([Fernandes2020] ch. 5)"
    )
    scenario: ClassVar[str] = HandoverOfTask.name

    def plan(self, quick: bool) -> CampaignPlan:
        """Return tasks x participants and skills x behaviours; if quick, the least and the greatest skill."""
        skills = [{"skill": f"{s:g}"} for s in (SKILLS[:: len(SKILLS) - 1] if quick else SKILLS)]
        return CampaignPlan(
            scenario=self.scenario,
            points=trials(STUDIED, skills if quick else [*participants(), *skills]),
            repetitions=4 if quick else _TRIALS,
            seed=510,
            paired=True,
            scenes=("task", *(trait.name for trait in TRAITS)),
            experiment=self.name,
        )

    def claims(self, table: CampaignTable) -> Sequence[Claim]:
        """Judge table 5.1 and hypothesis H2, and beyond them how failures go by skill."""
        return claims_of_study(StudyRuns(table))

    def tables(self, table: CampaignTable) -> Sequence[ComparisonTable]:
        """Return table 5.1 beside ours, what decided the failures, the participants, and failures by skill."""
        runs = StudyRuns(table)
        made = (_failures(runs), _by_participant(runs), _causes(runs), _participants(runs), _by_skill(runs))
        return [t for t in made if t.rows]

    def draw(self, table: CampaignTable, runs: Path, folder: Path) -> Sequence[Figure]:  # noqa: ARG002
        """Draw failures by skill, and what decided those of the participants."""
        found = StudyRuns(table)
        return [*_draw_by_skill(found, folder), *_draw_causes(found, folder)]


def _failures(runs: StudyRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for task in STUDIED:
        for behaviour in Behaviour:
            ours = failures(runs.of_participants(task, behaviour))
            if ours[1]:
                cells = [_share(*published_failures(task, behaviour)), _share(*ours)]
                rows.append([TASKS[task], behaviour.item, *cells])
    return ComparisonTable(
        title="Table 5.1: handovers that failed",
        header=["task", "behaviour", "published", "ours"],
        rows=rows,
        note="Failures of trials, with the interval of Clopper and Pearson at 95 %. Published: ten persons, two rounds "
        "each. Ours: ten simulated participants; no person took part. In the collaborative task either handover can "
        "fail.",
    )


def _causes(runs: StudyRuns) -> ComparisonTable:
    found = {(task, b): causes(runs.of_participants(task, b)) for task in STUDIED for b in Behaviour}
    total = sum(found.values(), start=causes([]))
    columns = [(task, b) for task in STUDIED for b in Behaviour]
    return ComparisonTable(
        title="What decided the failures",
        header=["cause", *(f"{TASKS[task]}, {b.item}" for task, b in columns)],
        rows=[[cause.words, *(str(found[c][cause] or "") for c in columns)] for cause, _ in total.most_common()],
        note="By ground truth, of the simulated participants' trials; each run's reason says it with its figures.",
    )


def _participants(runs: StudyRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for number, person in enumerate(participants()):
        if any(number in runs.by_participant(task, b) for task in STUDIED for b in Behaviour):
            rows.append([str(number + 1), *(f"{t.scale * float(person[t.name]):.3g}" for t in TRAITS)])
    return ComparisonTable(
        title="The participants",
        header=["number", *(t.label for t in TRAITS)],
        rows=rows,
        note="Each trait is drawn evenly from a range that is assumed. Reach: how far the hand goes from its rest.",
    )


def _by_participant(runs: StudyRuns) -> ComparisonTable:
    """Return the failures of each participant in each task, and of all, above those of table 5.1."""
    columns = [(task, b) for task in STUDIED for b in Behaviour]
    found = {column: runs.by_participant(*column) for column in columns}
    numbers = sorted({number for by_person in found.values() for number in by_person})
    rows = [[str(k + 1), *(_share(*failures(found[c].get(k, ()))) for c in columns)] for k in numbers]
    if rows:
        rows.append(["all", *(_share(*failures(runs.of_participants(*c))) for c in columns)])
        rows.append(["table 5.1", *(_share(*published_failures(*c)) for c in columns)])
    return ComparisonTable(
        title="Participants and tasks, beside table 5.1",
        header=["participant", *(f"{TASKS[task]}, {b.item}" for task, b in columns)],
        rows=rows,
        note="Failures of trials, with the exact interval of Clopper and Pearson at 95 %, which takes trials for "
        "independent. The participants are simulated; table 5.1 has ten persons, two rounds each, together.",
    )


def _by_skill(runs: StudyRuns) -> ComparisonTable:
    rows: list[list[str]] = []
    for skill in SKILLS:
        counts = [failures(runs.of_skill(skill, task, b)) for task in STUDIED for b in Behaviour]
        if any(n for _, n in counts):
            rows.append([f"{skill:g}", *(_share(*count) for count in counts)])
    return ComparisonTable(
        title="Failures by skill",
        header=["skill", *(f"{words}, {b.item}" for words in _WORDS for b in Behaviour)],
        rows=rows,
        note="Persons who are nominal in all but their skill. Errors of sight, timing and effort at skill 0 are eight "
        "times those at skill 1, reactions take twice as long, and three of ten attempts do not wait for the gripper.",
    )


def _share(count: int, n: int) -> str:
    if not n:
        return ""
    interval = success_interval(count, n)
    return f"{count} of {n}, {format_share(count / n)} ({format_interval(interval.low, interval.high)})"


def _draw_by_skill(runs: StudyRuns, folder: Path) -> list[Figure]:
    found = {
        (task, b): [(s, *c) for s in SKILLS if (c := failures(runs.of_skill(s, task, b)))[1]]
        for task in STUDIED
        for b in Behaviour
    }
    if any(len(points) < 2 for points in found.values()):
        return []
    with figure(folder / "skill", 1, len(STUDIED), size=(9.0, 3.3)) as panels:
        for axis, (task, words) in zip(panels, zip(STUDIED, _WORDS, strict=True), strict=True):
            for behaviour in Behaviour:
                skill, k, n = (np.array(a, dtype=np.float64) for a in zip(*found[task, behaviour], strict=True))
                low, high = _bounds(k, n)
                colour, aside = COLOURS[int(behaviour)], 0.012 * (2 * int(behaviour) - 1)
                errors = [100 * (k / n - low), 100 * (high - k / n)]
                axis.errorbar(skill + aside, 100 * k / n, errors, fmt="o-", ms=4, lw=1.2, capsize=2, color=colour)
                failed, of = published_failures(task, behaviour)
                axis.axhline(100 * failed / of, color=colour, ls=_STROKES[behaviour], lw=1.0)
            axis.set(title=words, xlabel="skill (1)", ylim=(-3.0, 103.0))
        panels[0].set_ylabel("handovers that failed (%)")
        legend_below(panels[0], _entries())
    caption = (
        "Failures of simulated persons by skill, with intervals at 95 %, who are nominal in all else. Dashed and "
        "dotted: the thesis's participants, table 5.1."
    )
    return [Figure("skill", caption)]


def _bounds(k: Any, n: Any) -> tuple[Any, Any]:
    intervals = [success_interval(int(a), int(b)) for a, b in zip(k, n, strict=True)]
    return np.array([i.low for i in intervals]), np.array([i.high for i in intervals])


def _entries() -> dict[str, Line2D]:
    """Return the legend's entries of behaviours and strokes."""
    ours = {b.item: Line2D([], [], color=COLOURS[int(b)], marker="o", ms=4, lw=1.2) for b in Behaviour}
    theirs = {f"{b.item}, published": Line2D([], [], color=COLOURS[int(b)], ls=_STROKES[b], lw=1.0) for b in Behaviour}
    return {**ours, **theirs}


def _draw_causes(runs: StudyRuns, folder: Path) -> list[Figure]:
    found = {f"{TASKS[t]}, {b.item}": runs.of_participants(t, b) for t in STUDIED for b in Behaviour}
    counted = {name: causes(rows) for name, rows in found.items() if rows}
    shown = [cause for cause in Cause if any(count[cause] for count in counted.values())]
    if not shown:
        return []
    with figure(folder / "causes", 1, size=(8.0, 3.6)) as (axis,):
        names, left = list(counted)[::-1], np.zeros(len(counted))
        for k, cause in enumerate(shown):
            share = np.array([100 * counted[name][cause] / len(found[name]) for name in names])
            axis.barh(names, share, left=left, height=0.6, color=COLOURS[k % len(COLOURS)], label=cause.words)
            left += share
        axis.set(xlabel="trials that failed (%)", xlim=(0.0, max(5.0, 1.05 * float(left.max()))))
        axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0))
    return [Figure("causes", "What decided the failures of the simulated participants, by ground truth.")]
