"""A run as it is asked for, by the command or from Python: all is checked, then there is a task, and nothing written.

Names of options in messages are those of the command.
"""

import contextlib
import copy
import functools
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, cast

from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.experiment import Experiment, NoParameters
from handover.scenarios.experiment.parameters import check_effects
from handover.scenarios.runs.execution.errors import UsageError
from handover.scenarios.runs.execution.file_experiment import ENDLESS, system_experiment
from handover.scenarios.runs.execution.fmu_run import FmuRun, is_fmu
from handover.scenarios.runs.execution.runner import experiment_system
from handover.scenarios.runs.execution.selection import (
    find_scenario,
    own_source,
    path_of_class,
    replacements,
    select_fmus,
)
from handover.scenarios.runs.execution.ssp_run import checked_stop, is_ssp, open_experiment, source_of
from handover.scenarios.runs.execution.unit_values import split_parameters
from handover.scenarios.runs.results.run_folder import RunFolder, dated_folder
from handover.scenarios.runs.results.task import OpenedSubject, RunSettings, Task, task_of

RUNS = Path("runs")
"""Where runs' folders are if nothing names one."""


@dataclass(frozen=True, kw_only=True)
class RunRequest(RunSettings):
    """What one run is asked to be.

    Attributes:
        subject: name of a scenario, path of an SSP or FMU, a system that was wired in Python, or a scenario's class.
        parameters: texts `NAME=VALUE`.
        units: texts `NAME=FILE` or `NAME=MODULE:CLASS`, of what takes the place of a scenario's units.
        out: the run's folder, new or empty; None for one of its own in `runs/`.
        start: when the run starts, s, of a system, an SSP or an FMU; they may have a time of their own.
        stop: when the run ends, s; a scenario, an SSP and an FMU may have a time of their own.
        endless: whether a system, an SSP or an FMU has no stop time, since a program steps it.
        step: of all units of an SSP or FMU, s.
        inputs: a file of inputs over time, of an FMU by itself.
    """

    subject: str | System | type[Experiment[Any]]
    parameters: Sequence[str] = ()
    units: Sequence[str] = ()
    out: Path | None = None
    start: Fraction | None = None
    stop: Fraction | None = None
    endless: bool = False
    step: Fraction | None = None
    inputs: Path | None = None

    def task(self, opened: contextlib.ExitStack) -> Task:
        """Return the task, all parts of which are checked and whose folder is its own; `opened` closes what that opens.

        Raises:
            UsageError, InvalidParameter, InvalidRunFolder, CosimError: what is asked for cannot be run.
        """
        self.check_options()
        asked = self.open(opened)
        stem = Path(asked.experiment.name).stem
        folder = RunFolder(self.out or opened.enter_context(dated_folder(RUNS, stem)))
        return task_of(self, asked, self.fmus(asked.experiment), folder.claim(opened))

    def check_options(self) -> None:
        """Reject what cannot be run at all, and options that are for another kind of run than this one.

        Raises:
            UsageError: it is of another type, or one of them is given.
        """
        check_subject(self.subject)
        of_scenarios = {"-p": self.parameters, "--seed": self.seed, "--unit": self.units}
        of_files = {"--stop": self.stop, "--step": self.step, "--input": self.inputs}
        used = [name for name, value in {**of_scenarios, **of_files}.items() if value]
        used += ["--start"] if self.start is not None else []
        if isinstance(self.subject, System):
            if wrong := [name for name in used if name not in ("--start", "--stop")]:
                raise UsageError(f"{', '.join(wrong)}: a system has its parameters, units, inputs and steps inside")
        elif self._is_file(is_ssp):
            if wrong := [name for name in ("--seed", "--unit") if name in used]:
                raise UsageError(f"{', '.join(wrong)}: for scenarios; an SSP has its units inside")
            if "--input" in used:
                raise UsageError("--input: for an FMU that runs by itself; an SSP's inputs are wired in it")
        elif self._is_file(is_fmu):
            if wrong := [name for name in ("--seed", "--unit") if name in used]:
                raise UsageError(f"{', '.join(wrong)}: for scenarios; the values of an FMU are set by -p")
        elif "--input" in used:
            raise UsageError("--input is for an FMU that runs by itself; a scenario's inputs are wired in it")
        elif "--step" in used:
            raise UsageError("--step is for an SSP or an FMU; a scenario's units have steps of their own")
        elif "--start" in used:
            raise UsageError("--start is for an SSP or an FMU; a scenario begins at 0 s")
        elif self.stop is not None and self.stop <= 0:
            raise UsageError(f"--stop: {float(self.stop):g} s is not after the scenario's begin at 0 s")

    def open(self, opened: contextlib.ExitStack) -> OpenedSubject:
        """Return what is to be run; `opened` closes what that opens.

        Raises:
            UsageError, InvalidParameter, CosimError: there is no such subject, a value is invalid, or nothing comes of
                a parameter that is set.
        """
        asked = self.open_point(opened)
        check_effects(type(asked.experiment), asked.parameters)
        return asked

    def open_point(self, opened: contextlib.ExitStack) -> OpenedSubject:
        """Return the same for a point of a campaign, at others of which its parameters may have effects.

        Raises:
            As `open`, but for parameters of which nothing comes.
        """
        if isinstance(self.subject, System):
            if self.stop is None and not self.endless:
                raise UsageError("a system has no stop time of its own; --stop 10 lets it run for 10 s")
            system = copy.copy(self.subject)
            system.start = system.start if self.start is None else self.start
            asked = system.start + ENDLESS if self.endless else self.stop
            stop = checked_stop(Path("system"), system.start, asked, None)
            return OpenedSubject(system_experiment("system", "a system wired in Python", system, stop))
        if isinstance(self.subject, type):
            return self._of_class(self.subject)
        path = self.path
        if is_ssp(self.subject):
            of_ssp = open_experiment(
                path, self.stop, self.step, opened, self.parameters, self.start, endless=self.endless
            )
            return OpenedSubject(of_ssp, source=source_of(path, *_times_of(of_ssp), self.step, self.parameters))
        if is_fmu(self.subject):
            alone = FmuRun(path, self.parameters, self.inputs, self.start, self.stop, self.step, self.endless)
            of_fmu = alone.open()
            return OpenedSubject(of_fmu, source=alone.as_source(*_times_of(of_fmu)))
        scenario = find_scenario(self.subject)
        values = split_parameters(scenario, self.parameters)
        return OpenedSubject(scenario(), *values, own_source(self.subject), self.stop)

    def fmus(self, experiment: Experiment[Any]) -> dict[str, Path]:
        """Return the FMU of each unit of the scenario; those of the catalog are built where they are not yet.

        Raises:
            UsageError: a unit is not of the scenario, or cannot be built.
        """
        kind = type(experiment)
        return select_fmus(kind, replacements(kind, self.units), lambda unit: cached(unit, 3))

    def system(self, asked: OpenedSubject, seed: int, fmus: Mapping[str, Path]) -> System:
        """Return the system that is to be run, checked.

        Raises:
            CosimError, InvalidParameter, ScenarioFailed: it cannot be wired so.
        """
        units = fmus, asked.unit_values
        system = experiment_system(asked.experiment, asked.parameters, seed, *units, self.options)
        system.check()
        return system

    def _of_class(self, scenario: type[Experiment[Any]]) -> OpenedSubject:
        """Return a scenario by its class; that of a program or a notebook has no path by which it is found again."""
        values = split_parameters(scenario, self.parameters)
        path = path_of_class(scenario)
        return OpenedSubject(scenario(), *values, {} if path is None else own_source(path), self.stop)

    @property
    def path(self) -> Path:
        """The file that is to be run, of an SSP or an FMU."""
        return Path(str(self.subject))

    def _is_file(self, is_of_kind: Callable[[str], bool]) -> bool:
        return isinstance(self.subject, str) and is_of_kind(self.subject)


