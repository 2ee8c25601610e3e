"""The runs of the experiment `ir-sensor`, by which sensor comes to what, and how far sensors are off their curve."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.ir_grasp.ir_sensor import Finger
from handover.scenarios.ir_grasp.sensor_curve import Fit, readings_of

REFLECTIVITIES = (0.2, 0.5, 0.8, 1.0, 1.5, 2.0)
"""Of faces, over that of the surface which the curve is of: 0.8 is the cup of the grasps, 1 the paper box."""

INCIDENCES = (-0.4, 0.4)
"""Angles of oblique faces, rad."""

TOLERANCES = (0.02, 0.05, 0.10)
"""Parts by which each constant of a sensor is off at most."""

CONSTANTS = ("a", "b", "c", "d")


@dataclass(frozen=True)
class Case:
    """Which finger's sensor comes to what.

    Attributes:
        finger: None for all.
        reflectivity: of the face.
        incidence: angle of the face, rad.
        tolerance: how far the sensor's constants are off at most.
    """

    finger: Finger | None = None
    reflectivity: float = 1.0
    incidence: float = 0.0
    tolerance: float = 0.0

    @property
    def values(self) -> dict[str, Any]:
        """The columns of its runs."""
        who = {} if self.finger is None else {"finger": self.finger.name.lower()}
        face = {"reflectivity": self.reflectivity, "incidence": self.incidence}
        return {**who, **face, "scene.sensor_tolerance": self.tolerance}

    @property
    def parameters(self) -> dict[str, str]:
        """The parameters that make it, as texts."""
        return {name: value if isinstance(value, str) else f"{value:g}" for name, value in self.values.items()}


class SensorRuns:
    """Rows of a campaign's table; only those of runs that succeeded, as a touched box may have moved."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows = [row for row in table.rows if row["status"] == "done" and row["success"]]
        self.unusable = len(table.rows) - len(self._rows)

    def rows(self, case: Case) -> list[dict[str, Any]]:
        """Return the rows of a case."""
        return [row for row in self._rows if all(row[name] == value for name, value in case.values.items())]

    def values(self, case: Case, metric: str) -> Floats:
        """Return a metric of a case's runs, without those that have none."""
        found = [row[metric] for row in self.rows(case)]
        return np.array([v for v in found if v is not None and v == v], dtype=np.float64)

    def fits(self, case: Case) -> list[Fit]:
        """Return the fits of a case's runs."""
        rows = [row for row in self.rows(case) if row["fit_a"] is not None and row["fit_a"] == row["fit_a"]]
        return [Fit(*(row[f"fit_{name}"] for name in CONSTANTS), residual=row["fit_residual"]) for row in rows]


def readings_of_rows(rows: Sequence[dict[str, Any]], runs: Path) -> tuple[Floats, Floats]:
    """Return distances, m, and readings, ticks, of rows' runs, whose folders are in `runs`, one after the other."""
    found = [readings_of(Record(runs / row["run"] / "signals.parquet"), Finger[row["finger"].upper()]) for row in rows]
    if not found:
        return np.zeros(0), np.zeros(0)
    distances, ticks = zip(*found, strict=True)
    return np.concatenate(distances), np.concatenate(ticks)
