"""Handovers of the free-flyer that a campaign runs, their rows, and the thresholds of [Fernandes2020] sec. 4.1.2."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.parameters import Behaviour, Propulsion, Task, TaskParameters

_DEFAULT = TaskParameters()

TASKS = {
    Task.ROBOT_TO_HUMAN: "robot to human",
    Task.HUMAN_TO_ROBOT: "human to robot",
    Task.FAILED_RECEPTION: "failed reception",
    Task.COLLABORATIVE: "collaborative",
}
"""The four handovers in words."""

THRUSTS = (Propulsion.IDEAL, Propulsion.LIMITED)
"""The thesis's pushes need the first; Astrobee's limits of each axis are the second."""

_RATE = "handover.controllers.free_flyer.published_rate"
AT_PUBLISHED_RATE = {
    "decision": f"{_RATE}:HandoverStateMachine67",
    "impedance": f"{_RATE}:ImpedanceController67",
    "pose": f"{_RATE}:PoseController67",
}
"""The units on the robot's computer that run at the thesis's 67.5 Hz, by the places that they take."""
WITHOUT_CHANCE = {
    **{f"navigation.{what}_noise": "0" for what in ("position", "attitude", "velocity", "rate")},
    **{f"person.{what}": "0" for what in ("tremor_rms", "drift_rms", "reaction_spread")},
}
"""Parameters of a navigation without noise and of a hand that does not shake, and always reacts in the same time."""


@dataclass(frozen=True)
class Variation:
    """Something that is otherwise than in the scenario's defaults.

    Attributes:
        label: what, and by how much, in words.
        parameters: that make it, as texts; {} for the defaults.
    """

    label: str
    parameters: Mapping[str, str] = field(default_factory=dict[str, str])


USUAL = Variation("")

STRENGTHS = tuple(Variation(f"{n:g} N", {"strength": f"{n:g}"}) for n in (0.3, 0.5, 1.0, 2.0, 8.0))
"""Persons who pull with other forces than the default's at most."""
ARMS = tuple(
    Variation(f"arm {100 * (k - 1):+.0f} %", {"arm_factor": f"{k:g}", "model_arm_factor": f"{k:g}"}) for k in (0.5, 1.5)
)
"""Robots with arms of other lengths, which their controllers know."""
PLACES = tuple(
    Variation(f"at ({place.replace(',', ', ')}) m", {"p_WG_handover": place})
    for place in ("0.2,-0.07,0", "0,-0.3,0", "0,-0.07,0.3")
)
"""Other places of the handover."""
UNGATED = tuple(
    Variation(f"within {100 * d:g} cm", {"gated": "false", "decision.gate_error": f"{d:g}"}) for d in (0.05, 0.1, 0.2)
)
"""Robots that yield and signal while they still move, as soon as they are so near their place."""
RATES = (
    Variation("62.5 Hz", WITHOUT_CHANCE),
    Variation("67.5 Hz", {**WITHOUT_CHANCE, **AT_PUBLISHED_RATE}),
)
"""Astrobee's rate of control, and that which the thesis prints; nothing is random in either."""

_VARIED = tuple(dict.fromkeys(name for v in (*STRENGTHS, *ARMS, *PLACES, *UNGATED, *RATES) for name in v.parameters))


@dataclass(frozen=True)
class Exchange:
    """A transfer of the object in one of the tasks.

    Attributes:
        task: of which it is part.
        metrics: begin of its metrics' names.
        gives: whether the robot gives, rather than receives.
    """

    task: Task
    metrics: str
    gives: bool

    @property
    def label(self) -> str:
        """Task, and where it has two transfers, which."""
        which = (", giving" if self.gives else ", receiving") if self.task is Task.COLLABORATIVE else ""
        return f"{TASKS[self.task]}{which}"

    def threshold(self, behaviour: Behaviour) -> float:
        """Return the gripper's speed from which on the robot acts, m/s."""
        published = paper_values("free_flyer", "published")
        return float(published["velocity_hand" if self.gives else "velocity_gripper"][behaviour])

    def of(self, rows: Sequence[Mapping[str, Any]], metric: str) -> Floats:
        """Return a metric of it in those rows that have it."""
        return values_of(rows, f"{self.metrics}_{metric}")


GIVING = Exchange(Task.ROBOT_TO_HUMAN, "transfer", gives=True)
RECEIVING = Exchange(Task.HUMAN_TO_ROBOT, "transfer", gives=False)
EXCHANGES = (
    GIVING,
    RECEIVING,
    Exchange(Task.FAILED_RECEPTION, "transfer", gives=False),
    Exchange(Task.COLLABORATIVE, "transfer", gives=True),
    Exchange(Task.COLLABORATIVE, "return", gives=False),
)


def values_of(rows: Sequence[Mapping[str, Any]], column: str) -> Floats:
    """Return a column's values in those rows that have it, in their order."""
    found = [row.get(column) for row in rows]
    return np.array([float(x) for x in found if x is not None and x == x])


def point_of(task: Task, behaviour: Behaviour, propulsion: Propulsion, variation: Variation = USUAL) -> dict[str, str]:
    """Return the parameters of a handover, as texts."""
    given = {"task": task.item, "behaviour": behaviour.item, "propulsion": propulsion.item}
    return {**given, **variation.parameters}


class HandoverRuns:
    """Rows of the campaign's table of runs that came to their end, by what they are for."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows = [row for row in table.rows if row["status"] == "done"]

    def of(
        self,
        task: Task,
        behaviour: Behaviour,
        propulsion: Propulsion = Propulsion.LIMITED,
        variation: Variation = USUAL,
    ) -> list[Mapping[str, Any]]:
        """Return the runs of a task, in the order of their repetitions."""
        wanted = point_of(task, behaviour, propulsion)
        return [
            row
            for row in self._rows
            if all(row[name] == text for name, text in wanted.items()) and is_of(row, variation, _VARIED)
        ]

    def usual(self, task: Task | None = None) -> list[Mapping[str, Any]]:
        """Return the runs of a task, or of all, with the scenario's own values, whatever behaviour and propulsion."""
        tasks = Task if task is None else (task,)
        return [row for t in tasks for b in Behaviour for p in THRUSTS for row in self.of(t, b, p)]


def is_of(row: Mapping[str, Any], variation: Variation, names: Sequence[str]) -> bool:
    """Return whether, of the named parameters, a row has those of a variation, and no other but the defaults."""
    return all(_is(row, name, variation.parameters.get(name)) for name in names)


def _is(row: Mapping[str, Any], name: str, text: str | None) -> bool:
    """Return whether a row has a parameter's value; None: that it was not set, or to the scenario's default."""
    value: Any = row.get(name)
    default = getattr(_DEFAULT, name, None)
    if text is None:
        if value is None or value == "" or value != value:
            return True
        return default is not None and np.array_equal(np.asarray(value), np.asarray(default))
    if isinstance(value, str):
        return value == text
    return value is not None and np.array_equal(np.atleast_1d(value), _numbers(text))


def _numbers(text: str) -> Floats:
    return np.array([{"true": 1.0, "false": 0.0}[x] if x in ("true", "false") else float(x) for x in text.split(",")])
