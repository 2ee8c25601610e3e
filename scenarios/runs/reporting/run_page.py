"""Writes the report page of a run, from what its folder keeps.

`write_run_page` puts the sections together. Header, tables (metrics, parameters, master, files) and the comparison with
published values are made here; graph, plots, pictures and replay in their own modules.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.experiment.parameters import InvalidParameter, parameters_of
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimePlot
from handover.scenarios.runs.reporting.cpu_section import cpu_section
from handover.scenarios.runs.reporting.graph import graph_section
from handover.scenarios.runs.reporting.html import rows_table
from handover.scenarios.runs.reporting.page import Section, template, write_page
from handover.scenarios.runs.reporting.pictures_section import pictures_section
from handover.scenarios.runs.reporting.replay_section import replay_section
from handover.scenarios.runs.reporting.time_plots import explorer_section, time_plots_section
from handover.scenarios.runs.results.lacking_record import LackingRecord
from handover.scenarios.runs.results.run_facts import RunFacts, record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.tables import format_conversion, format_metric, master_rows, warning_lines
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults, drawing


@drawing
def write_run_page(folder: RunFolder, file: Path | None = None) -> list[str]:
    """Write the page of a run, with all that its folder has of it; return what could not be shown, a line each.

    Args:
        folder: the run's.
        file: where the page goes; by default `report.html` in the folder.

    Raises:
        InvalidRunFolder: it is not the folder of a run, or it is damaged; nothing is written.
        RecordNotWritten: the page cannot be written.
    """
    facts = RunFacts.read(folder)
    record, faults = record_of(folder), ToleratedFaults()
    faults.lines += filter(None, [facts.missing_record])
    replay, plots = _sections_of_scenario(facts, record, faults)
    sections = [
        replay,
        metrics_section(facts),
        published_section(facts),
        plots,
        pictures_section(folder),
        _explorer(record, faults),
        *_sections_of_units(facts),
        parameters_section(facts),
        master_section(facts),
        files_section(facts, (file or folder.report).absolute().parent),
    ]
    heading = f"{facts.scenario}: {_verdict(facts).lower()}"
    left_out = list(dict.fromkeys([*facts.summary.get("left_out", ()), *faults.lines]))
    write_page(file or folder.report, heading, run_header(facts, left_out), [s for s in sections if s is not None])
    return faults.lines


def _sections_of_scenario(
    facts: RunFacts, record: Record | None, faults: ToleratedFaults
) -> tuple[Section | None, Section | None]:
    """Return the scenario's replay and plots of the record; one that says why where they cannot be made."""
    faults.lines += facts.not_drawn
    experiment = facts.experiment
    if experiment is None or record is None:
        return None, None
    replay_shown: Section | None = None
    plots_shown: Section | None = None
    guarded = ToleratedFaults(InvalidParameter, KeyError)
    try:
        replay, plots, shown = replay_and_plots(facts, record, guarded)
        with guarded.tolerated("the figures over time could not be drawn"):
            plots_shown = time_plots_section(plots, shown.time)
        with guarded.tolerated("the replay could not be drawn"):
            replay_shown = None if replay is None else replay_section(replay, shown)
    except (InvalidParameter, KeyError) as e:
        why = e.args[0] if e.args else e
        html = Markup("<p>The run is of another version of {}, so its plots and its replay are left out: {}.</p>")
        return None, Section(anchor="time", title="Over time", html=html.format(facts.scenario, why))
    faults.lines += guarded.lines
    return replay_shown, plots_shown


