"""One FMU as an experiment: it runs alone until its stop time, its inputs constant at their start or from a file."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import WiringError, first_faults
from handover.cosim.fmu.file.archive import DESCRIPTION
from handover.cosim.fmu.file.default_experiment import DefaultExperiment, exact_seconds
from handover.cosim.fmu.file.description import FmuDescription, FmuPort, describe_fmu
from handover.cosim.system.system import PortName, System
from handover.cosim.system.wiring_faults import value_faults
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.file_experiment import (
    ENDLESS,
    FileExperiment,
    SettableParameters,
    system_experiment,
)
from handover.scenarios.runs.execution.input_file import InputTable, columns_of, read_inputs
from handover.scenarios.runs.execution.ssp_run import checked_stop, naming_step
from handover.scenarios.runs.execution.unit_values import start_values
from handover.scenarios.runs.results.run_folder import sha256_of


def is_fmu(name: str) -> bool:
    """Return whether a name is an FMU's file, or the folder of an unpacked one, and not a scenario."""
    return Path(name).suffix.lower() == ".fmu" or os.path.isfile(Path(name) / DESCRIPTION)


class FmuParameters(SettableParameters):
    """The variables of an FMU that can be given start values: parameters, inputs, and others."""

    def __init__(self, description: FmuDescription, table: InputTable) -> None:
        self._description, self._table = description, table

    @property
    def ports(self) -> Mapping[str, FmuPort]:
        """Their declarations."""
        return self._description.settable

    @cached_property
    def _entries(self) -> Mapping[str, FmuPort]:
        return {name: replace(port, name=name, shape=()) for name, (port, _) in columns_of(self.ports).items()}

    def port(self, name: str) -> FmuPort | None:
        """Return the declaration of a name, which may also be that of an entry of an array; None if there is none."""
        return self.ports.get(name) or self._entries.get(name)

    def faults(self, texts: Sequence[str]) -> Sequence[str]:
        """Return what is wrong with texts `NAME=VALUE`."""
        start, faults = start_values(self.ports, texts)
        faults += self._table.faults(self.ports, [text.partition("=")[0].strip() for text in texts])
        return [*faults, *value_faults(self._description.identifier, self._description, start)]


@dataclass(frozen=True)
class FmuRun:
    """What a run of one FMU is made of.

    Attributes:
        path: the FMU; its unit is named like its library.
        parameters: texts `NAME=VALUE`, of parameters and of inputs at the start, in their own units; an array's values
            stand with commas between them, or `NAME[1]=VALUE` gives one.
        inputs: a file of inputs over time, see `read_inputs`; the others stay at their start values.
        start, stop, step: in seconds; without them those of its default experiment.
        endless: whether it has no stop time, since a program steps it.
    """

    path: Path
    parameters: Sequence[str] = ()
    inputs: Path | None = None
    start: Fraction | None = None
    stop: Fraction | None = None
    step: Fraction | None = None
    endless: bool = False

    def open(self) -> FileExperiment:
        """Return the experiment, after checking all that it is made of.

        Raises:
            InvalidFmu: it is not a valid co-simulation FMU.
            UsageError: neither it nor the call gives a stop time and a step, or a value or the file is invalid.
        """
        d = describe_fmu(self.path)
        start, faults = start_values(d.settable, self.parameters)
        if faults:
            raise UsageError(f"{self.path}: {'; '.join(faults)}") from InvalidParameter(faults)
        until, system = self._until(d.experiment), System()
        system.start = self._from(d.experiment)
        unit = system.add(d.identifier, d, period=self.step)
        system.units[d.identifier] = replace(unit, start=start)
        if self.step is None and not self.endless:
            system.presume_steps(until - system.start)
        table = InputTable({}) if self.inputs is None else read_inputs(self.inputs, d.inputs, start)
        if faults := table.faults(d.settable, [text.partition("=")[0].strip() for text in self.parameters]):
            raise UsageError(f"{self.path}: {'; '.join(faults)}") from InvalidParameter(faults)
        for port, series in table.series.items():
            system.follow(PortName(d.identifier, port), series)
        if not self.endless:
            system.notes += [f"{self.inputs}: {line}" for line in table.notes(float(system.start), float(until))]
        try:
            system.check()
        except WiringError as e:
            raise UsageError(f"{self.path}: {'; '.join(first_faults(naming_step(e.faults)))}") from e
        heading = f"{d.name}, an FMU by itself"
        return system_experiment(self.path.name, heading, system, until, settable=FmuParameters(d, table), alone=True)

    def as_source(self, start: Fraction, stop: Fraction) -> dict[str, Any]:
        """Return what a run's folder keeps, so that it can be resumed; `reopened` reads it."""
        files = {"fmu": str(self.path.absolute()), "sha256": sha256_of(self.path)}
        if self.inputs is not None:
            files |= {"input": str(self.inputs.absolute()), "input_sha256": sha256_of(self.inputs)}
        times = {"start": str(start), "stop": str(stop), "step": None if self.step is None else str(self.step)}
        return {**files, **times, "parameters": list(self.parameters)}

    def _from(self, experiment: DefaultExperiment) -> Fraction:
        return exact_seconds(experiment.start or 0.0) if self.start is None else self.start

    def _until(self, experiment: DefaultExperiment) -> Fraction:
        if self.endless:
            return self._from(experiment) + ENDLESS
        proposed = None if experiment.stop is None else exact_seconds(experiment.stop)
        return checked_stop(self.path, self._from(experiment), self.stop, proposed)


def reopened(source: Mapping[str, Any]) -> tuple[FmuRun, dict[Path, str]]:
    """Return the run that `as_source` was of, with its files and the SHA-256 that each had."""
    inputs = Path(source["input"]) if "input" in source else None
    step = None if source["step"] is None else Fraction(source["step"])
    run = FmuRun(
        path=Path(source["fmu"]),
        parameters=source["parameters"],
        inputs=inputs,
        start=Fraction(source.get("start", "0")),
        stop=Fraction(source["stop"]),
        step=step,
    )
    files = {run.path: source["sha256"]}
    return run, files if inputs is None else {**files, inputs: source["input_sha256"]}
