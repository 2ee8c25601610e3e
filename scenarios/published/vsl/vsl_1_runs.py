"""The runs of the experiment `vsl-1`, by path, load and links."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.vsl.paths import Path as TipPath
from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.parameters import Link
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.paper import paper_values

_PUBLISHED = paper_values("vsl", "published")
_BAR = 1e5  # Pa

PATHS = (TipPath.LINEAR, TipPath.CURVE, TipPath.SQUARE)
"""Rows of fig. 5."""

LOADS: tuple[float, ...] = tuple(_PUBLISHED["loads"])
"""Columns of fig. 5, kg."""

REPETITIONS: int = _PUBLISHED["repetitions"]


@dataclass(frozen=True)
class Links:
    """Links of an arm: of variable stiffness with a pressure, Pa, or rigid, without one."""

    pressure: float | None

    @property
    def label(self) -> str:
        """What they are called."""
        return "rigid" if self.pressure is None else f"{self.pressure / _BAR:g} bar"

    @property
    def parameters(self) -> dict[str, str]:
        """The scenario's parameters of them, as texts."""
        if self.pressure is None:
            return {"links": Link.RIGID.name.lower()}
        return {"links": Link.VSL.name.lower(), "pressure": f"{self.pressure:g}"}


RIGID = Links(None)
SOFT = tuple(Links(p) for p in _PUBLISHED["pressures"])
ALL_LINKS = (RIGID, *SOFT)
"""The plots of fig. 5, besides that of the servos."""


@dataclass(frozen=True)
class Cell:
    """A path with a load, kg, on an arm."""

    path: TipPath
    load: float
    links: Links

    @property
    def parameters(self) -> dict[str, str]:
        """The scenario's parameters of it, as texts."""
        return {"path": self.path.name.lower(), "load": f"{self.load:g}", **self.links.parameters}

    @property
    def label(self) -> str:
        """Path, load and links in words."""
        return f"{self.path.name.lower()}, {format_load(self.load)}, {self.links.label}"


def format_load(load: float) -> str:
    """Return a load such as `25 g`."""
    return f"{1000 * load:g} g"


class Vsl1Runs:
    """Our results cell by cell. Runs that did not come to their end do not count."""

    def __init__(self, table: CampaignTable) -> None:
        self._rows = table.rows

    @property
    def not_done(self) -> int:
        """Number of runs that do not count, as a unit failed or a worker was lost."""
        return sum(row["status"] != "done" for row in self._rows)

    @property
    def done(self) -> int:
        """Number of runs that count."""
        return len(self._rows) - self.not_done

    @property
    def loads(self) -> tuple[float, ...]:
        """Loads that any run has, kg: a quick campaign leaves some out."""
        return tuple(load for load in LOADS if any(row["load"] == load for row in self._rows))

    @property
    def soft(self) -> tuple[Links, ...]:
        """Links of variable stiffness that any run has, the softest first."""
        return tuple(links for links in SOFT if any(_has_links(row, links) for row in self._rows))

    @property
    def links(self) -> tuple[Links, ...]:
        """Rigid links, and those of variable stiffness that any run has."""
        return (RIGID, *self.soft)

    def names(self, cell: Cell) -> list[str]:
        """Return the folders' names of a cell's runs."""
        return [row["run"] for row in self.rows(cell)]

    def metric(self, name: str, cell: Cell) -> Floats:
        """Return a metric of a cell's runs, shape (runs,)."""
        return np.array([row[name] for row in self.rows(cell)], dtype=np.float64)

    def rows(self, cell: Cell) -> list[dict[str, Any]]:
        """Return the rows of a cell's runs that came to their end."""
        path = cell.path.name.lower()
        return [
            row
            for row in self._rows
            if row["status"] == "done"
            and row["path"] == path
            and row["load"] == cell.load
            and _has_links(row, cell.links)
        ]


def _has_links(row: dict[str, Any], links: Links) -> bool:
    if links.pressure is None:
        return row["links"] == Link.RIGID.name.lower()
    return row["links"] == Link.VSL.name.lower() and row["pressure"] == links.pressure
