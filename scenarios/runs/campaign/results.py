"""Results of a campaign by point: successes, medians of metrics, their intervals, and labels."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.blocks.ports import Floats
from handover.cosim.blocks.variable import Kind, Variable
from handover.scenarios.catalog import scenario_of
from handover.scenarios.experiment.display_unit import display_unit, unit_symbol
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.runs.campaign.folder import PARAMETER_UNITS, CampaignFolder
from handover.scenarios.runs.campaign.plan import is_number
from handover.scenarios.runs.campaign.statistics import Interval, success_interval, time_interval
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.results.run_folder import InvalidRunFolder

_MAX_METRICS = 4
_MAX_INTERVALS = 150
"""Medians of a campaign above which they have no intervals: a bootstrap takes some 20 ms."""


@dataclass(frozen=True, kw_only=True)
class PointResults:
    """The runs of a point.

    Attributes:
        number: the point's, from 0.
        values: of the parameters that are varied, as texts.
        rows: of its runs in the campaign's table.
        done: of `rows`, those of runs that came to their end.
        successes: how many of these succeeded.
    """

    number: int
    values: Mapping[str, str]
    rows: NDArray[np.int64]
    done: NDArray[np.int64]
    successes: int

    @property
    def rate(self) -> float:
        """Share of the runs done that succeeded; NaN if none is done."""
        return self.successes / len(self.done) if len(self.done) else np.nan

    @cached_property
    def interval(self) -> Interval | None:
        """Interval of the rate; None if no run is done."""
        return success_interval(self.successes, len(self.done)) if len(self.done) else None


class CampaignResults:
    """A campaign's table, point by point.

    Args:
        metadata: what is in `campaign.json`.
        table: the runs that have ended.
    """

    def __init__(self, metadata: Mapping[str, Any], table: CampaignTable) -> None:
        self.metadata, self.table = metadata, table
        self._values: list[Mapping[str, str]] = list(metadata["points"])
        self._intervals: dict[tuple[int, str], Interval | None] = {}

    @property
    def scenario(self) -> str:
        """Name of the scenario."""
        return str(self.metadata["scenario"])

    @cached_property
    def experiment(self) -> type[Experiment[Any]] | None:
        """The scenario; None if it is not to be had here without running code that the folder names."""
        return scenario_of(self.scenario, self.metadata.get("source", {}))

    @property
    def planned(self) -> int:
        """Runs that the campaign is to have."""
        return len(self._values) * int(self.metadata["repetitions"])

    @cached_property
    def varied(self) -> tuple[str, ...]:
        """Parameters that differ between points, in the order of the plan."""
        names = dict.fromkeys(name for values in self._values for name in values)
        return tuple(n for n in names if len({values.get(n) for values in self._values}) > 1)

    @cached_property
    def independent(self) -> tuple[str, ...]:
        """Those of `varied` that do not follow from one before them, as a period that goes with a step size."""
        kept: list[str] = []
        for name in self.varied:
            if not any(self._follows(name, other) for other in kept):
                kept.append(name)
        return tuple(kept)

    def _follows(self, name: str, other: str) -> bool:
        pairs = {(values.get(other), values.get(name)) for values in self._values}
        return len(pairs) == len({first for first, _ in pairs})

    @cached_property
    def declared(self) -> Mapping[str, Variable]:
        """The scenario's parameters by name; none if this version does not know the scenario."""
        experiment = self.experiment
        return {} if experiment is None else {v.name: v for v in experiment.parameters()}

    def is_number(self, parameter: str) -> bool:
        """Whether a parameter is a number, neither an array nor a name."""
        variable = self.declared.get(parameter)  # of a unit there is none: its values tell
        may_be = variable is None or (variable.kind in (Kind.REAL, Kind.INTEGER) and not variable.shape)
        given = (*self._values, self.metadata["fixed"])
        return may_be and all(is_number(values[parameter]) for values in given if parameter in values)

    def is_boolean(self, parameter: str) -> bool:
        """Whether a parameter is true or false; of a scenario that is not to be had here, by what its values are."""
        variable = self.declared.get(parameter)
        if self.experiment is None:
            texts = {values[parameter] for values in self._values if parameter in values}
            return bool(texts) and texts <= {"true", "false"}
        return variable is not None and variable.kind is Kind.BOOLEAN

    def unit(self, parameter: str) -> str:
        """Return a parameter's unit, "1" if it has none; of a unit's parameter as its FMU declares it."""
        variable = self.declared.get(parameter)
        if variable is None:
            return str(self.metadata.get(PARAMETER_UNITS, {}).get(parameter, "1"))
        return variable.unit.symbol

    @cached_property
    def headline(self) -> tuple[str, ...]:
        """Columns of the metrics that are shown first, in their order: those that any run has, without CPU time."""
        first = self._first_metrics or self.measured
        columns = [n if n in self.table.metrics else f"{n}_metric" for n in first]
        return tuple(n for n in columns if n in self.measured and not n.startswith(("cpu_", "pace_")))

    @property
    def _first_metrics(self) -> Sequence[str]:
        """What the scenario, or the file, names as its headline."""
        return self.metadata.get("headline", ()) if self.experiment is None else self.experiment.headline

    @property
    def shown_metrics(self) -> tuple[str, ...]:
        """Those of `headline` that tables and figures of points have room for."""
        return self.headline[:_MAX_METRICS]

    @cached_property
    def measured(self) -> tuple[str, ...]:
        """Columns of the metrics that any run has a value of, the headline's first and those of the cost last."""
        first = list(self._first_metrics)

        def place(name: str) -> tuple[int, int]:
            if name.startswith(("cpu_", "pace_", "peak_memory")):
                return 2, 0
            bare = name.removesuffix("_metric")
            return (0, first.index(bare)) if bare in first else (1, 0)

        some = [n for n in self.table.metrics if np.isfinite(self.table.column(n)).any()]
        return tuple(sorted(some, key=place))

    @cached_property
    def points(self) -> Sequence[PointResults]:
        """The points of which a run has ended."""
        number, status = self.table.column("point"), self.table.column("status")
        success = self.table.column("success")
        points: list[PointResults] = []
        for k, values in enumerate(self._values):
            rows = np.flatnonzero(number == k)
            if len(rows):
                done = rows[status[rows] == "done"]
                successes = int(np.count_nonzero(success[done] == np.True_))
                points.append(PointResults(number=k, values=values, rows=rows, done=done, successes=successes))
        return points

    @property
    def done(self) -> int:
        """How many runs came to their end."""
        return sum(len(point.done) for point in self.points)

    @property
    def successes(self) -> int:
        """How many of these succeeded."""
        return sum(point.successes for point in self.points)

    @property
    def has_intervals(self) -> bool:
        """Whether medians have intervals, which would take too long for very many points."""
        return len(self.points) * len(self.shown_metrics) <= _MAX_INTERVALS

    def median(self, point: PointResults, metric: str) -> float:
        """Return a metric's median over the runs done; NaN if none has it."""
        values = self._measured_at(point, metric)
        return float(np.median(values)) if len(values) else np.nan

    def number_measured(self, point: PointResults, metric: str) -> int:
        """Return of how many of the runs done a metric has a value; a sensor may not have seen its object."""
        return len(self._measured_at(point, metric))

    def median_interval(self, point: PointResults, metric: str) -> Interval | None:
        """Return the interval of a median by bootstrap; None where the values are fewer than three, or all the same."""
        key = (point.number, metric)
        if key not in self._intervals:
            values = self._measured_at(point, metric)
            varies = self.has_intervals and len(values) > 0 and np.ptp(values) > 0.0
            self._intervals[key] = time_interval(values) if varies else None
        return self._intervals[key]

    def _measured_at(self, point: PointResults, metric: str) -> Floats:
        values = self.table.column(metric)[point.done]
        return values[np.isfinite(values)]

    def value_text(self, parameter: str, text: str) -> str:
        """Return a parameter's value as one reads it in a label."""
        if self.is_boolean(parameter):
            return parameter.replace("_", " ") if text.lower() == "true" else f"not {parameter.replace('_', ' ')}"
        if self.is_number(parameter):
            return display_unit(self.unit(parameter), float(text)).text(float(text))
        if _is_array(text):
            return f"{text} {unit_symbol(self.unit(parameter))}".rstrip()
        return self.words(parameter, text)

    def words(self, parameter: str, text: str) -> str:
        """Return a value that is no number as one reads it; of a block its class alone, paths of files as they are."""
        module, _, name = text.rpartition(":")
        if name.isidentifier() and module.replace(".", "").isidentifier():
            namesakes = {t for p in self.points if (t := p.values.get(parameter, "")).endswith(f":{name}")}
            return text if len(namesakes) > 1 else name
        return text if any(mark in text for mark in ":/.") else text.replace("_", " ")

    def label(self, point: PointResults) -> str:
        """Return a point's label: the values in which it differs from the others, which may be none."""
        texts = [self.named_value(name, point.values[name]) for name in self.independent if name in point.values]
        return ", ".join(texts) or (DEFAULTS if self.varied else "all runs")

    def named_value(self, parameter: str, text: str) -> str:
        """Return a parameter's value as one reads it by itself: a number, or an array, with the parameter's name."""
        value = self.value_text(parameter, text)
        return f"{parameter.replace('_', ' ')} {value}" if self.is_number(parameter) or _is_array(text) else value


