"""Runs the free-flyer's scenarios as the command does, on the built FMUs."""

from pathlib import Path
from typing import Any

from handover.fmus.build import cached
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.runner import run_task
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.results.run_folder import RunFolder
from handover.scenarios.results.summary import RunResult, metric_of
from handover.scenarios.results.task import Task


def run(scenario: type[Experiment[Any]], out: Path, *given: str, seed: int = 0, drawn: bool = False) -> RunResult:
    """Run a scenario with parameters as the command takes them; without figures and report unless `drawn`."""
    return run_task(task_of(scenario, out, *given, seed=seed, drawn=drawn), _tell_nobody, Interruption())


def task_of(scenario: type[Experiment[Any]], out: Path, *given: str, seed: int = 0, drawn: bool = False) -> Task:
    """Return what `run` runs."""
    of_units = [text for text in given if "." in text.partition("=")[0]]
    return Task(
        experiment=scenario(),
        parameters=parse_parameters(scenario, [text for text in given if text not in of_units]),
        unit_values=dict(text.split("=", 1) for text in of_units),
        seed=seed,
        fmus={name: cached(unit, 3) for name, unit in scenario.units.items()},
        folder=RunFolder(out),
        presented=drawn,
    )


def metric(ended: RunResult, name: str) -> float:
    """Return a figure of a run."""
    return metric_of(ended.summary["metrics"][name]).value


def _tell_nobody(*_: float) -> None:
    pass
