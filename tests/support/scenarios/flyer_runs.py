"""Runs scenarios as the command does, on the built FMUs, and runs that tests share."""

import json
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from handover.cosim.record.reader import Record
from handover.fmus.build import cached
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.runs.execution.interruption import Interruption
from handover.scenarios.runs.execution.runner import run_task
from handover.scenarios.runs.results.run_folder import RunFolder
from handover.scenarios.runs.results.summary import RunResult, metric_of
from handover.scenarios.runs.results.task import Task
from support.kept_runs import kept_run


def run(
    scenario: type[Experiment[Any]],
    out: Path,
    *given: str,
    seed: int = 0,
    stop: float | None = None,
    drawn: bool = False,
) -> RunResult:
    """Run a scenario with parameters as the command takes them; without figures and report unless `drawn`."""
    task = task_of(scenario, out, *given, seed=seed, drawn=drawn)
    return run_task(replace(task, stop=None if stop is None else Fraction(stop)), _tell_nobody, Interruption())


def task_of(scenario: type[Experiment[Any]], out: Path, *given: str, seed: int = 0, drawn: bool = False) -> Task:
    """Return what `run` runs."""
    of_units = [text for text in given if "." in text.partition("=")[0]]
    return Task(
        experiment=scenario(),
        parameters=parse_parameters(scenario, [text for text in given if text not in of_units]),
        unit_values=dict(text.split("=", 1) for text in of_units),
        seed=seed,
        fmus={name: fmu(unit) for name, unit in scenario.units.items()},
        folder=RunFolder(out),
        presented=drawn,
    )


@cache
def fmu(unit: str) -> Path:
    """Return a catalog unit's FMU, whose sources are not looked at again for each run."""
    return cached(unit, 3)


def metric(ended: RunResult, name: str) -> float:
    """Return a figure of a run."""
    return metric_of(ended.summary["metrics"][name]).value


@dataclass(frozen=True)
class Kept:
    """A run by the command that tests share, without page and figures; its folder must not be changed."""

    folder: Path

    @cached_property
    def record(self) -> Record:
        """Its record."""
        return Record(self.folder / "signals.parquet")

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Its `summary.json`."""
        return json.loads((self.folder / "summary.json").read_text(encoding="utf-8"))

    @property
    def reason(self) -> str:
        """What its verdict says."""
        return self.summary["reason"]

    @property
    def success(self) -> bool:
        """Its verdict."""
        return self.summary["success"]

    def metric(self, name: str) -> float:
        """Return one of its figures."""
        return metric_of(self.summary["metrics"][name]).value


@cache
def kept(scenario: str, *given: str) -> Kept:
    """Return a run of a scenario by its name, with parameters as the command takes them; made once for all tests."""
    return Kept(kept_run("run", scenario, *(text for value in given for text in ("-p", value)), "--no-report"))


def _tell_nobody(*_: float) -> None:
    pass
