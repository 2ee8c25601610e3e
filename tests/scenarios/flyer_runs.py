"""Runs the free-flyer's scenarios as the command does, on the built FMUs."""

from pathlib import Path
from typing import Any

from handover.fmus.build import cached
from handover.scenarios.execution.interruption import Interruption
from handover.scenarios.execution.runner import carry_out
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.results.run_folder import RunFolder
from handover.scenarios.results.summary import metric_of
from handover.scenarios.results.task import Ended, Task


def run(scenario: type[Experiment[Any]], out: Path, *given: str, seed: int = 0, drawn: bool = False) -> Ended:
    """Run a scenario with parameters as the command takes them; without figures and report unless `drawn`."""
    return carry_out(task_of(scenario, out, *given, seed=seed, drawn=drawn), _tell_nobody, Interruption())


def task_of(scenario: type[Experiment[Any]], out: Path, *given: str, seed: int = 0, drawn: bool = False) -> Task:
    """Return what `run` runs."""
    return Task(
        experiment=scenario(),
        parameters=parse_parameters(scenario, given),
        seed=seed,
        fmus={name: cached(unit, 3) for name, unit in scenario.units.items()},
        folder=RunFolder(out),
        presented=drawn,
    )


def metric(ended: Ended, name: str) -> float:
    """Return a figure of a run."""
    return metric_of(ended.summary["metrics"][name]).value


def _tell_nobody(*_: float) -> None:
    pass
