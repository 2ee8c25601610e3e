"""Draws the figures of a run for papers, from what its folder keeps.

The scenario's evaluator sees the recorded signals again, so that figures can show what it found.
"""

import os
import re
import shutil
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.cosim.record.reader import Record, RecordedSignals
from handover.scenarios.experiment.display_unit import unit_symbol
from handover.scenarios.experiment.experiment import Evaluator, Experiment, Figure
from handover.scenarios.experiment.parameters import InvalidParameter, parameters_of
from handover.scenarios.experiment.plotting import draw_time_figures
from handover.scenarios.experiment.time_plot import COLOURS, Curve, TimeFigure, TimePlot
from handover.scenarios.runs.results.lacking_record import LackingRecord
from handover.scenarios.runs.results.pictures import read_picture_files
from handover.scenarios.runs.results.run_facts import RunFacts, elements_of, record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder, disk_errors_reported, folder_within
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults, drawing

_MAX_SIGNALS = 6
"""Ports of a unit in its figure."""


def draw_figures(
    experiment: Experiment[Any], parameters: Any, evaluator: Evaluator, record: Record, folder: Path,
    faults: ToleratedFaults,
) -> Sequence[Figure]:  # fmt: skip
    """Draw a scenario's figures of a run into a folder: those of `draw`, such as the scene, then those over time.

    What cannot be drawn is noted in `faults`; the other figures are drawn.
    """
    drawn: list[Figure] = []
    record = LackingRecord(record, experiment.units)
    with faults.tolerated("the figures of the scene could not be drawn"):
        drawn += experiment.draw(parameters, evaluator, record, folder)
    figures: Sequence[TimeFigure] = ()
    with faults.tolerated("the figures over time could not be drawn"):
        figures = record.drawable(experiment.time_figures(parameters, record))
    for spec in figures:
        with faults.tolerated(f"figure {spec.name} could not be drawn"):
            drawn += draw_time_figures([spec], record.time, folder)
    faults.lines += record.lines
    return drawn


@drawing
def draw_run(folder: RunFolder, experiment: Experiment[Any] | None = None) -> list[str]:
    """Draw a run's figures into `figures/`, replacing those of the same names; return what failed, a line each.

    `experiment` is its scenario, where that has no name by which it is found.

    Raises:
        InvalidRunFolder: it is not the folder of a run, it is damaged, or it has nothing to draw.
        RecordNotWritten: they cannot be written.
    """
    facts, record = RunFacts.read(folder, experiment), record_of(folder)
    if record is None:
        why = facts.missing_record or "its record has less than two rows"
        raise InvalidRunFolder(folder.path, f"there is nothing to draw: {why}")
    unfinished, faults = folder.path / "figures.part", ToleratedFaults(InvalidParameter, KeyError)
    with disk_errors_reported(folder.figures):
        try:
            folder_within(unfinished)
            draw_record(facts, record, unfinished, faults)
            folder_within(folder.figures)
            for file in unfinished.iterdir():
                os.replace(file, folder.figures / file.name)
        finally:
            shutil.rmtree(unfinished, ignore_errors=True)
    return faults.lines


def draw_record(facts: RunFacts, record: Record, to: Path, faults: ToleratedFaults) -> Sequence[Figure]:
    """Draw a run's figures into a folder; return them in the order of a page. What failed is noted in `faults`.

    Raises:
        InvalidRunFolder: the run is of another version of its scenario.
    """
    experiment = facts.experiment
    if experiment is None:
        faults.lines += facts.not_drawn
        with faults.tolerated("the outputs could not be drawn"):
            return draw_time_figures(figures_of_outputs(facts.run.get("units", {}), record), record.time, to)
        return ()
    try:
        parameters = parameters_of(type(experiment), facts.run["parameters"])
        evaluator = experiment.evaluator_of_record(parameters, read_picture_files(facts.folder.pictures))
        with faults.tolerated("the record could not be evaluated again"):
            _evaluate(LackingRecord(record, experiment.units), evaluator)
        return draw_figures(experiment, parameters, evaluator, record, to, faults)
    except (InvalidParameter, KeyError) as e:
        raise InvalidRunFolder(
            facts.folder.path, f"the run is of another version of {facts.scenario}: {e.args[0]}"
        ) from e


def _evaluate(record: Record, evaluator: Evaluator) -> None:
    """Replay a record to an evaluator."""
    signals = RecordedSignals(record)
    for row, t in enumerate(record.time.tolist()):
        signals.row = row
        evaluator(t, signals)
    evaluator.finish(signals)


def figures_of_outputs(units: Iterable[str], record: Record) -> list[TimeFigure]:
    """Return a figure for each unit with its first real outputs over time, each on its own axes."""
    figures: list[TimeFigure] = []
    for name in units:
        ports = [s for s in record.signals if s.startswith(f"{name}.") and record[s].dtype.kind == "f"][:_MAX_SIGNALS]
        if ports:
            file = f"{len(figures) + 1}_{re.sub(r'[^A-Za-z0-9_-]', '_', name)}"
            plots = [signal_plot(p, p.removeprefix(f"{name}."), record[p], record.unit(p)) for p in ports]
            figures.append(TimeFigure(name=file, caption=f"Outputs of {name} over time.", plots=plots))
    return figures


def signal_plot(name: str, quantity: str, values: NDArray[Any], unit: str) -> TimePlot:
    """Return a plot of a signal over time; of one with many elements the first ones, as its axis says.

    Args:
        name: of the signal, the title.
        quantity: what stands at the axis, and in the legend of several elements, `p_WG[1]`.
        values: with a row a time.
        unit: the signal's, as a record has it.
    """
    elements, held = elements_of(quantity, values), values.dtype.kind != "f"
    shown = list(elements.items())[: len(COLOURS)]
    curves = [Curve(label=label, values=column.astype(np.float64), held=held) for label, column in shown]
    some = "" if len(shown) == len(elements) else f", first {len(shown)} of {len(elements)}"
    return TimePlot(title=name, quantity=f"{quantity}{some}", unit=unit_symbol(unit), curves=curves)
