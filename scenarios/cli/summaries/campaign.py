"""Prints the summary of a campaign: a row for each point, why runs failed, and where table and report are."""

import math
from collections import Counter
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from handover.cosim.exceptions import counted
from handover.scenarios.cli.campaign import format_progress
from handover.scenarios.cli.console import heading, open_console
from handover.scenarios.experiment.display_unit import display_unit
from handover.scenarios.runs.campaign.folder import CampaignFolder
from handover.scenarios.runs.campaign.results import CampaignResults, PointResults
from handover.scenarios.runs.campaign.table import CampaignTable
from handover.scenarios.runs.campaign.worker_pool import RunCounts

_MAX_POINTS = 12
_MAX_REASONS = 5
_COLUMN_WIDTH = 24
"""Characters that a metric's column takes; as many metrics are shown as fit the terminal."""


def campaign_data(results: CampaignResults, counts: RunCounts, folder: CampaignFolder) -> dict[str, Any]:
    """Return how the runs of each point went, as JSON can hold it; medians of metrics stand with their units."""
    points = [
        {
            "values": dict(point.values),
            "runs": len(point.rows),
            "done": len(point.done),
            "successes": point.successes,
            "interval": None if point.interval is None else [point.interval.low, point.interval.high],
            "medians": {
                name: {"value": median, "unit": results.table.unit(name)}
                for name in results.measured
                if math.isfinite(median := results.median(point, name))
            },
        }
        for point in results.points
    ]
    places = {"folder": str(folder.path), "table": str(folder.table)}
    return {"scenario": results.scenario, "counts": asdict(counts), "points": points, **places}


def print_campaign(results: CampaignResults, counts: RunCounts, folder: CampaignFolder) -> None:
    """Print how the runs of each point went, why runs failed, and where the table is."""
    console = open_console()
    console.print(f"{results.scenario}: {format_progress(counts)}", style="bold")
    console.print(_points(results, console))
    left = len(results.points) - _MAX_POINTS
    if left > 0:
        console.print(f"  and {counted(left, 'point')} more")
    print_reasons(console, results.table)
    console.print(f"table: {folder.table}", markup=False, soft_wrap=True)


def print_report_place(folder: CampaignFolder) -> None:
    """Print where the report is, if there is one."""
    if folder.is_reported:
        open_console().print(f"report: {folder.report}", markup=False, soft_wrap=True)


def _points(results: CampaignResults, console: Console) -> Table:
    varied = list(dict.fromkeys(name for point in results.points for name in point.values))
    metrics = results.headline[: max(1, (console.width - 40 - 12 * len(varied)) // _COLUMN_WIDTH)]
    rows = Table(box=None, padding=(0, 2), pad_edge=True)
    for name in (*varied, "runs", "succeeded", "95 % interval", *(f"median\n{name}" for name in metrics)):
        rows.add_column(heading(name), justify="right", overflow="fold")
    for point in results.points[:_MAX_POINTS]:
        cells = [point.values.get(name, "") for name in varied]
        medians = (_median(results, point, name) for name in metrics)
        rows.add_row(*map(Text, [*cells, str(len(point.rows)), *_successes(point), *medians]))
    return rows


def _successes(point: PointResults) -> tuple[str, str]:
    """Return the number of successes, and the Clopper-Pearson interval of their rate."""
    interval = point.interval
    if interval is None:
        return "", ""
    return f"{point.successes} of {len(point.done)}", f"{100 * interval.low:.0f} % to {100 * interval.high:.0f} %"


def _median(results: CampaignResults, point: PointResults, metric: str) -> str:
    median = results.median(point, metric)
    return "" if math.isnan(median) else display_unit(results.table.unit(metric), median).text(median)


def print_reasons(console: Console, table: CampaignTable) -> None:
    """Print why runs failed or were lost, and how many for each reason."""
    ended = zip(table.column("status").tolist(), table.column("reason").tolist(), strict=True)
    reasons = Counter((status, reason) for status, reason in ended if status != "done")
    for (status, reason), number in reasons.most_common(_MAX_REASONS):
        console.print(f"{number} {status}: {reason}", markup=False, soft_wrap=True)
    if left := max(0, len(reasons) - _MAX_REASONS):
        console.print(f"and {counted(left, 'more reason')}, in the table")