def _is_array(text: str) -> bool:
    """Return whether a value is several numbers."""
    return "," in text and all(map(is_number, text.split(",")))


DEFAULTS = "nothing changed"
"""Label of a point at which no varied parameter is set."""

_TEXT, _WHOLE, _NUMBER, _TRUTH = "texts", "whole numbers", "numbers", "true and false"
_COLUMNS = {
    **dict.fromkeys(("run", "status", "reason"), _TEXT),
    **dict.fromkeys(("point", "repetition", "seed"), _WHOLE),
    **dict.fromkeys(("cpu_seconds", "wall_seconds"), _NUMBER),
    "success": _TRUTH,
}
"""What the columns of all tables hold."""


def read_results(folder: CampaignFolder) -> CampaignResults:
    """Read a campaign's plan and its table, which may be another version's, or damaged: both are checked.

    Raises:
        InvalidRunFolder: it is not the folder of a campaign, or one of the files is damaged.
    """
    content = folder.read()
    table = CampaignTable.read(folder.table)
    missing = [name for name in _COLUMNS if name not in table.table.column_names]
    faults = [f"it has no column {', '.join(missing)}"] if missing else []
    wanted = {**_COLUMNS, **dict.fromkeys(table.metrics, _NUMBER)}
    wrong = [name for name, kind in wanted.items() if name not in missing and not table.holds(name, kind)]
    faults += [f"its column {name!r:.60} does not hold {wanted[name]}" for name in wrong[:_MAX_NAMED]]
    if faults:
        raise InvalidRunFolder(folder.path, f"its {folder.table.name} is damaged: {'; '.join(faults)}")
    return CampaignResults(content, table)


_MAX_NAMED = 5
"""Columns that a fault names."""
