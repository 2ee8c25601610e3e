"""Draws the figures of a run that has ended, of what its folder keeps."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from handover.cosim.record.reader import Record, RecordedSignals
from handover.scenarios.execution.ssp_run import figures_of_outputs
from handover.scenarios.experiment.experiment import Evaluator, Experiment, Figure
from handover.scenarios.experiment.parameters import InvalidParameter, parameters_of
from handover.scenarios.experiment.plotting import draw_time_figures
from handover.scenarios.results.pictures import read_picture_files
from handover.scenarios.results.run_facts import RunFacts, record_of
from handover.scenarios.results.run_folder import InvalidRunFolder, RunFolder, disk_errors_reported


def draw_figures(
    experiment: Experiment[Any], parameters: Any, evaluator: Evaluator, record: Record, folder: Path
) -> Sequence[Figure]:
    """Draw what a scenario shows of a run into a folder: the scene and the like, then curves over time."""
    scenes = experiment.draw(parameters, evaluator, record, folder)
    return [*scenes, *draw_time_figures(experiment.time_figures(parameters, record), record.time, folder)]


def draw_run(folder: RunFolder) -> Sequence[Figure]:
    """Draw a run's figures into `figures/`, in place of those of the same names, all or none.

    Raises:
        BadRunFolder: it is not the folder of a run, it is damaged, or it has nothing that can be drawn.
        RecordNotWritten: they cannot be written.
    """
    facts, record = RunFacts.read(folder), record_of(folder)
    if record is None:
        raise InvalidRunFolder(folder.path, "there is nothing to draw: its record has less than two rows")
    unfinished = folder.path / "figures.part"
    with disk_errors_reported(folder.figures):
        try:
            unfinished.mkdir(exist_ok=True)
            figures = _drawn(facts, record, unfinished)
            folder.figures.mkdir(exist_ok=True)
            for file in unfinished.iterdir():
                os.replace(file, folder.figures / file.name)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
    return figures


def _drawn(facts: RunFacts, record: Record, to: Path) -> Sequence[Figure]:
    experiment = facts.experiment
    if experiment is None:
        return draw_time_figures(figures_of_outputs(facts.run.get("units", {}), record), record.time, to)
    try:
        parameters = parameters_of(type(experiment), facts.run["parameters"])
        evaluator = experiment.evaluator_of_record(parameters, read_picture_files(facts.folder.pictures))
        _show(record, evaluator)
        return draw_figures(experiment, parameters, evaluator, record, to)
    except (InvalidParameter, KeyError) as e:
        raise InvalidRunFolder(
            facts.folder.path, f"the run is of another version of {facts.scenario}: {e.args[0]}"
        ) from e


def _show(record: Record, evaluator: Evaluator) -> None:
    """Let a watch see a run again."""
    signals = RecordedSignals(record)
    for row, t in enumerate(record.time.tolist()):
        signals.row = row
        evaluator(t, signals)
    evaluator.finish(signals)
