"""Runs of a published experiment, found in its campaign's table by a point of its plan."""

import enum
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, lru_cache
from typing import Any, cast

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.runs.campaign.plan import CampaignPlan, is_number
from handover.scenarios.runs.campaign.table import CampaignTable

Row = Mapping[str, Any]
"""A run in a campaign's table: columns and values, of which None is null."""

Point = Mapping[str, str]
"""Parameters and their values, as texts."""

Count = tuple[int, int]
"""Successes and trials."""


def is_done(row: Row) -> bool:
    """Return whether a run came to its end."""
    return row["status"] == "done"


def is_known(row: Row) -> bool:
    """Return whether something is known of a run: one that was lost says nothing, and the same call tries it again."""
    return row["status"] != "lost"


class Runs:
    """Rows of a campaign's table.

    Args:
        rows: the rows.
        defaults: names of the parameters that tell points apart, and their values where a point does not set them.
    """

    def __init__(self, rows: Iterable[Row], defaults: Mapping[str, object]) -> None:
        self.rows: Sequence[Row] = list(rows)
        self._defaults = defaults

    @classmethod
    def of_plan(
        cls, table: CampaignTable, plan: CampaignPlan, keep: Callable[[Row], bool], free: Sequence[str] = ()
    ) -> "Runs":
        """Return the runs to keep; points differ by all parameters that the plan varies but the free ones.

        Raises:
            KeyError: the table has no column of a parameter that each point of the plan sets.
        """
        for name in plan.points[0]:
            if name not in (*table.table.column_names, *free) and all(name in point for point in plan.points):
                raise KeyError(name)
        starts = {v.name: plain(v.start) for v in plan.kind.parameters()}
        names = dict.fromkeys(name for point in plan.points for name in point if name not in free)
        return cls(filter(keep, table.rows), {name: starts.get(name) for name in names})

    def __len__(self) -> int:
        """Return how many they are."""
        return len(self.rows)

    def __iter__(self) -> Iterator[Row]:
        """Return the rows."""
        return iter(self.rows)

    @cached_property
    def _by_point(self) -> Mapping[tuple[object, ...], Sequence[Row]]:
        found: dict[tuple[object, ...], list[Row]] = {}
        for row in self.rows:
            found.setdefault(self._key(row), []).append(row)
        return found

    def _key(self, given: Row) -> tuple[object, ...]:
        values = ((plain(given.get(name)), default) for name, default in self._defaults.items())
        return tuple(default if value is None else value for value, default in values)

    def of(self, *points: Point) -> "Runs":
        """Return the runs of some points, in which all parameters that these do not set have their defaults."""
        found = (row for key in map(self._key, points) for row in self._by_point.get(key, ()))
        return Runs({id(row): row for row in found}.values(), self._defaults)

    def matching(self, wanted: Point) -> "Runs":
        """Return the runs that have the given values, whatever their other parameters are."""
        values = {name: plain(text) for name, text in wanted.items()}
        own = self._defaults
        return self.where(lambda row: all(_or(plain(row.get(n)), own.get(n)) == x for n, x in values.items()))

    def where(self, keep: Callable[[Row], bool]) -> "Runs":
        """Return the runs to keep."""
        return Runs(filter(keep, self.rows), self._defaults)

    @property
    def successful(self) -> "Runs":
        """Those that came to their end and succeeded."""
        return self.where(lambda row: is_done(row) and bool(row["success"]))

    @property
    def failed(self) -> "Runs":
        """Those that came to their end and did not succeed."""
        return self.where(lambda row: is_done(row) and not row["success"])

    def together_with(self, *others: "Runs") -> "Runs":
        """Return these runs and then others."""
        return Runs([row for runs in (self, *others) for row in runs], self._defaults)

    def metric(self, name: str) -> Floats:
        """Return a metric of the runs that have it."""
        return values_of(self.rows, name)

    @property
    def succeeded(self) -> list[bool]:
        """Whether each came to its end and succeeded."""
        return [is_done(row) and bool(row["success"]) for row in self.rows]

    @property
    def count(self) -> Count:
        """How many succeeded, of how many."""
        return sum(self.succeeded), len(self)

    @property
    def names(self) -> list[str]:
        """The names of their folders."""
        return [row["run"] for row in self.rows]


def values_of(rows: Iterable[Row], name: str) -> Floats:
    """Return a column's values in those rows that have it, in their order."""
    found = (row.get(name) for row in rows)
    return np.array([float(x) for x in found if x is not None and x == x], dtype=np.float64)


def _or(value: object, default: object) -> object:
    return default if value is None else value


def plain(value: Any) -> object:
    """Return a parameter's value, of a table, a text or a default, in one form; None if it is not set."""
    if value is None or (isinstance(value, (str, float)) and (value == "" or value != value)):
        return None
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if isinstance(value, str):
        return _of_text(value)
    numbers: list[float] = np.atleast_1d(np.asarray(value, dtype=np.float64)).tolist()
    return cast(object, tuple(numbers))


@lru_cache(maxsize=4096)
def _of_text(text: str) -> object:
    if text in ("true", "false"):
        return (float(text == "true"),)
    parts = text.split(",")
    return tuple(map(float, parts)) if all(map(is_number, parts)) else text
