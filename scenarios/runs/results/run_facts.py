"""Reads a run back from its folder, for pages, figures and tables: `run.json`, `summary.json` and the record.

All is checked as it is read, since folders come from other versions, and from broken disks.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from handover.cosim.blocks.variable import indices_of, subscript
from handover.cosim.exceptions import one_line
from handover.cosim.record.reader import InvalidRecord, Record
from handover.scenarios.catalog import scenario_of, untrusted_code
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.summary import unwritten_summary
from handover.scenarios.runs.results.tables import format_value


@dataclass(frozen=True, kw_only=True)
class RunFacts:
    """A run, as its folder describes it.

    Attributes:
        folder: the run's.
        run, summary: contents of `run.json` and `summary.json`; for a run that was killed, a summary that says so.
        experiment: the scenario, if it is to be had here without running code that the folder names; None for an SSP.
        ended: whether the run wrote its summary.
    """

    folder: RunFolder
    run: Mapping[str, Any]
    summary: Mapping[str, Any]
    experiment: Experiment[Any] | None
    ended: bool

    @classmethod
    def read(cls, folder: RunFolder, experiment: Experiment[Any] | None = None) -> "RunFacts":
        """Read and check both files.

        Args:
            folder: the run's.
            experiment: its scenario, where that has no name by which it is found.

        Raises:
            InvalidRunFolder: it is not the folder of a run, or not of one of the scenario, or a file is damaged.
        """
        run, summary = folder.read_run(), folder.read_summary()
        ended = bool(summary)
        if not ended:
            summary = unwritten_summary(run)
        if experiment is None:
            scenario = scenario_of(run["scenario"], run.get("source", {}))
            experiment = None if scenario is None else scenario()
        elif experiment.name != run["scenario"]:
            raise InvalidRunFolder(folder.path, f"it is a run of {run['scenario']}, not of {experiment.name}")
        return cls(folder=folder, run=run, summary=summary, experiment=experiment, ended=ended)

    @property
    def not_drawn(self) -> list[str]:
        """That plots and replay are left out since they need code that is not trusted: a line, or none."""
        code = untrusted_code(self.run.get("source", {})) if self.experiment is None else ""
        return [f"plots over time and replay: {code}"] if code else []

    @property
    def missing_record(self) -> str:
        """That the record is not there though the run had one, else ""."""
        simulated, file = self.summary.get("simulated_seconds", 0.0), self.folder.signals
        return "" if file.exists() or not simulated else f"its {file.name} is missing, the record of {simulated:g} s"

    @property
    def scenario(self) -> str:
        """The scenario's name."""
        return self.run["scenario"]

    @property
    def title(self) -> str:
        """What the scenario does, in a line; "" if unknown."""
        return self.run.get("title", "" if self.experiment is None else self.experiment.title)

    @property
    def headline(self) -> Sequence[str]:
        """Names of the metrics that summaries list first."""
        return self.run.get("headline", () if self.experiment is None else self.experiment.headline)

    @property
    def parameters(self) -> Sequence[tuple[str, str, str]]:
        """Name, value with unit, and description of each parameter."""
        if "told_parameters" in self.run:
            return [(name, value, description) for name, value, description in self.run["told_parameters"]]
        return [(name, format_value(value), "") for name, value in self.run["parameters"].items()]


def whole_record_of(folder: RunFolder) -> Record | None:
    """Return a run's record; None where there is none.

    Raises:
        InvalidRunFolder: the record is damaged.
    """
    if not folder.signals.exists():
        return None
    try:
        return Record(folder.signals)
    except (OSError, InvalidRecord) as e:
        fault = e.fault if isinstance(e, InvalidRecord) else one_line(e)
        raise InvalidRunFolder(folder.path, f"its {folder.signals.name} is damaged: {fault}") from e


def record_of(folder: RunFolder) -> Record | None:
    """Return a run's record, likewise; None also where it has only one row, which shows nothing over time."""
    record = whole_record_of(folder)
    return None if record is None or len(record.time) < 2 else record


def elements_of(signal: str, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return a signal's elements over time by the names of their columns in the record: `p`, or `p[1]`, `p[2]`, ..."""
    columns = values.reshape(len(values), -1)
    return {signal + subscript(index): columns[:, k] for k, index in enumerate(indices_of(values.shape[1:]))}
