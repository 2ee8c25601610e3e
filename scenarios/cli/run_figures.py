"""Draws the figures of a run that has ended, of what its folder keeps."""

import os
import shutil
from collections.abc import Sequence
from pathlib import Path

from handover.cosim.record.reader import Record, RecordedSignals
from handover.scenarios.execution.ssp_run import draw_outputs
from handover.scenarios.experiment.experiment import Figure, Watch
from handover.scenarios.experiment.parameters import BadParameter, parameters_of
from handover.scenarios.results.pictures import read_pictures
from handover.scenarios.results.run_facts import RunFacts, record_of
from handover.scenarios.results.run_folder import BadRunFolder, RunFolder, told_if_not_written


def draw_run(folder: RunFolder) -> Sequence[Figure]:
    """Draw a run's figures into `figures/`, in place of those of the same names, all or none.

    Raises:
        BadRunFolder: it is not the folder of a run, it is damaged, or it has nothing that can be drawn.
        RecordNotWritten: they cannot be written.
    """
    facts, record = RunFacts.read(folder), record_of(folder)
    if record is None:
        raise BadRunFolder(folder.path, "there is nothing to draw: its record has less than two rows")
    unfinished = folder.path / "figures.part"
    with told_if_not_written(folder.figures):
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
        return draw_outputs(facts.run.get("units", {}), record, to)
    try:
        parameters = parameters_of(type(experiment), facts.run["parameters"])
        watch = experiment.watch_of_record(parameters, read_pictures(facts.folder.pictures))
        _show(record, watch)
        return experiment.draw(parameters, watch, record, to)
    except (BadParameter, KeyError) as e:
        raise BadRunFolder(facts.folder.path, f"the run is of another version of {facts.scenario}: {e.args[0]}") from e


def _show(record: Record, watch: Watch) -> None:
    """Let a watch see a run again."""
    signals = RecordedSignals(record)
    for row, t in enumerate(record.time.tolist()):
        signals.row = row
        watch(t, signals)
    watch.finish(signals)
