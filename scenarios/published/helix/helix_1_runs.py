"""The runs of `helix-1` with one of the controller's settings, the published values, and phrases for claims."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.display_unit import counted
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.helix.parameters import Tuning
from handover.scenarios.published.published_experiment import Claim
from handover.scenarios.published.verdicts import nothing_measured


@dataclass(frozen=True)
class Helix1Runs:
    """Rows of a campaign's table of runs that came to their end with one tuning, by step size.

    Attributes:
        tuning: the settings.
        rows: rows by alpha, in the plan's order: by place, then repetition.
        broken: runs that a unit's failure, a crash or a lost worker ended: they do not count.
        fitted: whether arm and ball's place are those fitted to fig. 9.
    """

    tuning: Tuning
    rows: Mapping[float, Sequence[Mapping[str, Any]]]
    broken: int
    fitted: bool = False

    @classmethod
    def of(cls, table: CampaignTable, tuning: Tuning, *, fitted: bool = False) -> "Helix1Runs":
        """Pick the rows of a tuning, in a table of runs on the one arm or on the fitted one."""
        mine = [row for row in table.rows if row["tuning"] == tuning.name.lower()]
        done = [row for row in mine if row["status"] == "done"]
        alphas: list[float] = paper_values("helix", "experiment")["alpha"]
        rows = {alpha: [row for row in done if row["alpha"] == alpha] for alpha in alphas}
        return cls(tuning, rows, len(mine) - len(done), fitted)

    @property
    def title(self) -> str:
        """Whose settings, and on which arm, in words."""
        settings = "with the thesis's settings" if self.tuning is Tuning.THESIS else "with our settings"
        return f"{settings}, arm fitted to fig. 9" if self.fitted else settings

    @property
    def suffix(self) -> str:
        """What is added to the name of a figure that there is for more than one arm."""
        return "_fitted" if self.fitted else ""

    @property
    def alphas(self) -> tuple[float, ...]:
        """The step sizes, ascending, whether there are runs or not."""
        return tuple(self.rows)

    @property
    def every(self) -> list[Mapping[str, Any]]:
        """All rows."""
        return [row for rows in self.rows.values() for row in rows]

    @property
    def tried(self) -> int:
        """Number of runs."""
        return len(self.every)

    @property
    def closed(self) -> int:
        """Number of runs in which the gripper began to close."""
        return sum(row.get("arm_time") is not None for row in self.every)

    @property
    def succeeded(self) -> int:
        """Number of runs after which the gripper held the ball."""
        return sum(bool(row["success"]) for row in self.every)

    def metric(self, name: str, alpha: float) -> Floats:
        """Return a metric of the runs at a step size that have it."""
        values = [row.get(name) for row in self.rows[alpha]]
        return np.array([v for v in values if v is not None], dtype=np.float64)

    def times(self, alpha: float) -> Floats:
        """Return the times until the gripper began to close, s, of the runs in which it did."""
        return self.metric("arm_time", alpha)

    def blocks(self) -> Floats:
        """Return times by (place, repetition) and alpha, shape (blocks, 3), s, of the blocks with a run at each alpha.

        A run in which the gripper never began to close took longer than any: infinity.
        """
        by_place = [{(row["place"], row["repetition"]): _time(row) for row in rows} for rows in self.rows.values()]
        shared = [key for key in by_place[0] if all(key in times for times in by_place)]
        return np.array([[times[key] for times in by_place] for key in shared]).reshape(-1, len(by_place))


def _time(row: Mapping[str, Any]) -> float:
    time = row.get("arm_time")
    return np.inf if time is None else float(time)


def published() -> dict[str, Any]:
    """Return the published values by name."""
    return paper_values("helix", "published")


def too_few(facts: dict[str, Any], what: str) -> Claim:
    """Return a claim, given by its fields without a result, as not comparable for too few runs."""
    return nothing_measured(**facts, reason=f"Too few runs: {what}.")


def missing(arm: Helix1Runs, *alphas: float) -> str:
    """Return a sentence on how many runs have no time, as the gripper never began to close; "" if all have one."""
    number = sum(len(arm.rows[alpha]) - len(arm.times(alpha)) for alpha in alphas)
    return f" Without {counted(number, 'run')} in which the gripper never began to close." if number else ""
