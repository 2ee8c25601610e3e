"""A system from a file, or wired in Python, as an experiment: it runs until its stop time, and its outputs are shown.

The metrics of such a run are the last value of each of its outputs in the record, and the smallest and the largest.
"""

import abc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from handover.cosim.blocks.variable import Kind, element_names
from handover.cosim.fmu.file.description import FmuPort
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.scenarios.experiment.experiment import Evaluator, Experiment, FmuOf, Metric, Outcome
from handover.scenarios.experiment.time_plot import TimeFigure

MAX_ENTRIES = 9
"""Entries of an array up to which each of them has metrics."""

_MAX_HEADLINE = 12
"""Metrics that the summary of a run shows."""


class UntilStop(Evaluator):
    """Lets a run continue to its stop time; it succeeds if it reaches that, or a unit ends the simulation before."""

    def __init__(self, stop: Fraction) -> None:
        self._stop, self._t, self._ended = float(stop), 0.0, False

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
            reason=f"ran to {self._t:g} s" + ("" if reached else f" of {self._stop:g} s"),
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


@dataclass(frozen=True)
class _ShownOutput:
    """A number that is recorded: its column, its name in metrics, and whether its range is one of them."""

    column: str
    name: str
    ranged: bool


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
        alone: whether it is one unit, whose outputs are named without it.
    """
    begin, outputs = system.start, _shown_outputs(system, alone=alone)
    file_settable, shown_first = settable, _headline(outputs)

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
            return UntilStop(stop)

        def recorded_metrics(self, signals: Path) -> Mapping[str, Metric]:
            return _metrics(signals, outputs)

        def time_figures(self, parameters: Any, record: Record) -> list[TimeFigure]:  # noqa: ARG002
            from handover.scenarios.reporting.run_figures import figures_of_outputs  # what draws takes long to load

            return figures_of_outputs(system.units, record)

    return SystemExperiment()


def _shown_outputs(system: System, *, alone: bool) -> list[_ShownOutput]:
    found: list[_ShownOutput] = []
    for unit, placed in system.units.items():
        for port in placed.description.outputs.values():
            if port.kind in (Kind.STRING, Kind.BINARY) or port.size > MAX_ENTRIES:
                continue
            ranged = port.kind in (Kind.REAL, Kind.INTEGER)
            for name in element_names(port):
                column = f"{unit}.{name}"
                found.append(_ShownOutput(column, name if alone else column, ranged))
    return found


def _headline(outputs: Sequence[_ShownOutput]) -> tuple[str, ...]:
    """Return the names of metrics that summaries show: all of them where they are few, else the first last values."""
    names = _metric_names(outputs)
    return tuple(names if len(names) <= _MAX_HEADLINE else names[: min(len(outputs), _MAX_HEADLINE)])


def _metric_names(outputs: Sequence[_ShownOutput]) -> list[str]:
    ranges = [f"{end}_{o.name}" for o in outputs if o.ranged for end in ("min", "max")]
    return [*(f"last_{o.name}" for o in outputs), *ranges]


def _metrics(signals: Path, outputs: Sequence[_ShownOutput]) -> dict[str, Metric]:
    """Return the metrics of a record; values that are not finite have no part in the smallest and the largest.

    The record is read a part at a time. A run that recorded nothing has none.
    """
    import pyarrow.parquet as pq  # slow to import

    if not signals.exists():
        return {}
    file = pq.ParquetFile(signals)
    schema = file.schema_arrow
    recorded = [o for o in outputs if o.column in schema.names]
    last: dict[str, float] = {}
    low = {o.column: np.nan for o in recorded}
    high = dict(low)
    for batch in file.iter_batches(columns=[o.column for o in recorded], use_threads=False):
        for o in recorded if batch.num_rows else ():
            values = np.asarray(batch.column(o.column).to_numpy(zero_copy_only=False), dtype=np.float64)
            finite = values[np.isfinite(values)]
            last[o.column] = float(values[-1])
            if o.ranged and len(finite):
                low[o.column] = float(np.fmin(low[o.column], finite.min()))
                high[o.column] = float(np.fmax(high[o.column], finite.max()))
    found: dict[str, Metric] = {}
    for o in recorded if last else ():
        metadata: Mapping[bytes, bytes] = schema.field(o.column).metadata or {}
        unit = metadata.get(b"unit", b"1").decode() if o.ranged else "1"
        found[f"last_{o.name}"] = Metric(last[o.column], unit, f"last value of {o.name}")
        if o.ranged:
            found[f"min_{o.name}"] = Metric(low[o.column], unit, f"smallest value of {o.name}")
            found[f"max_{o.name}"] = Metric(high[o.column], unit, f"largest value of {o.name}")
    return {name: found[name] for name in _metric_names(outputs) if name in found}