def _times_of(experiment: Experiment[Any]) -> tuple[Fraction, Fraction]:
    """Return start and stop time of what is run of a file, s."""
    return experiment.start, experiment.stop_time(NoParameters())


def is_file(subject: object) -> bool:
    """Return whether a subject is the path of an SSP or an FMU; the name of a scenario is none, whatever lies here."""
    return isinstance(subject, str) and subject not in SCENARIOS and (is_ssp(subject) or is_fmu(subject))


def experiment_type(
    subject: str, start: Fraction | None = None, stop: Fraction | None = None, step: Fraction | None = None,
    inputs: Path | None = None,
) -> type[Experiment[Any]]:  # fmt: skip
    """Return the class of what is to be run, see `RunRequest`: a scenario; or a file, open while it is the newest.

    Raises:
        UsageError, CosimError: there is no such subject.
    """
    if not is_file(subject):
        return find_scenario(subject)
    there = [file for file in (Path(subject), inputs) if file is not None and file.exists()]
    return _type_of_file(subject, start, stop, step, inputs, tuple((file, file.stat().st_mtime_ns) for file in there))


@functools.lru_cache(maxsize=1)
def _type_of_file(
    file: str,
    start: Fraction | None,
    stop: Fraction | None,
    step: Fraction | None,
    inputs: Path | None,
    _versions: tuple[tuple[Path, int], ...],
) -> type[Experiment[Any]]:
    opened = contextlib.ExitStack()
    request = RunRequest(subject=file, start=start, stop=stop, step=step, inputs=inputs)
    found = type(request.open(opened).experiment)
    weakref.finalize(found, opened.close)
    return found


def check_subject(subject: object) -> None:
    """Reject what is neither a text, nor a system of units, nor a scenario's class.

    Raises:
        UsageError: it is something else.
    """
    if isinstance(subject, type):
        if not issubclass(subject, Experiment):
            raise UsageError(f"{subject.__name__} is not a scenario: a subclass of Experiment is")
        if missing := sorted(getattr(cast(Any, subject), "__abstractmethods__", ())):
            raise UsageError(f"{subject.__name__} is not complete: it has no {', '.join(missing)}")
    elif not isinstance(subject, (str, System)):
        right = "expected a scenario's name or class, a system, or the path of an SSP or FMU"
        raise UsageError(f"{subject!r} cannot be run: {right}")
    elif isinstance(subject, System) and not subject.units:
        raise UsageError("the system has no units: add one, such as by system.add('arm', 'arm.fmu')")
