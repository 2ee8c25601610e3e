"""Distances of the fingers by Gauss-Newton steps, from the records of IR-guided grasps. [Luberto] figs. 12 and 13."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handover.controllers.ir_grasp.ir_reflex import Phase
from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.ir_grasp.evaluation import IN_COST


@dataclass(frozen=True, eq=False)
class Descent:
    """One run's distances at the beginning of its first step, and after each step.

    Attributes:
        distance: by the controller's curve, of thumb, index and ring, shape (steps + 1, 3), m; NaN where a finger sees
            nothing.
    """

    distance: Floats

    @property
    def norm(self) -> Floats:
        """The residual's Euclidean norm, sqrt(d_thumb^2 + d_ring^2), m: the paper's residual is the distance itself."""
        return np.sqrt(np.sum(self.distance[:, IN_COST] ** 2, axis=1))

    @property
    def ends(self) -> tuple[float, float] | None:
        """The norm before the first step and after the last one; None without steps, or where a finger loses sight."""
        first, last = float(self.norm[0]), float(self.norm[-1])
        return (first, last) if len(self.norm) > 1 and np.isfinite([first, last]).all() else None

    @classmethod
    def of(cls, record: Record) -> "Descent | None":
        """Read a run; None if it made no step.

        A step is over at the control period in which it is counted: the hand then stands where it led.
        """
        steps, phase = record["reflex.steps"].astype(int), record["reflex.phase"]
        if not steps.max():
            return None
        first = int(np.argmax(phase == Phase.STEP))
        index = [first, *(int(np.argmax(steps == n)) for n in range(1, int(steps.max()) + 1))]
        seen = record["reflex.distance"][index]
        return cls(np.where(seen < ReflexParams().distance_max, seen, np.nan))


def descents_of(rows: Sequence[dict[str, Any]], runs: Path) -> list[Descent]:
    """Return the descents of rows' runs, whose folders are in `runs`; of those that made a step."""
    found = [Descent.of(Record(runs / row["run"] / "signals.parquet")) for row in rows]
    return [descent for descent in found if descent is not None]


def median_of(curves: Sequence[Floats]) -> Floats:
    """Return the median by step, over the curves that go as far and have a value there.

    It ends where fewer than half of the curves go on, and is NaN where fewer than half of those have a value: a few
    would stand for all.
    """
    length = max((len(c) for c in curves), default=0)
    columns = [np.array([c[k] for c in curves if len(c) > k]) for k in range(length)]
    kept = [column for column in columns if 2 * len(column) >= len(curves)]
    return np.array([np.median(c[np.isfinite(c)]) if 2 * np.isfinite(c).sum() >= len(c) else np.nan for c in kept])
