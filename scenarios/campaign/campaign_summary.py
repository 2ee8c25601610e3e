"""What a campaign's end prints: a row for each point, what failed, and where the rest is."""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.table import Table
from rich.text import Text

from scenarios.campaign.campaign_folder import CampaignFolder
from scenarios.campaign.campaign_progress import told_done
from scenarios.campaign.campaign_table import CampaignTable
from scenarios.campaign.plan import CampaignPlan
from scenarios.campaign.statistics import success_interval
from scenarios.campaign.tally import Tally
from scenarios.chosen import scenario_named
from scenarios.console import open_console
from scenarios.shown_unit import shown_unit

_MOST_POINTS = 12
_MOST_REASONS = 5
_COLUMN = 24
"""Characters that a metric's column takes; as many metrics are told as the terminal is wide."""


def print_campaign(plan: CampaignPlan, table: CampaignTable, tally: Tally, folder: CampaignFolder) -> None:
    """Print how the runs of each point went, why runs failed, and where table and report are."""
    console = open_console()
    console.print(f"{plan.scenario}: {told_done(tally)}", style="bold")
    console.print(_points(plan, table, console))
    left = len(plan.points) - _MOST_POINTS
    if left > 0:
        console.print(f"  and {left} points more")
    _print_reasons(console, table)
    console.print(f"table: {folder.table}", markup=False, soft_wrap=True)
    if folder.report.exists():
        console.print(f"report: {folder.report}", markup=False, soft_wrap=True)


def _points(plan: CampaignPlan, table: CampaignTable, console: Console) -> Table:
    varied = list(dict.fromkeys(name for point in plan.points for name in point))
    metrics = _headline(plan, table, max(1, (console.width - 40 - 12 * len(varied)) // _COLUMN))
    rows = Table(box=None, padding=(0, 2), pad_edge=True)
    for heading in (*varied, "runs", "succeeded", "95 % interval", *(f"median\n{name}" for name in metrics)):
        rows.add_column(Text(heading), justify="right", overflow="fold")
    for number, point in enumerate(plan.points[:_MOST_POINTS]):
        of_point = table.where(point=number)
        cells = [point.get(name, "") for name in varied]
        rows.add_row(*map(Text, [*cells, *_successes(of_point), *(_median(of_point, name) for name in metrics)]))
    return rows


def _successes(table: CampaignTable) -> list[str]:
    """Return the numbers of runs that are done and of successes, and the interval of Clopper and Pearson."""
    done = table.where(status="done").column("success")
    successes, n = int(sum(done)), len(done)
    if n == 0:
        return [str(len(table)), "", ""]
    interval = success_interval(successes, n)
    return [str(len(table)), f"{successes} of {n}", f"{100 * interval.low:.0f} % to {100 * interval.high:.0f} %"]


def _median(table: CampaignTable, metric: str) -> str:
    values = table.column(metric)
    values = values[~np.isnan(values)]
    if len(values) == 0:
        return ""
    median = float(np.median(values))
    return shown_unit(table.unit(metric), median).text(median)


def _headline(plan: CampaignPlan, table: CampaignTable, most: int) -> Sequence[str]:
    """Return the scenario's first metrics that the campaign has."""
    return [name for name in scenario_named(plan.scenario).headline if name in table.metrics][:most]


def _print_reasons(console: Console, table: CampaignTable) -> None:
    ended = zip(table.column("status").tolist(), table.column("reason").tolist(), strict=True)
    reasons = Counter((status, reason) for status, reason in ended if status != "done")
    for (status, reason), number in reasons.most_common(_MOST_REASONS):
        console.print(f"{number} {status}: {reason}", markup=False, soft_wrap=True)
    if len(reasons) > _MOST_REASONS:
        console.print(f"and {len(reasons) - _MOST_REASONS} reasons more, in the table")
