"""Sections of a comparison's page: what is compared, in what it differs, metrics of runs, tests, files of figures."""

import math
import os
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import quote

from markupsafe import Markup

from handover.cosim.exceptions import counted
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.experiment.experiment import Figure
from handover.scenarios.experiment.plotting import PRINTED_FORMATS
from handover.scenarios.pages.comparison.campaigns import (
    MAX_TESTS,
    ComparedCampaigns,
    bounds_of_p,
    metric_tests,
    remarks_on_metrics,
    success_tests,
)
from handover.scenarios.pages.comparison.entries import CampaignEntry, Difference, Entry, RunEntry
from handover.scenarios.pages.comparison.runs import MetricRow
from handover.scenarios.runs.reporting.html import Cell, rows_table
from handover.scenarios.runs.reporting.page import Section

_WHAT = {
    "parameter": "parameters",
    "times": "times",
    "file": "files read",
    "unit": "units",
    "scenario": "scenario's code",
    "master": "master",
    "seeds": "seeds",
    "version": "versions",
}


def entries_section(entries: Sequence[Entry], page: Path) -> Section:
    """Return what is compared, with links to the pages that are there, as seen from the comparison's page."""
    rows = [
        (_linked(e, page), _outcome(e), Markup("<span class='name'>{}</span>").format(str(e.folder))) for e in entries
    ]
    html = rows_table(("name", "outcome", "folder"), rows, cards=True)
    return Section(anchor="entries", title="What is compared", html=html)


def _linked(entry: Entry, page: Path) -> Markup:
    report = entry.folder / "report.html"
    if not report.is_file():
        return Markup("{}").format(entry.name)
    link = quote(Path(os.path.relpath(report.resolve(), page.parent.resolve())).as_posix())
    return Markup("<a href='{}'>{}</a>").format(link, entry.name)


def _outcome(entry: Entry) -> str:
    if isinstance(entry, RunEntry):
        summary = entry.facts.summary
        return f"{'succeeded' if summary['success'] else 'failed'}: {summary['reason']}"
    return campaign_outcome(entry)


def campaign_outcome(entry: CampaignEntry) -> str:
    """Return how many runs of a campaign ended and succeeded, in words."""
    results = entry.results
    ended, done = len(results.table), results.done
    text = f"{results.successes} of {counted(done, 'run')} done succeeded"
    if ended > done:
        text += f", {ended - done} failed to run or were lost"
    left = results.planned - ended
    return f"{text}, {counted(left, 'is', 'are')} still to be done" if left > 0 else text


def differences_section(entries: Sequence[Entry], differences: Sequence[Difference]) -> Section:
    """Return the settings in which entries differ."""
    if not differences:
        html = Markup("<p>Parameters, times, files, units, master and versions are the same in all.</p>")
        return Section(anchor="differences", title="In what they differ", html=html)
    rows = [(_WHAT[d.kind], d.name.replace("_", " "), *d.values) for d in differences]
    html = rows_table(("of", "setting", *(e.name for e in entries)), rows)
    kinds = {d.kind for d in differences}
    notes: list[str] = []
    if kinds & {"unit", "file"}:
        notes.append("A file is named with the beginning of its SHA-256.")
    if "version" in kinds:
        notes.append("Other versions may give other numbers by themselves.")
    if notes:
        html += Markup("<p class='soft'>{}</p>").format(" ".join(notes))
    return Section(anchor="differences", title="In what they differ", html=html)


def metrics_section(entries: Sequence[RunEntry], rows: Sequence[MetricRow]) -> Section | None:
    """Return the metrics of runs, a row each; None if there are none."""
    if not rows:
        return None
    shown: list[tuple[str | Cell, ...]] = []
    for row in rows:
        unit = display_unit(row.unit, list(row.values.values()))
        shown.append((row.description, *(Cell(unit.text(row.values[e.name]), row.values[e.name]) for e in entries)))
    header = ("metric", *(e.name for e in entries))
    html = rows_table(header, shown, numbers=range(1, len(header)))
    note = "One run each does not show by how much they vary; campaigns do."
    html += Markup("<p class='soft'>{}</p>").format(note)
    return Section(anchor="metrics", title="Metrics of the runs", html=html)


