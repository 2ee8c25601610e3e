"""Errors of the free-flyer's navigation that a campaign tries one at a time, and the rows of its runs."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import chi

from handover.controllers.free_flyer.handover_parameters import Params as DecisionParams
from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.free_flyer.parameters import Behaviour, Task, TaskParameters
from handover.scenarios.published.free_flyer.variations import USUAL, Row, Variation, has, known_rows, names_of

DRIFT_TIME = 10.0
"""Correlation time of drifts, s: of the order of a transfer (assumed)."""

TRIED = (Task.ROBOT_TO_HUMAN, Task.HUMAN_TO_ROBOT)
_DEFAULT = TaskParameters()


@dataclass(frozen=True)
class EstimateError:
    """Something that is wrong with the navigation's estimate, at several levels up to where handovers fail.

    Attributes:
        label: what, in words.
        parameter: of the navigation's unit.
        levels: in SI units, from the mildest on.
        unit: in which levels are shown, as elsewhere on the pages: m/s and rad/s, but mm and degrees.
        scale: how many of it one SI unit is.
        others: parameters of the unit that go with it, as texts.
    """

    label: str
    parameter: str
    levels: tuple[float, ...]
    unit: str
    scale: float = 1.0
    others: dict[str, str] = field(default_factory=dict[str, str], hash=False)

    def variation(self, level: float) -> Variation:
        """Return the navigation with the error at a level."""
        given = {f"navigation.{self.parameter}": f"{level:g}", **self.others}
        space = "" if self.unit == "°" else " "
        return Variation(f"{self.label} {self.scale * level:.3g}{space}{self.unit}", given)


_DRIFTS = {"navigation.drift_time": f"{DRIFT_TIME:g}"}
DELAY = EstimateError("delay", "delay", (0.016, 0.032, 0.064, 0.128), "ms", 1e3)
VELOCITY_BIAS = EstimateError("bias of velocity", "velocity_bias", (0.002, 0.004, 0.008, 0.016), "m/s")
POSITION_BIAS = EstimateError("bias of position", "position_bias", (0.005, 0.01, 0.02, 0.04), "mm", 1e3)
ESTIMATE_ERRORS = (
    POSITION_BIAS,
    EstimateError("bias of attitude", "attitude_bias", (0.02, 0.05, 0.1), "°", 180.0 / np.pi),
    VELOCITY_BIAS,
    EstimateError("bias of rate", "rate_bias", (0.01, 0.03, 0.1), "rad/s"),
    EstimateError("drift of position", "position_drift", (0.01, 0.03, 0.1), "mm", 1e3, _DRIFTS),
    EstimateError("drift of velocity", "velocity_drift", (0.003, 0.01, 0.03), "m/s", others=_DRIFTS),
    EstimateError("updates", "update_rate", (10.0, 5.0, 2.0, 1.0), "Hz"),
    DELAY,
)
"""One at a time, with the usual noise besides. Biases and drifts are deviations, each axis drawn by itself."""

VARIATIONS = tuple(error.variation(level) for error in ESTIMATE_ERRORS for level in error.levels)
_NAMES = names_of(VARIATIONS)


def point_of(task: Task, behaviour: Behaviour, variation: Variation = USUAL) -> dict[str, str]:
    """Return a point of the plan."""
    return {"task": task.item, "behaviour": behaviour.item, **variation.parameters}


class NavigationRuns:
    """Rows of the campaign's table by what is wrong, those of runs that did not come to their end as well."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows: Sequence[Row] = known_rows(table)

    def of(self, task: Task, behaviour: Behaviour, variation: Variation = USUAL) -> list[Row]:
        """Return the runs of a task with a behaviour and a navigation."""
        wanted = point_of(task, behaviour, variation)
        return [row for row in self._rows if has(row, wanted, _NAMES, _DEFAULT)]

    def all_of(self, variation: Variation = USUAL, tasks: Sequence[Task] = TRIED) -> list[Row]:
        """Return the runs of tasks with both behaviours and a navigation."""
        return [row for task in tasks for b in Behaviour for row in self.of(task, b, variation)]


def signalled(rows: Sequence[Row]) -> int:
    """Return in how many runs the robot found rest in its place and signalled."""
    return sum(row.get("phase_signal") is not None for row in rows)


def rest_probability(deviation: float) -> float:
    """Return how likely a velocity's bias is small enough for a robot at rest to see itself at rest.

    At rest the robot sees the bias, three independent Gaussian components of a deviation, m/s, as its speed, which
    must be below the state machine's `gate_speed`: the length of such a vector has the chi distribution of three
    degrees of freedom. Noise is left out: the speed is low-passed.
    """
    gate_speed = float(DecisionParams().gate_speed)
    return float(chi.cdf(gate_speed / deviation, 3))


def count_probability(count: int, chances: Sequence[float]) -> float:
    """Return the exact p-value, two-sided, of a count of independent events of given chances.

    It is the probability of all counts that are no likelier than this one.
    """
    law: Floats = np.ones(1)
    for chance in chances:
        law = np.convolve(law, [1.0 - chance, chance])
    return min(float(law[law <= law[count] * (1.0 + 1e-9)].sum()), 1.0)
