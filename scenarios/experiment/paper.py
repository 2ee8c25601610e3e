"""Values of a paper, read from a scenario's `paper.toml`: each with its unit, its place in the paper, and its status.

`paper_values` gives the constants that a scenario is built with; a `PublishedValue` stands beside what a run measured.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
import tomli

from handover.scenarios.experiment.returned_types import Checked


def paper_values(scenario: str, group: str) -> dict[str, Any]:
    """Return the values of one group of a scenario's `paper.toml` by name."""
    return {name: entry["value"] for name, entry in _read(scenario)[group].items()}


def paper_entry(scenario: str, group: str, name: str) -> dict[str, Any]:
    """Return a value of a scenario's `paper.toml` with its unit, its place in the paper (`where`) and its status.

    Raises:
        KeyError: there is no value of that name.
    """
    return dict(_read(scenario)[group][name])


@functools.lru_cache
def _read(scenario: str) -> dict[str, Any]:
    return tomli.loads(
        resources.files(f"handover.scenarios.robots.{scenario}").joinpath("paper.toml").read_text(encoding="utf-8")
    )


@dataclass(frozen=True, kw_only=True)
class PublishedValue(Checked):
    """A published value beside a metric, both in the metric's unit.

    Attributes:
        metric: name of the run's metric.
        paper: the package of `scenarios.robots` whose `paper.toml` has the value.
        name: of the value in that file's group `published`.
        index: of the element that belongs to the run, where the value is an array.
        span: names of the published minimum and maximum, indexed alike; empty if one value was published.
        relation: how the run's value relates to the published one, such as "at most"; "" if both measure the same.
        note: what else has to be known to compare them, in a sentence without its full stop.
    """

    metric: str
    paper: str
    name: str
    index: Sequence[int] = ()
    span: Sequence[str] = ()
    relation: str = ""
    note: str = ""

    @property
    def value(self) -> float:
        """The published value."""
        return self._value_of(self.name)

    @property
    def limits(self) -> tuple[float, float] | None:
        """Minimum and maximum, where they were published."""
        return (self._value_of(self.span[0]), self._value_of(self.span[1])) if self.span else None

    @property
    def where(self) -> str:
        """Its place in the paper."""
        return self._entry(self.name)["where"]

    @property
    def status(self) -> str:
        """Whether it was stated, derived, assumed or read off a figure."""
        return self._entry(self.name)["status"]

    def _value_of(self, name: str) -> float:
        return float(np.asarray(self._entry(name)["value"], dtype=np.float64)[tuple(self.index)])

    def _entry(self, name: str) -> dict[str, Any]:
        return paper_entry(self.paper, "published", name)
