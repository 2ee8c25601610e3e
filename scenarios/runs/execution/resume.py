"""An interrupted run: completes its record, checks whether it can be resumed, and gives the task to resume."""

import contextlib
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from handover.cosim.exceptions import RecordNotWritten, nearest, one_line
from handover.cosim.files import FileLocked
from handover.cosim.master.checkpoint import InvalidCheckpoint
from handover.cosim.record.stream import complete_record
from handover.cosim.ssp.archive import ssp_root
from handover.fmus.build import cached, is_of_cache
from handover.scenarios.catalog import SCENARIOS, InvalidScenario, ScenarioSource, named_scenario
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.live_inputs import inputs_of_pushes
from handover.scenarios.experiment.parameters import parameters_of
from handover.scenarios.runs.execution.fmu_run import reopened
from handover.scenarios.runs.execution.input_sources import recorded_input_names, resumed_inputs
from handover.scenarios.runs.execution.resumption import Resumption
from handover.scenarios.runs.execution.ssp_run import open_experiment
from handover.scenarios.runs.execution.unit_values import built_system
from handover.scenarios.runs.results.run_folder import (
    InvalidRunFolder,
    RunFolder,
    is_full,
    sha256_of,
    version_differences,
    versions,
)
from handover.scenarios.runs.results.task import Task


def complete_signals(folder: RunFolder) -> int:
    """Complete the record of an interrupted run as far as it goes; return its rows, 0 if there is none.

    Raises:
        InvalidRunFolder: the run is still under way, or the record cannot be completed.
        RecordNotWritten: the disk is full.
    """
    try:
        return complete_record(folder.signals)
    except FileLocked as e:
        raise InvalidRunFolder(folder.path, "the run still goes on") from e
    except FileNotFoundError:  # it ended before it recorded
        return 0
    except ValueError as e:  # Arrow's
        raise InvalidRunFolder(folder.path, f"its {folder.signals.name} is damaged: {one_line(e)}") from e
    except OSError as e:
        if is_full(e):
            raise RecordNotWritten(folder.signals, str(e.strerror)) from e
        raise InvalidRunFolder(folder.path, f"its record cannot be completed: {e.strerror or e}") from e


