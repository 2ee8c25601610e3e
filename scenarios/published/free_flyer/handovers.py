"""Handovers of the free-flyer: what is otherwise than usual in them, their transfers, and what counts as a success."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import counted
from handover.plants.free_flyer.robot.navigation import Params as NavigationParams
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.published.runs import Count, Point, Runs, is_done
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Task

TASKS = {
    Task.ROBOT_TO_HUMAN: "robot to human",
    Task.HUMAN_TO_ROBOT: "human to robot",
    Task.FAILED_RECEPTION: "failed reception",
    Task.COLLABORATIVE: "collaborative",
}
"""The four handovers in words."""

PATIENCE = "30"
"""Time after which a robot that feels nothing gives up, s: its flights take half of that."""

_NOISES = tuple(f"{what}_noise" for what in ("position", "attitude", "velocity", "rate"))


@dataclass(frozen=True)
class Variation:
    """Something that is otherwise than in the scenario's defaults.

    Attributes:
        label: what, and by how much, in words.
        parameters: that make it, as texts; {} for the defaults.
    """

    label: str
    parameters: Point = field(default_factory=dict[str, str])


USUAL = Variation("")
EXACT = {f"navigation.{noise}": "0" for noise in _NOISES}
"""Parameters of a navigation without noise."""


def noise_times(factor: float) -> Variation:
    """Return a navigation whose four noises are a factor times the default ones."""
    usual = vars(NavigationParams())
    return Variation(f"noise x {factor:g}", {f"navigation.{n}": f"{factor * usual[n]:g}" for n in _NOISES})


def factor_of(what: str, name: str, factor: float) -> Variation:
    """Return a robot of which something is so many times what its controllers assume."""
    return Variation(f"{what} {100 * (factor - 1):+.0f} %", {name: f"{factor:g}"})


def published(name: str) -> float:
    """Return a number of the thesis."""
    return float(paper_values("free_flyer", "published")[name])


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
        """Return the gripper's speed from which on the robot acts, m/s. [Fernandes2020] sec. 4.1.2."""
        values = paper_values("free_flyer", "published")["velocity_hand" if self.gives else "velocity_gripper"]
        return float(values[behaviour])

    def of(self, runs: Runs, metric: str) -> Floats:
        """Return a metric of it in those runs that have it."""
        return runs.metric(f"{self.metrics}_{metric}")


GIVING = Exchange(Task.ROBOT_TO_HUMAN, "transfer", gives=True)
RECEIVING = Exchange(Task.HUMAN_TO_ROBOT, "transfer", gives=False)
EXCHANGES = (
    GIVING,
    RECEIVING,
    Exchange(Task.FAILED_RECEPTION, "transfer", gives=False),
    Exchange(Task.COLLABORATIVE, "transfer", gives=True),
    Exchange(Task.COLLABORATIVE, "return", gives=False),
)

STUDIED = (Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT, Task.COLLABORATIVE)
"""The three of the user study, sec. 5.5, in the order of table 5.1."""


def published_failures(task: Task, behaviour: Behaviour) -> Count:
    """Return the study's failures of a task and behaviour, and its trials."""
    values = paper_values("free_flyer", "published")
    return int(values["failures"][STUDIED.index(task)][behaviour]), int(values["trials"])


def acted_alone(runs: Runs) -> int:
    """Return in how many runs the robot let go or closed with nobody at the gripper."""
    return int((runs.metric("unprovoked") > 0).sum())


def touched(runs: Runs) -> Runs:
    """Return the runs in which it did not; success after it acted untouched is luck."""
    return runs.where(lambda row: not (row.get("unprovoked") or 0.0) > 0)


def succeeded_touched(runs: Runs) -> Count:
    """Return how many succeeded and had the robot act only on a touch, of how many."""
    return sum(touched(runs).succeeded), len(runs)


def unfinished_note(runs: Runs) -> str:
    """Return a sentence on the runs that did not come to their end; "" if all did."""
    count = sum(not is_done(row) for row in runs)
    of = counted(len(runs), "run")
    return f"Counted as failures: {count} of {of}, which did not come to an end." if count else ""


def every_of(runs: Sequence[Runs]) -> Runs:
    """Return all of some runs."""
    first, *others = runs
    return first.together_with(*others)
