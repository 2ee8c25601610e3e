"""Simulated participants of the free-flyer's study, their trials, and those of persons of a given skill."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.statistics import LEVEL, RESAMPLES
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.free_flyer.parameters import Behaviour, Task, TaskParameters
from handover.scenarios.published.free_flyer.variations import Row, has, is_done, known_rows, succeeded

_DEFAULT = TaskParameters()

STUDIED = (Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT, Task.COLLABORATIVE)
"""The three of sec. 5.5, in the order of table 5.1."""

SKILLS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of persons who are alike in all else."""

Count = tuple[int, int]
"""Failures, and trials."""


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


@cache
def participants(count: int = 10, seed: int = 2020) -> tuple[Mapping[str, str], ...]:
    """Return participants, as parameters in texts: each trait is drawn by itself."""
    rng = np.random.default_rng(seed)
    drawn = {t.name: rng.uniform(t.low, t.high, count) for t in TRAITS}
    return tuple({name: f"{values[k]:.4g}" for name, values in drawn.items()} for k in range(count))


def trials(tasks: Sequence[Task], persons: Sequence[Mapping[str, str]]) -> list[dict[str, str]]:
    """Return the points of a campaign: each person in each task with each behaviour."""
    return [
        {"task": task.item, "behaviour": behaviour.item, **person}
        for task in tasks
        for person in persons
        for behaviour in Behaviour
    ]


class StudyRuns:
    """Rows of the campaign's table: of participants, and of persons of a given skill.

    Runs that did not come to their end are among them, and count as failures.
    """

    def __init__(self, table: CampaignTable) -> None:
        self._trials: dict[tuple[Any, ...], list[Row]] = {}
        for row in known_rows(table):
            key = (_who(row), row.get("task"), row.get("behaviour"))
            self._trials.setdefault(key, []).append(row)

    def of_participants(self, task: Task, behaviour: Behaviour, number: int | None = None) -> list[Row]:
        """Return the trials of the participants, or of one of them, from 0, in the order of persons and seeds."""
        by_person = self.by_participant(task, behaviour)
        return [row for who, rows in by_person.items() for row in rows if number in (None, who)]

    def by_participant(self, task: Task, behaviour: Behaviour) -> dict[int, list[Row]]:
        """Return the trials of each participant that there are trials of, in the order of their seeds."""
        found = {who: self._trials.get((who, task.item, behaviour.item)) for who in range(len(participants()))}
        return {who: sorted(rows, key=lambda row: row["seed"]) for who, rows in found.items() if rows}

    def of_skill(self, skill: float, task: Task, behaviour: Behaviour) -> list[Row]:
        """Return the trials of persons with a skill, who are nominal in all else."""
        names = [t.name for t in TRAITS if t.name != "skill"]
        found = self._trials.get((None, task.item, behaviour.item), [])
        return [row for row in found if has(row, {"skill": f"{skill:g}"}, names, _DEFAULT)]


def _who(row: Row) -> int | None:
    """Return whose trial it is, as a participant's number from 0; None if it is nobody's of them."""
    return next((k for k, person in enumerate(participants()) if has(row, person, (), _DEFAULT)), None)


def paired(first: Sequence[Row], second: Sequence[Row]) -> list[tuple[bool, bool]]:
    """Return the successes of trials that share a seed; one whose like is missing is left out."""
    others = {row["seed"]: row for row in second}
    return [(_succeeded(row), _succeeded(others[row["seed"]])) for row in first if row["seed"] in others]


def _succeeded(row: Row) -> bool:
    return succeeded([row]) == 1


def interval_by_person(by_person: Mapping[int, Sequence[Row]]) -> tuple[float, float]:
    """Return the interval of a rate of failure by bootstrap, in which whole persons with all their trials are drawn."""
    counts: Floats = np.array([failures(rows) for rows in by_person.values()], dtype=np.float64)
    drawn = np.random.default_rng(0).integers(len(counts), size=(RESAMPLES, len(counts)))
    totals: Floats = counts[drawn].sum(axis=1)
    low, high = (float(q) for q in np.quantile(totals[:, 0] / totals[:, 1], [LEVEL / 2, 1.0 - LEVEL / 2]))
    return low, high


def failures(rows: Sequence[Row]) -> Count:
    """Return how many trials failed, of how many; one that did not come to its end failed."""
    return len(rows) - succeeded(rows), len(rows)


def causes(rows: Sequence[Row]) -> Counter[Cause]:
    """Return what decided the trials that failed, with how often; one that did not come to its end has no cause."""
    return Counter(Cause(int(row["decided_by"])) for row in rows if is_done(row) and not row["success"])
