"""Handovers of the free-flyer that a campaign runs, their rows, and the thresholds of [Fernandes2020] sec. 4.1.2."""

from collections.abc import Sequence
from dataclasses import dataclass

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.free_flyer.parameters import Behaviour, Propulsion, Task, TaskParameters
from handover.scenarios.published.free_flyer.variations import (
    EXACT,
    TASKS,
    USUAL,
    Row,
    Variation,
    has,
    known_rows,
    names_of,
    values_of,
)

_DEFAULT = TaskParameters()

THRUSTS = (Propulsion.IDEAL, Propulsion.LIMITED, Propulsion.NOZZLES)
"""The thesis's pushes need the first; Astrobee's limits are those of each axis, or of twelve nozzles that share."""

_RATE = "handover.controllers.free_flyer.published_rate"
AT_PUBLISHED_RATE = {
    "decision": f"{_RATE}:HandoverStateMachine67",
    "impedance": f"{_RATE}:ImpedanceController67",
    "pose": f"{_RATE}:PoseController67",
}
"""The units on the robot's computer that run at the thesis's 67.5 Hz, by the places that they take."""
WITHOUT_CHANCE = {
    **EXACT,
    **dict.fromkeys(("sight_error", "depth_error"), "0"),
    **{
        f"person.{what}": "0"
        for what in ("tremor_rms", "drift_rms", "reaction_spread", "timing_error", "effort_spread")
    },
}
"""Parameters of a navigation without noise, and of a hand that does not shake, sees and times without error, always
reacts in the same time and pulls with the same effort."""

USUAL_FORCE = f"{_DEFAULT.strength:g} N"
"""Force with which the scenario's person pulls at most, in words."""
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

_VARIED = names_of((*STRENGTHS, *ARMS, *PLACES, *UNGATED, *RATES))


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

    def of(self, rows: Sequence[Row], metric: str) -> Floats:
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


def point_of(task: Task, behaviour: Behaviour, propulsion: Propulsion, variation: Variation = USUAL) -> dict[str, str]:
    """Return the parameters of a handover, as texts."""
    given = {"task": task.item, "behaviour": behaviour.item, "propulsion": propulsion.item}
    return {**given, **variation.parameters}


class HandoverRuns:
    """Rows of the campaign's table by what they are for, those of runs that did not come to their end as well.

    Such a run has no metrics and is no success: whatever counts successes counts it as a failure.
    """

    def __init__(self, table: CampaignTable) -> None:
        self._rows: Sequence[Row] = known_rows(table)
        self._found: dict[tuple[tuple[str, str], ...], list[Row]] = {}

    def of(
        self,
        task: Task,
        behaviour: Behaviour,
        propulsion: Propulsion = Propulsion.LIMITED,
        variation: Variation = USUAL,
    ) -> list[Row]:
        """Return the runs of a task, in the order of their repetitions."""
        wanted = point_of(task, behaviour, propulsion, variation)
        key = tuple(wanted.items())
        if key not in self._found:  # claims, tables and figures ask for the same ones some hundred times
            self._found[key] = [row for row in self._rows if has(row, wanted, _VARIED, _DEFAULT)]
        return [*self._found[key]]

    def usual(self, task: Task | None = None) -> list[Row]:
        """Return the runs of a task, or of all, with the scenario's own values, whatever behaviour and propulsion."""
        tasks = Task if task is None else (task,)
        return [row for t in tasks for b in Behaviour for p in THRUSTS for row in self.of(t, b, p)]
