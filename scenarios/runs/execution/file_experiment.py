"""A system from a file, or wired in Python, as an experiment: it runs until its stop time, and its outputs are shown.

The metrics of such a run are the last value of each signal in its record, of numbers the smallest and the largest, too.
"""

import abc
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.variable import SUBSCRIPT, Kind, element_names
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Evaluator, Experiment, FmuOf, Metric, Outcome
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.runs.results.tables import LAST

ENDLESS = Fraction(10**6)
"""The duration of what a program steps as far as it likes, s: its end is never reached."""

MAX_ENTRIES = 9
"""Entries of an array up to which each of them has metrics."""

_MAX_HEADLINE = 12
"""Metrics that the summary of a run shows."""


class UntilStop(Evaluator):
    """Lets a run continue to its stop time; it succeeds if it reaches that, or a unit ends the simulation before."""

    def __init__(self, start: Fraction, stop: Fraction) -> None:
        self._stop, self._is_bounded = float(stop), stop - start < ENDLESS
        self._t, self._ended = 0.0, False

    def __call__(self, t: float, signals: Signals) -> None:  # noqa: ARG002
        """Note the time."""
        self._t = t

    @property
    def over(self) -> bool:
        """False: a run does not end before its stop time."""
        return False

    def note_end(self, unit: str, t: float) -> None:  # noqa: ARG002
        """Note that the run has ended as it should."""
        self._ended = True

    def outcome(self) -> Outcome:
        """Return whether the stop time was reached or a unit ended the simulation."""
        reached = self._t >= self._stop
        return Outcome(
            success=reached or self._ended,
            reason=f"ran to {self._t:g} s" + (f" of {self._stop:g} s" if not reached and self._is_bounded else ""),
        )


class SettableParameters(abc.ABC):
    """The parameters of a file by the names by which a call gives them, as `handover run -p NAME=VALUE` takes them."""

    @property
    @abc.abstractmethod
    def ports(self) -> Mapping[str, FmuPort]:
        """Their declarations."""

    @abc.abstractmethod
    def port(self, name: str) -> FmuPort | None:
        """Return the declaration of a name, which may also be that of an entry of an array; None if there is none."""

    @abc.abstractmethod
    def faults(self, texts: Sequence[str]) -> Sequence[str]:
        """Return what is wrong with texts `NAME=VALUE`."""


class FileExperiment(Experiment[UntilStop]):
    """Runs a system as it is. Its parameters are values inside: they are set when the file is opened."""

    units: ClassVar[Mapping[str, str]] = {}
    is_seeded: ClassVar[bool] = False
    settable: ClassVar[SettableParameters | None] = None
    """What can be given when the file is opened; None of a system that was wired in Python."""


def settable_of(experiment: type[Experiment[Any]]) -> SettableParameters | None:
    """Return what can be given of a file; None of a scenario, which declares its parameters."""
    return experiment.settable if issubclass(experiment, FileExperiment) else None


def system_experiment(
    file_name: str,
    heading: str,
    system: System,
    stop: Fraction,
    step: Fraction | None = None,
    settable: SettableParameters | None = None,
    *,
    alone: bool = False,
) -> FileExperiment:
    """Return a system as an experiment that ends at a time.

    Args:
        file_name: the experiment's name.
        heading: its title.
        system: the system.
        stop: when it ends, s.
        step: its `parallel_step`, s.
        settable: its parameters.
        alone: whether it is one unit, whose outputs have its name in no metric.
    """
    prefix, shown_first = f"{next(iter(system.units))}." if alone else "", _headline(system, alone=alone)
    begin, file_settable = system.start, settable

    class SystemExperiment(FileExperiment):
        """Runs the system as it is."""

        name: ClassVar[str] = file_name
        title: ClassVar[str] = heading
        headline: ClassVar[tuple[str, ...]] = shown_first
        start: ClassVar[Fraction] = begin
        parallel_step: ClassVar[Fraction | None] = step
        settable: ClassVar[SettableParameters | None] = file_settable

        def build(self, parameters: Any, seed: int, fmu: FmuOf) -> System:  # noqa: ARG002
            return system

        def stop_time(self, parameters: Any) -> Fraction:  # noqa: ARG002
            return stop

        def evaluator(self, parameters: Any) -> UntilStop:  # noqa: ARG002
            return UntilStop(begin, stop)

        def recorded_metrics(self, signals: Path) -> Mapping[str, Metric]:
            return _metrics(signals, prefix)

        def time_figures(self, parameters: Any, record: Record) -> list[TimeFigure]:  # noqa: ARG002
            # What draws takes long to load.
            from handover.scenarios.runs.reporting.run_figures import figures_of_outputs

            return figures_of_outputs(system.units, record)

    return SystemExperiment()


