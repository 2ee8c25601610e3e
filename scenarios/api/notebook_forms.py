"""What a notebook shows of a run and of a campaign: verdict, headline, and pictures of the plots over time."""

import base64
from collections.abc import Iterable, Sequence

from markupsafe import Markup

from handover.cosim.files import scratch_folder
from handover.cosim.record.reader import Record
from handover.scenarios.experiment.parameters import parameters_of
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.runs.results.lacking_record import LackingRecord
from handover.scenarios.runs.results.run_facts import RunFacts
from handover.scenarios.runs.results.tables import headline_rows
from handover.scenarios.runs.results.tolerated_faults import ToleratedFaults

_MAX_FIGURES = 2
_GOOD, _BAD = "#2e7d32", "#c62828"


def run_html(facts: RunFacts, record: Record | None) -> str:
    """Return a run's verdict with its reason, the metrics of its headline, and its first plots over time."""
    summary = facts.summary
    faults, pictures = ToleratedFaults(), list[Markup]()
    faults.lines += filter(None, [facts.missing_record])
    if record is not None:
        with faults.tolerated("the figures over time could not be drawn"):
            figures, left_out = _time_figures(facts, record)
            pictures = _pictures(figures[:_MAX_FIGURES], record)
            faults.lines += [f"Left out: {line}." for line in left_out]
    return str(
        Markup("<div>{}{}{}{}<p><small>results: {}</small></p></div>").format(
            _verdict(facts.scenario, good=bool(summary["success"]), reason=str(summary["reason"])),
            Markup().join(Markup("<p>{}</p>").format(line) for line in faults.lines),
            table_html((), headline_rows(summary["metrics"], facts.headline)),
            Markup().join(pictures),
            str(facts.folder.shown),
        )
    )


def _verdict(name: str, *, good: bool, reason: str) -> Markup:
    """Return a verdict in its colour, with its reason."""
    html = Markup("<p><b>{}: <span style='color: {}'>{}</span></b>, {}</p>")
    return html.format(name, _GOOD if good else _BAD, "succeeded" if good else "failed", reason)


def table_html(header: Sequence[str], rows: Iterable[Sequence[str]]) -> Markup:
    """Return a plain table, as notebooks style it; "" without rows."""
    body = [Markup("<tr>{}</tr>").format(_cells("td", row)) for row in rows]
    if not body:
        return Markup()
    head = Markup("<thead><tr>{}</tr></thead>").format(_cells("th", header)) if header else Markup()
    return Markup("<table>{}<tbody>{}</tbody></table>").format(head, Markup().join(body))


def _cells(kind: str, texts: Sequence[str]) -> Markup:
    tag = Markup(kind)
    cell = Markup("<{} style='text-align: left'>{}</{}>")
    return Markup().join(cell.format(tag, text, tag) for text in texts)


def _pictures(figures: Sequence[TimeFigure], record: Record) -> list[Markup]:
    from handover.scenarios.experiment.plotting import draw_time_figures  # matplotlib may not be installed

    with scratch_folder("figures") as folder:
        drawn = draw_time_figures(figures, record.time, folder)
        files = [(folder / f"{figure.name}.png", figure.caption) for figure in drawn]
        return [_picture(file.read_bytes(), caption) for file, caption in files]


def _time_figures(facts: RunFacts, record: Record) -> tuple[Sequence[TimeFigure], Sequence[str]]:
    """Return the scenario's figures over time, else those of all outputs, and what is left out of them."""
    experiment = facts.experiment
    if experiment is None:
        from handover.scenarios.runs.reporting.run_figures import figures_of_outputs  # draws by matplotlib, too

        return figures_of_outputs(facts.run.get("units", {}), record), ()
    known = LackingRecord(record, experiment.units)
    figures = experiment.time_figures(parameters_of(type(experiment), facts.run["parameters"]), known)
    return known.drawable(figures), known.lines


def _picture(png: bytes, caption: str) -> Markup:
    html = Markup("<img alt='{0}' title='{0}' style='max-width: 760px; width: 100%' src='data:image/png;base64,{1}'>")
    return html.format(caption, base64.b64encode(png).decode())
