"""Prints the summary of a comparison: a row for each point and campaign, or for each metric of runs, and the tests."""

from collections.abc import Sequence

from rich.console import Console
from rich.table import Table
from rich.text import Text

from handover.cosim.exceptions import counted
from handover.scenarios.cli.console import heading, open_console
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.pages.comparison.campaigns import (
    EVERY,
    ComparedCampaigns,
    MetricTest,
    bounds_of_p,
    metric_tests,
    remarks_on_metrics,
    success_tests,
)
from handover.scenarios.pages.comparison.page import Comparison, RunComparison
from handover.scenarios.runs.results.run_folder import RunFolder

_MAX_ROWS = 24


def print_comparison(comparison: Comparison, folder: RunFolder) -> None:
    """Print what was found, in what the entries differ, and where page and figures are."""
    console = open_console()
    if isinstance(comparison, RunComparison):
        _print_runs(console, comparison)
    else:
        _print_campaigns(console, comparison.results)
    if comparison.differences:
        names = ", ".join(d.name for d in comparison.differences)
        console.print(f"they differ in: {names}", markup=False, soft_wrap=True)
    if isinstance(comparison, RunComparison):
        for line in comparison.overlay.left_out:
            console.print(line, markup=False, soft_wrap=True)
    console.print(f"report: {folder.shown / folder.report.name}", markup=False, soft_wrap=True)
    console.print(f"figures: {folder.shown / folder.figures.name}", markup=False, soft_wrap=True)


def _print_campaigns(console: Console, results: ComparedCampaigns) -> None:
    metrics = results.shown_metrics[: max(1, (console.width - 70) // 24)]
    rows: list[list[str]] = []
    for key in results.matched:
        for name, point in results.at(key).items():
            span = point.interval
            ends = "" if span is None else f"{100 * span.low:.0f} % to {100 * span.high:.0f} %"
            medians = [display_unit(results.table.unit(m), results.median(point, m)) for m in metrics]
            texts = [unit.text(results.median(point, m)) for unit, m in zip(medians, metrics, strict=True)]
            rows.append([results.label_of(key), name, f"{point.successes} of {len(point.done)}", ends, *texts])
    _print_table(console, ("at", "campaign", "succeeded", "95 % interval", *(f"median\n{m}" for m in metrics)), rows)
    _print_tests(console, results)


def _print_tests(console: Console, results: ComparedCampaigns) -> None:
    """Print the tests of successes where these differ at all, and of metrics, those over all points first."""
    by_success = [t for t in success_tests(results) if not t.all_alike]
    of_metrics = [t for m in results.shown_metrics for t in metric_tests(results, m)]
    of_metrics.sort(key=lambda t: t.key != EVERY)
    successes = [
        [
            results.label_of(t.key),
            f"{t.first} – {t.second}",
            f"{t.counts[0]} of {t.counts[1]} – {t.counts[2]} of {t.counts[3]}",
            t.method,
            f"{t.p:.3g}",
        ]
        for t in by_success
    ]
    _print_table(console, ("at", "successes of", "", "test", "p"), successes)
    metrics = [
        [
            results.label_of(t.key),
            t.metric,
            f"{t.second} – {t.first}",
            f"{t.n} of {t.runs}",
            _difference(results, t),
            t.test.method,
            f"{t.test.p:.3g}",
        ]
        for t in of_metrics
    ]
    _print_table(console, ("at", "metric", "difference of", "with values", "median", "test", "p"), metrics)
    for sentence in [*remarks_on_metrics(results), *bounds_of_p([*by_success, *of_metrics])]:
        console.print(sentence, markup=False, soft_wrap=True)


def _difference(results: ComparedCampaigns, test: MetricTest) -> str:
    difference = test.test.difference
    unit = display_unit(results.table.unit(test.metric), [difference])
    return f"{'+' if difference > 0.0 else ''}{unit.text(difference)}"


def _print_runs(console: Console, comparison: RunComparison) -> None:
    names = [e.name for e in comparison.entries]
    rows: list[list[str]] = []
    for row in comparison.metrics:
        unit = display_unit(row.unit, list(row.values.values()))
        rows.append([row.description, *(unit.text(row.values[n]) for n in names)])
    verdicts = ["succeeded" if e.facts.summary["success"] else "failed" for e in comparison.entries]
    _print_table(console, ("", *names), [["verdict", *verdicts], *rows])


def _print_table(console: Console, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    if not rows:
        return
    table = Table(box=None, padding=(0, 2), pad_edge=True)
    for k, name in enumerate(header):
        table.add_column(heading(name), justify="left" if k == 0 else "right", overflow="fold")
    for row in rows[:_MAX_ROWS]:
        table.add_row(*map(Text, row))
    console.print(table)
    if len(rows) > _MAX_ROWS:
        console.print(f"  and {counted(len(rows) - _MAX_ROWS, 'more row')}, in the report")