def replay_and_plots(
    facts: RunFacts, record: Record, faults: ToleratedFaults
) -> tuple[Replay | None, list[TimePlot], Record]:
    """Return what a run's scenario shows of its record: its scene, its plots, and the record that they are of.

    What cannot be made, or is left out for want of outputs, is noted in `faults`.

    Raises:
        InvalidParameter, KeyError: the run is of another version of the scenario.
    """
    experiment = facts.experiment
    if experiment is None:
        return None, [], record
    guarded = ToleratedFaults(InvalidParameter, KeyError)
    known = LackingRecord(record, experiment.units)
    parameters: Any = parameters_of(type(experiment), facts.run["parameters"])
    plots: list[TimePlot] = []
    shown: Replay | None = None
    with guarded.tolerated("the figures over time could not be drawn"):
        plots += known.drawable_plots(experiment.plots(parameters, known))
    with guarded.tolerated("the replay could not be drawn"):
        replay = experiment.replay(parameters, known)
        shown = None if replay is None else known.drawable_replay(replay)
    faults.lines += [*guarded.lines, *known.lines]
    return shown, plots, known


def _explorer(record: Record | None, faults: ToleratedFaults) -> Section | None:
    with faults.tolerated("the signals could not be drawn"):
        return None if record is None else explorer_section(record)
    return None


def _sections_of_units(facts: RunFacts) -> Sequence[Section | None]:
    try:
        return graph_section(facts.run), cpu_section(facts.summary)
    except (KeyError, ValueError) as e:  # an icon that is not a picture, or a connection of a unit that is not listed
        fault = f"its description of the units is damaged: {type(e).__name__} {e}"
        raise InvalidRunFolder(facts.folder.path, fault) from e


_VERSIONS = {"handover-cosim": "handover-cosim", "python": "Python"}


def run_header(facts: RunFacts, left_out: Sequence[str] = ()) -> Markup:
    """Return the verdict, what ran with which seed and versions, what is left out, and the log of a failure."""
    summary, versions = facts.summary, facts.run.get("versions", {})
    entries = [facts.title] if facts.title else []
    if facts.run.get("seed") is not None:
        entries.append(f"seed {facts.run['seed']}")
    entries.append(_duration(facts))
    entries += [f"{name} {versions[key]}" for key, name in _VERSIONS.items() if key in versions]
    return Markup(
        template("run_header.html").render(
            entries=[t for t in entries if t],
            verdict=_verdict(facts),
            good=summary["success"],
            reason=summary["reason"],
            resumable=facts.folder.checkpoint.exists(),
            left_out=left_out,
            warnings=len(_warnings(facts)),
            failure={"log": (), "instance": None, **(summary.get("failure") or summary.get("ended") or {})},
        )
    )


def _verdict(facts: RunFacts) -> str:
    if facts.summary["success"]:
        return "Succeeded"
    if not facts.ended:
        return "Not ended"
    return "Interrupted" if facts.summary["reason"].startswith("interrupted") else "Failed"


def _duration(facts: RunFacts) -> str:
    simulated, wall = (facts.summary.get(f"{name}_seconds") for name in ("simulated", "wall"))
    if simulated is None:
        return ""
    return f"{simulated:.1f} s simulated" + ("" if wall is None else f" in {wall:.1f} s of wall time")


_IN_TABLES = ("cpu_", "pace_", "iterations", "rollbacks")
"""Beginnings of the names of metrics that other sections show."""

_FILES = {
    "summary.json": "verdict and metrics of the run",
    "signals.parquet": "all signals over time, with units",
    "run.json": "configuration, versions and hashes",
    "checkpoint.zip": "the last checkpoint, to resume from",
    "figures": "figures as PNG and SVG",
    "pictures": "pictures of the cameras",
}


def metrics_section(facts: RunFacts) -> Section | None:
    """Return the metrics, those of the headline first."""
    metrics: Mapping[str, Any] = facts.summary["metrics"]
    first = [n for n in facts.headline if n in metrics]
    others = [n for n in metrics if n not in first and not n.startswith(_IN_TABLES)]
    rows = [(metrics[n].get("description") or n, format_metric(metrics[n]), n) for n in first + others]
    return _table("metrics", "Metrics", rows, first=len(first))


def parameters_section(facts: RunFacts) -> Section | None:
    """Return the parameters, with their descriptions where the run has them."""
    return _table("parameters", "Parameters", [(description, value, n) for n, value, description in facts.parameters])