class InterruptedRun:
    """The folder of an interrupted run. Its record is completed as far as it goes; nothing else is changed.

    Raises:
        InvalidRunFolder: it is not the folder of a run, or the run is under way, complete, or of other versions than
            are installed. InvalidCheckpoint: it has no checkpoint that can be used.
    """

    def __init__(self, folder: RunFolder) -> None:
        self.folder = folder
        self._description = folder.read_run()
        if folder.read_summary().get("complete"):
            raise InvalidRunFolder(folder.path, "the run is complete; there is nothing to resume")
        rows = complete_signals(folder)
        self._check_versions(self._description.get("versions", {}))
        self.resumption = Resumption(folder.checkpoint)
        if rows < self.resumption.checkpoint.rows:
            counted = self.resumption.checkpoint.rows
            raise InvalidCheckpoint(folder.checkpoint, f"it counts {counted} rows, the record beside it has {rows}")

    def own_code(self) -> list[str]:
        """Return what `task` and the run will run that is not this package's, a line each; nothing of it is run here.

        Raises:
            InvalidRunFolder: the code of the scenario is not what it was, or `run.json` is damaged.
        """
        lines: list[str] = []
        source, units = self._description.get("source", {}), self._description.get("units", {})
        if "scenario" in source:
            before = self._own_source(source)
            lines.append(f"the code of {before.scenario}: {self._unchanged(before)}, as the run began with it")
        for name, file in self._description.get("files", {}).items():
            path, known = Path(str(file)), units.get(name)
            unchanged = known is not None and path.exists() and sha256_of(path) == known["sha256"]
            if unchanged and not is_of_cache(path):
                lines.append(f"the FMU of its unit {name}: {file}")
        return lines + [f"the units in {source[kind]}" for kind in ("ssp", "fmu") if kind in source]

    def task(self, opened: contextlib.ExitStack) -> Task:
        """Return what the run was to do; `opened` closes what that opens. A scenario of one's own is imported.

        Raises:
            InvalidRunFolder: the scenario, an FMU or a file that a parameter names is not what it was.
            InvalidFmu, InvalidSsp: one cannot be read.
        """
        description = self._description
        try:
            experiment = self._experiment(opened)
            fmus = {name: self._fmu(name, unit) for name, unit in experiment.units.items()}
            every, stop = description["checkpoint"], description.get("stop")
            parameters = self.resumption.parameters(type(experiment))
            pushes, hand = experiment.pushes(parameters), experiment.led_hand(parameters)
            task = Task(
                experiment=experiment,
                parameters=parameters,
                seed=int(description["seed"] or 0),
                fmus=fmus,
                folder=self.folder,
                formats=tuple(description["formats"]),
                every=None if every is None else Fraction(every),
                source=description["source"],
                unit_values=description.get("unit_values", {}),
                recorded=tuple(description.get("recorded", ())),
                options=self.resumption.options,
                stop=None if stop is None else Fraction(stop),
                sources=resumed_inputs(self.folder, description.get("inputs"), pushes, hand),
                pushed=not inputs_of_pushes(pushes).keys().isdisjoint(recorded_input_names(self.folder)),
            )
            given = parameters_of(type(experiment), description["parameters"])
            self.resumption.check_run(replace(task, parameters=given))
        except InvalidRunFolder:
            raise
        except (KeyError, TypeError, ValueError) as e:
            raise InvalidRunFolder(self.folder.path, f"its run.json is damaged: {type(e).__name__} {e}") from e
        self._check_parameter_files()
        self._check_fmus(task)
        return task

    def _check_versions(self, before: Mapping[str, str]) -> None:
        if other := version_differences(versions(), before):
            raise InvalidRunFolder(self.folder.path, f"the run began with other versions: {other}")

    def _experiment(self, opened: contextlib.ExitStack) -> Experiment[Any]:
        source, name = self._description["source"], self._description["scenario"]
        if "scenario" in source:
            return self._own_scenario(source)
        if not source:
            if name not in SCENARIOS:
                raise InvalidRunFolder(
                    self.folder.path, f"its scenario {name!r} is not here; {nearest(name, SCENARIOS)}"
                )
            return SCENARIOS[name]()
        if "fmu" in source:
            return self._fmu_experiment(source)
        file, step = Path(source["ssp"]), source["step"]
        if not file.exists() or sha256_of(ssp_root(file)) != source["sha256"]:
            raise InvalidRunFolder(self.folder.path, f"{file} is not the file that the run began with")
        times = Fraction(source["stop"]), None if step is None else Fraction(step)
        start = Fraction(source.get("start", "0"))
        return open_experiment(file, *times, opened, source.get("parameters", ()), start)

    def _own_scenario(self, source: Mapping[str, Any]) -> Experiment[Any]:
        """Return a scenario that is not this package's, if it is what it was."""
        before = self._own_source(source)
        self._unchanged(before)
        try:
            return named_scenario(before.scenario)()
        except InvalidScenario as e:
            raise InvalidRunFolder(self.folder.path, f"its scenario is not here: {e}") from e

    def _own_source(self, source: Mapping[str, Any]) -> ScenarioSource:
        try:
            return ScenarioSource(**source)
        except TypeError as e:
            raise InvalidRunFolder(self.folder.path, f"its run.json is damaged: 'source' is {source!r:.60}") from e

    def _unchanged(self, before: ScenarioSource) -> Path:
        """Return the file of the scenario's module, whose code is what it was."""
        try:
            return before.unchanged_file()
        except KeyError:
            missing = f"its scenario {before.scenario!r} is not installed here"
            raise InvalidRunFolder(self.folder.path, missing) from None
        except InvalidScenario as e:
            raise InvalidRunFolder(self.folder.path, f"{e}; begin a new run") from e

    def _fmu_experiment(self, source: Mapping[str, Any]) -> Experiment[Any]:
        run, files = reopened(source)
        for file, sha256 in files.items():
            if not file.exists() or sha256_of(file) != sha256:
                raise InvalidRunFolder(self.folder.path, f"{file} is not the file that the run began with")
        return run.open()

    def _fmu(self, name: str, unit: str) -> Path:
        """Return a unit's file; if it is gone, or damaged in the folder of built units, the unit built again."""
        path = Path(self._description["files"][name])
        before = self._description.get("units", {}).get(name, {}).get("sha256")
        if path.exists() and (sha256_of(path) == before or not is_of_cache(path)):
            return path
        return cached(unit, 3)

    def _check_parameter_files(self) -> None:
        faults: list[str] = []
        for name, entry in self._description.get("parameter_files", {}).items():
            file = Path(entry["file"])
            if not file.is_file():
                faults.append(f"{file}, which its parameter {name} names, is not there any more")
            elif sha256_of(file) != entry["sha256"]:
                faults.append(f"{file}, which its parameter {name} names, is not the file that the run began with")
        if faults:
            raise InvalidRunFolder(self.folder.path, "; ".join(faults))

    def _check_fmus(self, task: Task) -> None:
        system = built_system(task.experiment, task.parameters, task.seed, task.fmus, task.unit_values)
        here = {name: unit.description.path for name, unit in system.units.items()}
        before = {name: unit.get("sha256") for name, unit in self._description.get("units", {}).items()}
        other = [f"{name} ({here[name]})" for name in here if before.get(name) != sha256_of(here[name])]
        if other:
            raise InvalidRunFolder(
                self.folder.path, f"these FMUs are not those that the run began with: {', '.join(other)}"
            )
