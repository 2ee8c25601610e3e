"""The runs of the experiment `vsl-1`, by path, load and links."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.vsl.paths import Path as TipPath
from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.parameters import Link
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.experiment.paper import paper_values
from handover.scenarios.vsl.parameters import BAR

_PUBLISHED = paper_values("vsl", "published")

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
        return "rigid" if self.pressure is None else f"{self.pressure / BAR:g} bar"

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


def has_completed_path(row: Mapping[str, Any]) -> bool:
    """Return whether a run came to the end of its path, however far off it was."""
    return row["status"] == "done" and row.get("path_time") is not None


class Vsl1Runs:
    """Our results cell by cell. Runs that did not complete the path do not count.

    Attributes:
        done, not_done: how many runs count, and how many do not: a unit failed, a worker was lost, or the path was not
            completed.
    """

    def __init__(self, table: CampaignTable) -> None:
        rows = table.rows
        self._done: dict[Cell, list[dict[str, Any]]] = {}
        for row in rows:
            if has_completed_path(row):
                self._done.setdefault(_cell_of(row), []).append(row)
        self._cells = {_cell_of(row) for row in rows}
        self.done = sum(map(len, self._done.values()))
        self.not_done = len(rows) - self.done

    @property
    def loads(self) -> tuple[float, ...]:
        """Loads that the campaign tries, kg: a quick one leaves some out."""
        return tuple(load for load in LOADS if any(cell.load == load for cell in self._cells))

    @property
    def soft(self) -> tuple[Links, ...]:
        """Links of variable stiffness that the campaign tries, the softest first."""
        return tuple(links for links in SOFT if any(cell.links == links for cell in self._cells))

    @property
    def links(self) -> tuple[Links, ...]:
        """Rigid links, and those of variable stiffness that the campaign tries."""
        return (RIGID, *self.soft)

    def names(self, cell: Cell) -> list[str]:
        """Return the folders' names of a cell's runs."""
        return [row["run"] for row in self._done.get(cell, [])]

    def metric(self, name: str, cell: Cell) -> Floats:
        """Return a metric of a cell's runs, shape (runs,)."""
        return np.array([row[name] for row in self._done.get(cell, [])], dtype=np.float64)


def _cell_of(row: Mapping[str, Any]) -> Cell:
    rigid = row["links"] == Link.RIGID.name.lower()
    return Cell(TipPath[row["path"].upper()], row["load"], RIGID if rigid else Links(row["pressure"]))
