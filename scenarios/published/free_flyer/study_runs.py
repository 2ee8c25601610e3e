"""Simulated participants of the free-flyer's study, their trials, and those of persons of a given skill."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.free_flyer.parameters import Behaviour, Task
from handover.scenarios.free_flyer.person_evaluation import Cause

TASKS = {
    Task.ROBOT_TO_HUMAN: "robot to human",
    Task.HUMAN_TO_ROBOT: "human to robot",
    Task.COLLABORATIVE: "collaborative",
}
"""The three of sec. 5.5 in words, in the order of table 5.1."""

SKILLS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of persons who are alike in all else."""

ROUNDS = 2
"""Trials of each participant for each task and behaviour in the thesis, sec. 5.7."""

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
    """Rows of the campaign's table of runs that came to their end: of participants, and of persons of a given skill."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows = [row for row in table.rows if row["status"] == "done"]
        names = [t.name for t in TRAITS]
        self._persons = {tuple(float(p[n]) for n in names): k for k, p in enumerate(participants())}
        self._who = [self._persons.get(tuple(_number(row, n) for n in names)) for row in self._rows]

    def of_participants(self, task: Task, behaviour: Behaviour, number: int | None = None) -> list[Mapping[str, Any]]:
        """Return the trials of the participants, or of one of them, from 0, in the order of persons and repetitions."""
        found = [
            (who, row["seed"], row)
            for who, row in zip(self._who, self._rows, strict=True)
            if who is not None and number in (None, who) and _is_of(row, task, behaviour)
        ]
        return [row for _, _, row in sorted(found, key=lambda entry: entry[:2])]

    def of_skill(self, skill: float, task: Task, behaviour: Behaviour) -> list[Mapping[str, Any]]:
        """Return the trials of persons with a skill, who are nominal in all else."""
        return [
            row
            for who, row in zip(self._who, self._rows, strict=True)
            if who is None and _number(row, "skill") == skill and _is_of(row, task, behaviour)
        ]


def _is_of(row: Mapping[str, Any], task: Task, behaviour: Behaviour) -> bool:
    return row["task"] == task.item and row["behaviour"] == behaviour.item


def _number(row: Mapping[str, Any], name: str) -> float:
    value = row.get(name)
    return float("nan") if value is None else float(value)


def failures(rows: Sequence[Mapping[str, Any]]) -> Count:
    """Return how many trials failed, of how many."""
    return sum(not row["success"] for row in rows), len(rows)


def causes(rows: Sequence[Mapping[str, Any]]) -> Counter[Cause]:
    """Return what decided the trials that failed, with how often."""
    return Counter(Cause(int(row["decided_by"])) for row in rows if not row["success"])