def _headline(system: System, *, alone: bool) -> tuple[str, ...]:
    """Return the names of metrics that summaries show: all of the outputs' where they are few, else last values."""
    last: list[str] = []
    ranges: list[str] = []
    for unit, placed in system.units.items():
        for port in placed.description.outputs.values():
            if port.kind in (Kind.STRING, Kind.BINARY) or port.size > MAX_ENTRIES:
                continue
            names = [name if alone else f"{unit}.{name}" for name in element_names(port)]
            last += [f"{LAST}{name}" for name in names]
            if port.kind in (Kind.REAL, Kind.INTEGER):
                ranges += [f"{end}_{name}" for name in names for end in ("min", "max")]
    few = len(last) + len(ranges) <= _MAX_HEADLINE
    return tuple([*last, *ranges] if few else last[:_MAX_HEADLINE])


def _metrics(signals: Path, prefix: str) -> dict[str, Metric]:
    """Return the metrics of a record; values that are not finite have no part in the smallest and the largest.

    The record is read a part at a time. A run that recorded nothing has none.

    Args:
        signals: the record.
        prefix: what is left out of the names of signals.
    """
    import pyarrow as pa  # slow to import, as what imports it
    import pyarrow.parquet as pq

    from handover.cosim.record.columns import column_metadata, column_values

    if not signals.exists():
        return {}
    file = pq.ParquetFile(signals)
    schema: Any = file.schema_arrow
    about = dict(column_metadata(schema))
    entries = Counter(SUBSCRIPT.sub("", column) for column in about)
    columns = [c for c in about if c != "time" and entries[SUBSCRIPT.sub("", c)] <= MAX_ENTRIES]
    last = dict.fromkeys(columns, np.nan)
    low, high = dict(last), dict(last)
    rows = 0
    for batch in file.iter_batches(columns=columns, use_threads=False):
        rows += batch.num_rows
        for column in columns if batch.num_rows else ():
            values = np.asarray(column_values(batch.column(column)), dtype=np.float64)
            finite = values[np.isfinite(values)]
            last[column] = float(values[-1])
            if len(finite):
                low[column] = float(np.fmin(low[column], finite.min()))
                high[column] = float(np.fmax(high[column], finite.max()))
    found: dict[str, Metric] = {}
    ranges: dict[str, Metric] = {}
    for column in columns if rows else ():
        name, unit = column.removeprefix(prefix), about[column]["unit"]
        found[f"{LAST}{name}"] = Metric(last[column], unit, f"last value of {name}{_not_finite(last[column])}")
        if not about[column]["items"] and not pa.types.is_boolean(schema.field(column).type):
            none = "" if np.isfinite(low[column]) else ", none of which is finite"
            ranges[f"min_{name}"] = Metric(low[column], unit, f"smallest value of {name}{none}")
            ranges[f"max_{name}"] = Metric(high[column], unit, f"largest value of {name}{none}")
    return {**found, **ranges}


def _not_finite(value: float) -> str:
    """Return that a value, for which a summary has a dash, is not a number."""
    return "" if math.isfinite(value) else ", which is not a number" if math.isnan(value) else ", which is infinite"
