"""The specification of a run: scenario, parameters, FMUs, options of the master, output folder."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.time_series import ExternalSource
from handover.scenarios.experiment.experiment import Experiment, NoParameters
from handover.scenarios.runs.results.run_folder import RunFolder


@dataclass(frozen=True)
class InputSources:
    """Who gives values to a system's inputs from outside.

    Attributes:
        sources: by `unit.input`; inputs from outside that are not among them keep what the system says of them.
        origin: what the run's folder is to say of that, as JSON can hold it; `from` is "run", "page" or "program".
        where: how a message names them.
        is_complete: whether all the system's inputs from outside must be among them.
    """

    sources: Mapping[str, ExternalSource]
    origin: Mapping[str, Any]
    where: str = "inputs from outside"
    is_complete: bool = False


@dataclass(frozen=True, kw_only=True)
class RunSettings:
    """How a run is made, whatever it is of.

    Attributes:
        seed: of all random numbers of a scenario.
        formats: further file formats of the record, see `RECORD_FORMATS`.
        every: simulated seconds between checkpoints; None for no checkpoints.
        options: of the master, which runs the units.
        presented: whether figures and a report are made at the end.
        sources: who gives values to inputs from outside; None: as the scenario says, by itself nobody.
        pushed: whether bodies that can be pushed may be: then forces and points are inputs from outside.
        recorded: patterns `UNIT.NAME` of local variables and parameters that are recorded, see `record_variables`.
    """

    seed: int = 0
    formats: Sequence[str] = ()
    every: Fraction | None = None
    options: MasterOptions = field(default_factory=MasterOptions)
    presented: bool = True
    sources: InputSources | None = None
    pushed: bool = False
    recorded: Sequence[str] = ()


@dataclass(frozen=True)
class OpenedSubject:
    """What is run: a scenario with its parameters, or what runs a file or a system as one.

    Attributes:
        experiment, parameters: the scenario.
        unit_values: values of units' parameters, as texts by `UNIT.NAME`.
        source: what `resume` needs to find the experiment again, if the catalog does not have it.
        stop: when the run ends, s, at the first communication point at or after it; None: as the scenario says.
    """

    experiment: Experiment[Any]
    parameters: Any = NoParameters()
    unit_values: Mapping[str, str] = field(default_factory=dict[str, str])
    source: Mapping[str, Any] = field(default_factory=dict[str, Any])
    stop: Fraction | None = None


@dataclass(frozen=True, kw_only=True)
class Task(OpenedSubject, RunSettings):
    """A run before it begins.

    Attributes:
        fmus: the FMU of each unit.
        folder: where its results are written.
    """

    parameters: Any = field()  # no default: a task that lacks it would be another run
    seed: int = field()
    fmus: Mapping[str, Path]
    folder: RunFolder

    @property
    def stop_time(self) -> Fraction:
        """When the run ends at the latest, s."""
        return self.experiment.stop_time(self.parameters) if self.stop is None else self.stop

    @property
    def is_cut_short(self) -> bool:
        """Whether it is to stop before the scenario itself would end it."""
        return self.stop is not None and self.stop < self.experiment.stop_time(self.parameters)


def task_of(settings: RunSettings, opened: OpenedSubject, fmus: Mapping[str, Path], folder: RunFolder) -> Task:
    """Return the task of what is run with its settings."""
    shared = {f.name: getattr(settings, f.name) for f in fields(RunSettings)}
    return Task(**vars(opened), **shared, fmus=fmus, folder=folder)
