"""Writes the page of a run, of what is in its folder."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.parameters import BadParameter, parameters_of
from handover.scenarios.reporting.cpu_section import cpu_section
from handover.scenarios.reporting.explorer_section import explorer_section
from handover.scenarios.reporting.graph_section import graph_section
from handover.scenarios.reporting.page import write_page
from handover.scenarios.reporting.pictures_section import pictures_section
from handover.scenarios.reporting.published_section import published_section
from handover.scenarios.reporting.replay_section import replay_section
from handover.scenarios.reporting.run_facts import RunFacts
from handover.scenarios.reporting.run_lead import run_lead
from handover.scenarios.reporting.run_record import record_of
from handover.scenarios.reporting.run_tables import files_section, master_section, metrics_section, parameters_section
from handover.scenarios.reporting.section import Section
from handover.scenarios.reporting.time_plots_section import time_plots_section
from handover.scenarios.run_folder import BadRunFolder, RunFolder


def write_run_page(folder: RunFolder, file: Path | None = None) -> None:
    """Write the page of a run that has ended, or that was completed: what of it the folder has is in it.

    Args:
        folder: the run's.
        file: where the page goes; by default `report.html` in the folder.

    Raises:
        BadRunFolder: it is not the folder of a run, or it is damaged; nothing is written.
        RecordNotWritten: the page cannot be written.
    """
    facts = RunFacts.read(folder)
    record = record_of(folder)
    sections = [
        metrics_section(facts),
        published_section(facts.summary, facts.run),
        *_seen(facts, record),
        pictures_section(folder),
        None if record is None else explorer_section(record),
        *_of_units(facts),
        parameters_section(facts),
        master_section(facts),
        files_section(facts),
    ]
    heading = f"{facts.scenario}: {'succeeded' if facts.summary['success'] else 'failed'}"
    write_page(file or folder.report, heading, run_lead(facts), [s for s in sections if s is not None])


def _seen(facts: RunFacts, record: Record | None) -> Sequence[Section | None]:
    """Return what the scenario shows of its record; a section that says why where it cannot."""
    if facts.experiment is None or record is None:
        return ()
    try:
        parameters: Any = parameters_of(type(facts.experiment), facts.run["parameters"])
        plots, replay = facts.experiment.plots(parameters, record), facts.experiment.replay(parameters, record)
        return [
            time_plots_section(plots, record),
            None if replay is None else replay_section(replay, record),
        ]
    except (BadParameter, KeyError) as e:
        why = e.args[0] if e.args else e
        html = Markup("<p>The run is of another version of {}, so its plots and its replay are left out: {}.</p>")
        return [Section(anchor="time", title="Over time", html=html.format(facts.scenario, why))]


def _of_units(facts: RunFacts) -> Sequence[Section | None]:
    try:
        return graph_section(facts.run), cpu_section(facts.summary)
    except (KeyError, TypeError, AttributeError, ValueError, IndexError) as e:
        fault = f"what it tells of its units is damaged: {type(e).__name__} {e}"
        raise BadRunFolder(facts.folder.path, fault) from e