def tests_section(results: ComparedCampaigns) -> Section | None:
    """Return the tests of each two campaigns at each point; None if no two have done runs at one."""
    tests = success_tests(results)
    if not tests:
        return None
    header = ("at", "first", "second", "first succeeded", "second succeeded", "only first", "only second", "test")
    rows = [
        (
            results.label_of(t.key),
            t.first,
            t.second,
            Cell(f"{t.counts[0]} of {t.counts[1]}", t.counts[0]),
            Cell(f"{t.counts[2]} of {t.counts[3]}", t.counts[2]),
            *((Cell("–"), Cell("–")) if t.pairs is None else _split(t.pairs.only_first, t.pairs.only_second)),
            t.method,
            *_p(t.p, t.corrected),
        )
        for t in tests
    ]
    table = rows_table((*header, "p", "p, Holm"), rows, (3, 4, 5, 6, 8, 9), sortable=True)
    parts = [
        Markup("<h3>Successes</h3>"),
        table,
        *filter(None, (_metric_table(results, name) for name in results.shown_metrics)),
    ]
    note = (
        "Runs of two campaigns with the same seed at a point are a pair, and tests are of pairs: McNemar's exact test "
        "of successes, Wilcoxon's signed-rank test of metrics, with the median difference and its 95 % bootstrap "
        "interval. 'All runs' are the pairs of all points together. Without shared seeds: Fisher's exact test, and "
        "Mann and Whitney's. p is two-sided; the last column is corrected for the number of tests in its table by "
        "Holm's method."
    )
    of_metrics = [t for name in results.shown_metrics for t in metric_tests(results, name)]
    note = " ".join([note, *remarks_on_metrics(results), *bounds_of_p([*tests, *of_metrics])])
    if len(tests) > MAX_TESTS:
        note += f" Metrics are tested in the first {MAX_TESTS} of {len(tests)} cases only."
    html = Markup("").join(parts) + Markup("<p class='soft'>{}</p>").format(note)
    return Section(anchor="tests", title="Tests", html=html, scripts=("campaign.js",))


def _metric_table(results: ComparedCampaigns, metric: str) -> Markup | None:
    tests = metric_tests(results, metric)
    if not tests:
        return None
    differences = [t.test.difference for t in tests]
    unit = display_unit(results.table.unit(metric), differences)
    rows = [
        (
            results.label_of(t.key),
            t.first,
            t.second,
            Cell(f"{t.n} of {t.runs}", t.n),
            Cell(_signed(t.test.difference * unit.factor), t.test.difference),
            "–"
            if t.test.interval is None
            else f"{_signed(t.test.interval.low * unit.factor)} to {_signed(t.test.interval.high * unit.factor)}",
            t.test.method,
            *_p(t.test.p, t.corrected),
        )
        for t in tests
    ]
    difference = unit.axis("second minus first")
    header = ("at", "first", "second", "with values", difference, "95 % interval", "test", "p", "p, Holm")
    caption = results.table.description(metric) or metric.replace("_", " ")
    heading = Markup("<h3>{}</h3>").format(caption[0].upper() + caption[1:])
    return heading + rows_table(header, rows, (3, 4, 5, 7, 8), sortable=True)


def _split(only_first: int, only_second: int) -> tuple[Cell, Cell]:
    return Cell(str(only_first), only_first), Cell(str(only_second), only_second)


def _p(p: float, corrected: float) -> tuple[Cell, Cell]:
    return Cell(f"{p:.3g}", p), Cell(f"{corrected:.3g}", corrected)


def _signed(value: float) -> str:
    if math.isnan(value):
        return "–"
    return "0" if value == 0.0 else f"{value:+.3g}" if abs(value) < 999.5 else f"{value:+.4g}"


def files_section(figures: Sequence[Figure]) -> Section | None:
    """Return links to the figures for papers, with their captions; None if there are none."""
    if not figures:
        return None
    rows = [
        (
            Markup(", ").join(
                Markup("<a href='figures/{0}.{1}'>{0}.{1}</a>").format(f.name, e) for e in PRINTED_FORMATS
            ),
            f.caption,
        )
        for f in figures
    ]
    html = rows_table(("files in figures/", "what it shows"), rows, cards=True)
    return Section(anchor="files", title="Figures for papers", html=html)