def master_section(facts: RunFacts) -> Section | None:
    """Return how the units were coupled, which units of measure were converted, and what was warned of."""
    rows = master_rows(facts.summary) if "master" in facts.summary else []
    conversions = [format_conversion(c) for c in facts.run.get("conversions", [])]
    warnings, notes = _warnings(facts), facts.run.get("notes", [])
    if not (rows or conversions or warnings or notes):
        return None
    messages = (("Warnings", warnings), ("Notes", notes))
    html = template("run_master.html").render(rows=rows, conversions=conversions, messages=messages)
    return Section(anchor="master", title="Master", html=Markup(html))


def _warnings(facts: RunFacts) -> list[str]:
    """Return what was warned of before the run, and what its units warned of in it."""
    return [*facts.run.get("warnings", []), *warning_lines(facts.summary)]


def files_section(facts: RunFacts, place: Path) -> Section:
    """Return the command that repeats the run, its folder's files, and the versions that it ran with.

    Args:
        facts: of the run.
        place: absolute folder of the page, from which it links the files.
    """
    path = facts.folder.path
    files = [(name, what) for name, what in _FILES.items() if _has_content(path / name)]
    links = {name: quote(Path(os.path.relpath(path / name, place)).as_posix()) for name, _ in files}
    versions, units = facts.run.get("versions", {}), facts.run.get("units", {})
    html = template("run_files.html").render(
        files=files, links=links, units=units, versions=versions, command=repeating_command(facts)
    )
    return Section(anchor="files", title="Files", html=Markup(html))


def repeating_command(facts: RunFacts) -> str:
    """Return the command that makes the same run once more, called in its folder; "" of what a program has wired."""
    if facts.experiment is None and not facts.run.get("source"):
        return ""
    return "handover run --config run.json" + (" --inputs-from ." if facts.run.get("external_inputs") else "")


def _has_content(path: Any) -> bool:
    return any(path.iterdir()) if path.is_dir() else path.exists()


def _table(anchor: str, title: str, rows: Sequence[tuple[str, str, str]], first: int = 0) -> Section | None:
    if not rows:
        return None
    html = template("run_table.html").render(rows=rows, first=first)
    return Section(anchor=anchor, title=title, html=Markup(html))


def published_section(facts: RunFacts) -> Section | None:
    """Return the run's metrics beside the paper's values, for parameters near the published; None if there are none."""
    metrics = facts.summary["metrics"]
    rows = [_published_row(v, metrics[v.metric]) for v in _published_values(facts) if v.metric in metrics]
    if not rows:
        return None
    note = "One run does not test what was published: it does not show how its metrics vary."
    html = rows_table(("metric", "this run", "published", "where"), rows, numbers=(1, 2), cards=True)
    return Section(
        anchor="published", title="Published values", html=html + Markup("<p class='soft'>{}</p>").format(note)
    )


def _published_values(facts: RunFacts) -> Sequence[PublishedValue]:
    if facts.experiment is None:
        return ()
    try:
        return facts.experiment.published(parameters_of(type(facts.experiment), facts.run["parameters"]))
    except InvalidParameter:  # of another version: the page reports it in place of the plots
        return ()


def _published_row(value: PublishedValue, metric: Mapping[str, Any]) -> tuple[str | Markup, ...]:
    unit = {"unit": metric["unit"]}
    shown = f"{value.relation} {format_metric({**unit, 'value': value.value})}".lstrip()
    if value.limits is not None:
        shown += " ({} to {})".format(*(format_metric({**unit, "value": x}) for x in value.limits))
    status = "" if value.status == "stated" else f" ({value.status})"
    where = Markup("{}{}").format(value.where, status)
    if value.note:
        where += Markup("<br><span class='soft'>{}</span>").format(value.note)
    return metric["description"] or value.metric, format_metric(metric), shown, where
