"""A campaign's points in numbers: successes, and the median of the metrics that matter, with intervals."""

import math
from collections.abc import Mapping

from markupsafe import Markup

from handover.scenarios.campaign.campaign_results import CampaignResults, PointResults
from handover.scenarios.experiment.display_unit import ShownUnit, shown_unit
from handover.scenarios.reporting.rows_table import Cell, rows_table
from handover.scenarios.reporting.section import Section


def points_section(results: CampaignResults) -> Section | None:
    """Return the table of points; None if no run has ended."""
    points = results.points
    if not points:
        return None
    metrics = results.told_first
    units = {m: shown_unit(results.table.unit(m), results.table.column(m)) for m in metrics}
    written = _written(results)
    rows = [
        (
            *_values(results, point, written),
            str(len(point.rows)),
            *_success(point),
            *(_median(results, point, m, units[m]) for m in metrics),
        )
        for point in points
    ]
    header = (
        *(name.replace("_", " ") for name in results.varied or ("point",)),
        "runs",
        "successes",
        "rate, 95 % interval",
        *(units[m].axis(f"median {m.replace('_', ' ')}") for m in metrics),
    )
    first = len(header) - 3 - len(metrics)
    told = "Of the runs done. Intervals of success rates: Clopper and Pearson"
    told += "; of medians: bootstrap, from three values on." if results.has_intervals and metrics else "."
    table = rows_table(header, rows, numbers=range(first, len(header)), sortable=True)
    note = Markup("<p class='soft'>{}</p>").format(told)
    return Section(anchor="points", title="Points", html=table + note, scripts=("campaign.js",))


def _written(results: CampaignResults) -> Mapping[str, ShownUnit]:
    """Return in which unit the values of each varied number are written."""
    texts = {n: {p.values[n] for p in results.points if n in p.values} for n in results.varied if results.is_number(n)}
    return {name: shown_unit(results.unit(name), list(map(float, values))) for name, values in texts.items()}


def _values(results: CampaignResults, point: PointResults, written: Mapping[str, ShownUnit]) -> list[Cell]:
    cells: list[Cell] = []
    for name in results.varied:
        text = point.values.get(name)
        if text is None:
            cells.append(Cell("–"))
        elif name in written:
            cells.append(Cell(written[name].text(float(text)), float(text)))
        else:
            cells.append(Cell(text.replace("_", " ")))
    return cells or [Cell("all runs")]


def _success(point: PointResults) -> tuple[Cell, Cell]:
    span = point.interval
    if span is None:
        return Cell("–", math.nan), Cell("–", math.nan)
    told = f"{100 * point.rate:.0f} % ({100 * span.low:.0f} to {100 * span.high:.0f})"
    return Cell(f"{point.successes} of {len(point.done)}", point.successes), Cell(told, point.rate)


def _median(results: CampaignResults, point: PointResults, metric: str, unit: ShownUnit) -> Cell:
    median, span = results.median(point, metric), results.median_interval(point, metric)
    if math.isnan(median):
        return Cell("–", math.nan)
    told = f"{median * unit.factor:.4g}"
    if span is not None:
        told += f" ({_short(span.low * unit.factor)} to {_short(span.high * unit.factor)})"
    return Cell(told, median)


def _short(x: float) -> str:
    """Write a number to three digits, as long as they show all that stands before its point."""
    return f"{x:.3g}" if abs(x) < 999.5 else f"{x:.4g}"
