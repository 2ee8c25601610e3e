"""The runs of the experiment `ir-table`, by arm, pose and object."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.controllers.ir_grasp.parameters import Strategy
from handover.plants.ir_grasp.objects import SOLIDS, Thing
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp

POSES: Mapping[bool, str] = {False: "nominal", True: "perturbed"}
"""By whether the object is moved after vision saw it."""

OBJECTS: Mapping[str, tuple[Thing, ...]] = {
    "cylinder": (Thing.CYLINDER,),
    "baby_cup": (Thing.BABY_CUP_A, Thing.BABY_CUP_B),
    "paper_box": (Thing.PAPER_BOX_A, Thing.PAPER_BOX_B),
}
"""Rows of table II, which does not distinguish the poses (a) and (b)."""


@dataclass(frozen=True)
class Arm:
    """A way to grasp.

    Attributes:
        title: what it is called.
        column: its columns in table I, nominal and perturbed; None if the paper has not tried it.
    """

    title: str
    strategy: Strategy
    forward: float | None = None
    column: tuple[int, int] | None = None

    @property
    def parameters(self) -> dict[str, str]:
        """The scenario's parameters that make it."""
        forward = {} if self.forward is None else {"forward": f"{self.forward:g}"}
        return {"strategy": self.strategy.name.lower(), **forward}


REFLEX = Arm("IR-guided", Strategy.REFLEX, column=(0, 2))
BLIND = Arm("blind", Strategy.BLIND, column=(1, 3))
FORWARD_35 = Arm("forward 35 mm", Strategy.FORWARD, 0.035)
FORWARD_55 = Arm("forward 55 mm", Strategy.FORWARD, 0.055)
ARMS = (REFLEX, BLIND, FORWARD_35, FORWARD_55)

Count = tuple[int, int]
"""Successes and trials."""


class IrTableRuns:
    """Our results, cell by cell, and the published ones. Runs that did not come to their end do not count."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows = table.rows
        self._published = paper_values(IrGrasp.name, "published")

    @property
    def not_done(self) -> int:
        """Number of runs that do not count, as a unit failed or a worker was lost."""
        return sum(row["status"] != "done" for row in self._rows)

    @property
    def closing_distance(self) -> tuple[float, float]:
        """Distances, in m, from the least to the most of which the hand is said to succeed in closing."""
        low, high = self._published["closing_distance"]
        return low, high

    def published(self, arm: Arm, perturbed: bool, thing: Thing | None = None) -> Count | None:
        """Return a cell of table I, or its total; None if the paper has not tried the arm."""
        if arm.column is None:
            return None
        k = self._published["total" if thing is None else thing.name.lower()][arm.column[perturbed]]
        return int(k), self._published["trials"] * (len(SOLIDS) if thing is None else 1)

    def published_distances(self, name: str, perturbed: bool) -> dict[str, float]:
        """Return a row of table II, in m by finger."""
        values = self._published[f"final_distance_{POSES[perturbed]}_{name}"]
        return dict(zip(self._published["fingers"], values, strict=True))

    def count(self, arm: Arm, perturbed: bool, thing: Thing | None = None) -> Count:
        """Return successes and trials of an arm in a pose, of one thing or of all."""
        rows = self.rows(arm, perturbed, tuple(SOLIDS) if thing is None else (thing,))
        return sum(bool(row["success"]) for row in rows), len(rows)

    def pairs(self, first: tuple[Arm, bool], second: tuple[Arm, bool]) -> tuple[list[bool], list[bool]]:
        """Return successes of two arms, each in a pose, in the same scenes and the same order."""
        a, b = (
            {(row["thing"], row["seed"]): bool(row["success"]) for row in self.rows(*way)} for way in (first, second)
        )
        scenes = sorted(a.keys() & b.keys())
        return [a[scene] for scene in scenes], [b[scene] for scene in scenes]

    def metric(
        self, name: str, arm: Arm, perturbed: bool, things: Sequence[Thing] = tuple(SOLIDS)
    ) -> NDArray[np.float64]:
        """Return a metric of an arm's runs in a pose, without those that have none."""
        values = [row.get(name) for row in self.rows(arm, perturbed, things)]
        return np.array([v for v in values if v is not None and not math.isnan(v)], dtype=np.float64)

    def together(self, names: Sequence[str], arm: Arm, perturbed: bool) -> NDArray[np.float64]:
        """Return metrics of the same runs, shape (metrics, runs), NaN where a run has none."""
        rows = self.rows(arm, perturbed)
        return np.array([[math.nan if row[n] is None else row[n] for row in rows] for n in names], dtype=np.float64)

    def rows(self, arm: Arm, perturbed: bool, things: Sequence[Thing] = tuple(SOLIDS)) -> list[dict[str, Any]]:
        """Return the rows of runs of an arm in a pose that came to their end."""
        names = [thing.name.lower() for thing in things]
        return [
            row
            for row in self._rows
            if row["status"] == "done"
            and row["strategy"] == arm.strategy.name.lower()
            and (arm.forward is None or row["forward"] == arm.forward)
            and row["perturbed"] is perturbed
            and row["thing"] in names
        ]
