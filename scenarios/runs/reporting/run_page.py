"""Writes the report page of a run, from what its folder keeps.

`write_run_page` puts the sections together. Header, tables (metrics, parameters, master, files), the comparison with
published values, CPU times and camera pictures are made here; graph, plots and replay in their own modules.
"""

import base64
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

import cv2
import plotly.graph_objects as go
from markupsafe import Markup

from handover.cosim.record.reader import Record
from handover.scenarios.experiment.experiment import Experiment
from handover.scenarios.experiment.paper import PublishedValue
from handover.scenarios.experiment.parameters import InvalidParameter, parameters_of
from handover.scenarios.experiment.pictures import CameraPicture, Mark
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimePlot
from handover.scenarios.runs.reporting.graph import graph_section
from handover.scenarios.runs.reporting.html import plot_html, rows_table
from handover.scenarios.runs.reporting.page import Section, template, write_page
from handover.scenarios.runs.reporting.replay_section import replay_section
from handover.scenarios.runs.reporting.time_plots import explorer_section, time_plots_section
from handover.scenarios.runs.results.lacking_record import LackingRecord
from handover.scenarios.runs.results.pictures import read_picture_files
from handover.scenarios.runs.results.run_facts import RunFacts, record_of
from handover.scenarios.runs.results.run_folder import InvalidRunFolder, RunFolder
from handover.scenarios.runs.results.tables import format_conversion, format_metric, master_rows, warning_lines
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults, drawing

_MAX_BARS = 24
"""Units that have a bar of their own; of more, the cheapest share one."""

_REST_OF_CPU = "master, recording and other"


@dataclass(frozen=True, kw_only=True)
class _CpuBar:
    label: str
    seconds: float
    colour: str = "var(--c0)"


def cpu_section(summary: Mapping[str, Any]) -> Section | None:
    """Return CPU seconds by unit, and the master's beside them; None where they are unknown.

    Args:
        summary: what is in `summary.json`.
    """
    units = [u for u in summary.get("units", ()) if u.get("cpu_seconds") is not None]
    of_process = summary.get("cpu_seconds")
    if not units or of_process is None:
        return None
    rest = max(0.0, of_process - sum(u["cpu_seconds"] for u in units))
    total = sum(u["cpu_seconds"] for u in units) + rest
    if total <= 0.0:
        return None
    bars = [*_cpu_bars(units), _CpuBar(label=_REST_OF_CPU, seconds=rest, colour="var(--soft)")]
    html = template("cpu.html").render(
        plot=_cpu_plot(bars, total),
        rows=[(u, _per_step(u), _cpu_share(u["cpu_seconds"], total)) for u in units],
        rest=(_REST_OF_CPU, rest, _cpu_share(rest, total)),
        total=total,
        simulated=summary["simulated_seconds"],
    )
    return Section(anchor="cpu", title="CPU time", html=Markup(html))


def _cpu_bars(units: Sequence[Mapping[str, Any]]) -> list[_CpuBar]:
    """Return bars of the units, the most expensive first."""
    ordered = sorted(units, key=lambda u: -u["cpu_seconds"])
    bars = [_CpuBar(label=u["name"], seconds=u["cpu_seconds"]) for u in ordered[:_MAX_BARS]]
    if others := ordered[_MAX_BARS:]:
        bars.append(_CpuBar(label=f"{len(others)} other units", seconds=sum(u["cpu_seconds"] for u in others)))
    return bars


def _cpu_plot(bars: Sequence[_CpuBar], total: float) -> Markup:
    seconds = [b.seconds for b in bars]
    texts = [f"{s:.3g} s, {_cpu_share(s, total)}" for s in seconds]
    bar = go.Bar(
        x=seconds,
        y=[_in_two_lines(b.label) for b in bars],
        orientation="h",
        marker={"color": [b.colour for b in bars]},
        text=texts,
        textposition="auto",
        insidetextanchor="end",
        insidetextfont={"color": "var(--page)"},
        textangle=0,
        hovertemplate="%{y}: %{text}<extra></extra>",
    )
    figure = go.Figure(
        [bar],
        {
            "xaxis": {"title": {"text": "CPU time (s)"}, "rangemode": "tozero"},
            "yaxis": {"autorange": "reversed", "type": "category", "dtick": 1, "fixedrange": True, "showgrid": False},
            "bargap": 0.3,
            "showlegend": False,
        },
    )
    return plot_html(figure, height=80 + 32 * len(bars), label="CPU time by unit: " + "; ".join(
        f"{b.label} {text}" for b, text in zip(bars, texts, strict=True)
    ))  # fmt: skip


def _in_two_lines(label: str) -> str:
    return label.replace(", ", ",<br>", 1)


def _cpu_share(seconds: float, total: float) -> str:
    percent = 100.0 * seconds / total
    return f"{percent:.0f} %" if percent >= 9.95 else f"{percent:.1f} %"


def _per_step(unit: Mapping[str, Any]) -> float | None:
    """Return the mean CPU time of a step, ms."""
    return 1000.0 * unit["cpu_seconds"] / unit["steps"] if unit.get("steps") else None


_PICTURE_WIDTHS = (960, 800, 640, 480, 360)
"""Widths to choose from, px: the greatest at which all pictures have room in the page."""

_JPEG_QUALITY = 80
_MAX_PICTURE_BYTES = 1_200_000
"""Size of all pictures in a page together, in base64."""


@dataclass(frozen=True, kw_only=True)
class _DisplayedPicture:
    """A picture in the page: its source, its data in base64, and a caption for screen readers."""

    picture: CameraPicture
    data: str

    @property
    def caption(self) -> str:
        p = self.picture
        marked = ", ".join(mark.label for mark in p.marks)
        return f"{p.camera} camera at {p.t:.1f} s, {p.role}" + (f"; marked: {marked}" if marked else "; nothing marked")


def pictures_section(folder: RunFolder) -> Section | None:
    """Return the pictures in a run's folder, those of one moment side by side; None where there are none.

    Raises:
        InvalidRunFolder: they are damaged.
    """
    pictures = read_picture_files(folder.pictures)
    if not pictures:
        return None
    moments: dict[tuple[float, str], list[_DisplayedPicture]] = {}
    for picture, data in zip(pictures, _inlined_pictures(pictures), strict=True):
        moments.setdefault((picture.t, picture.role), []).append(_DisplayedPicture(picture=picture, data=data))
    marks = {mark.label: mark for picture in pictures for mark in picture.marks}
    html = template("pictures.html").render(moments=moments, legend=list(marks.values()), place=_mark_style)
    return Section(anchor="pictures", title="What the cameras saw", html=Markup(html))


def _inlined_pictures(pictures: Sequence[CameraPicture]) -> list[str]:
    """Return the pictures in base64, at the greatest width at which all have room."""
    encoded: list[str] = []
    for width in _PICTURE_WIDTHS:
        encoded = [base64.b64encode(_scaled_down(p, width)).decode() for p in pictures]
        if sum(map(len, encoded)) <= _MAX_PICTURE_BYTES:
            break
    return encoded


def _scaled_down(picture: CameraPicture, width: int) -> bytes:
    if picture.width <= width:
        return picture.jpeg
    height = math.ceil(picture.height * width / picture.width)
    pixels = cv2.resize(picture.pixels, (width, height), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY])[1].tobytes()


def _mark_style(mark: Mark, picture: CameraPicture) -> str:
    """Return the CSS that puts a mark at its position in a picture shown at any size."""
    left, top = 100.0 * (mark.u + 0.5) / picture.width, 100.0 * (mark.v + 0.5) / picture.height
    wide = 100.0 * 2.0 * mark.radius / picture.width
    return f"left:{left:.3f}%;top:{top:.3f}%;width:{wide:.3f}%;color:{mark.colour}"


@drawing
def write_run_page(
    folder: RunFolder, file: Path | None = None, experiment: Experiment[Any] | None = None
) -> list[str]:  # fmt: skip
    """Write the page of a run, with all that its folder has of it; return what could not be shown, a line each.

    Args:
        folder: the run's.
        file: where the page goes; by default `report.html` in the folder.
        experiment: its scenario, where that has no name by which it is found.

    Raises:
        InvalidRunFolder: it is not the folder of a run, or not of one of the scenario, or it is damaged; nothing is
            written.
        RecordNotWritten: the page cannot be written.
    """
    facts = RunFacts.read(folder, experiment)
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
