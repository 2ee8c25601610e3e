"""A campaign's runs: a table of all that can be sorted and filtered, and why runs failed, grouped by reason."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from handover.cosim.exceptions import counted
from handover.scenarios.experiment.display_unit import (
    DisplayUnit,
    column_text,
    digits_after_point,
    display_unit,
)
from handover.scenarios.runs.campaign.results import CampaignResults
from handover.scenarios.runs.reporting.html import Cell, rows_table
from handover.scenarios.runs.reporting.page import Section

_MAX_ROWS = 2000
_MAX_METRICS = 6


def runs_section(results: CampaignResults, folder: Path) -> Section | None:
    """Return the table of runs, the first 2000 of them; None if no run has ended."""
    table = results.table
    if not len(table):
        return None
    metrics = results.headline[:_MAX_METRICS]
    varied = [name for name in results.varied if name in table.parameters]
    units = {n: display_unit(table.unit(n), table.column(n)) for n in (*metrics, "cpu_seconds")}
    columns = {n: table.column(n) for n in varied}
    set_to = {n: display_unit(table.unit(n), x) if x.dtype == np.float64 else None for n, x in columns.items()}
    digits = {n: digits_after_point(table.column(n) * unit.factor) for n, unit in units.items()}
    rows = [_row(results, row, set_to, units, digits, folder) for row in table.rows[:_MAX_ROWS]]
    header = (
        "run",
        *(n.replace("_", " ") for n in varied),
        "seed",
        "verdict",
        *(units[n].axis(n.replace("_", " ")) for n in metrics),
        units["cpu_seconds"].axis("CPU time"),
    )
    numbers = [len(varied) + 1, *range(len(varied) + 3, len(header))]
    left = len(table) - len(rows)
    note = f"The first {len(rows)} of {len(table)} runs; all are in runs.parquet. " if left > 0 else ""
    if not any(_page_of(name, folder) for name in table.column("run")):
        note += f"handover report {folder.name} --runs writes the pages of all runs, and links them here."
    html = Markup(
        "<div class='controls'><label>Show runs with <input type='search' data-filters='all-runs' "
        "placeholder='words, such as failed'></label>"
        "<output class='soft' data-counts='all-runs'>{}</output></div>\n"
        "<div id='all-runs' class='tall names'>{}</div><p class='soft'>{}</p>"
    ).format(counted(len(rows), "run"), rows_table(header, rows, numbers=numbers, sortable=True), note)
    return Section(anchor="runs", title="Runs", html=html, scripts=("campaign.js",))


def run_html(name: str, folder: Path) -> Markup:
    """Return a run's name, linked to its page if that is there."""
    page = _page_of(name, folder)
    return Markup("<a href='{}'>{}</a>").format(quote(page), name) if page else Markup("{}").format(name)


def _page_of(name: str, folder: Path) -> str:
    """Return where a run's page is within a campaign's folder; "" if it is not there."""
    page = f"runs/{name}/report.html"
    return page if (folder / page).exists() else ""


def _row(
    results: CampaignResults,
    row: dict[str, Any],
    set_to: Mapping[str, DisplayUnit | None],
    units: Mapping[str, DisplayUnit],
    digits: Mapping[str, int],
    folder: Path,
) -> Sequence[str | Markup | Cell]:
    return (
        run_html(row["run"], folder),
        *(_parameter(results, name, row[name], unit) for name, unit in set_to.items()),
        Cell(str(row["seed"]), row["seed"]),
        _verdict(row),
        *(_number(row[name], unit, digits[name]) for name, unit in units.items()),
    )


def _parameter(results: CampaignResults, name: str, value: Any, unit: DisplayUnit | None) -> Cell:
    if value is None:
        return Cell("–")
    if unit is not None:
        return Cell(unit.text(value), value)
    if isinstance(value, bool):
        return Cell(str(value).lower())
    return Cell(results.words(name, str(value)), value if isinstance(value, int) else None)


def _verdict(row: dict[str, Any]) -> Markup:
    if row["status"] != "done":
        kind, verdict = "bad", row["status"] if row["status"] == "lost" else "run failed"
    else:
        kind, verdict = ("good", "succeeded") if row["success"] else ("bad", "failed")
    return Markup("<span class='{}' title='{}'>{}</span>").format(kind, row["reason"] or "", verdict)


def _number(value: float | None, unit: DisplayUnit, digits: int) -> Cell:
    if value is None or not math.isfinite(value):
        return Cell("–", math.nan)
    return Cell(column_text(value * unit.factor, digits), value)


_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
_EXAMPLES = 3
_MAX_REASONS = 40


@dataclass
class _Group:
    kind: str
    reason: str
    rows: list[int] = field(default_factory=list[int])
    reasons: set[str] = field(default_factory=set[str])


def failures_section(results: CampaignResults, folder: Path) -> Section | None:
    """Return the table of reasons, most frequent first; None if all runs succeeded.

    Reasons that differ only in their numbers are one; the first run's is shown.
    """
    groups = _groups(results)
    if not groups:
        return None
    names = results.table.column("run")
    rows = [
        (
            Cell(str(len(g.rows)), len(g.rows)),
            Markup("<span class='bad brief'>{}</span>").format(g.kind),
            Markup("<div class='prose'>{}</div>").format(g.reason),
            Markup("<span class='examples'>{}</span>").format(
                Markup(", ").join(run_html(str(names[row]), folder) for row in g.rows[:_EXAMPLES])
            ),
        )
        for g in groups[:_MAX_REASONS]
    ]
    left = len(groups) - _MAX_REASONS
    line = Markup("<p class='soft'>{}, of fewer runs each.</p>")
    more = line.format(counted(left, "more reason")) if left > 0 else Markup()
    merged = any(len(g.reasons) > 1 for g in groups[:_MAX_REASONS])
    same = Markup("<p class='soft'>Runs whose reasons differ only in numbers are in one row, with the first one's.</p>")
    table = rows_table(("runs", "how", "reason, such as", "examples"), rows, numbers=(0,), cards=True)
    return Section(anchor="failures", title="Failures", html=table + (same if merged else Markup()) + more)


def _groups(results: CampaignResults) -> Sequence[_Group]:
    status, success, reasons = (results.table.column(n) for n in ("status", "success", "reason"))
    groups: dict[tuple[str, str], _Group] = {}
    for row, (state, succeeded, reason) in enumerate(zip(status, success, reasons, strict=True)):
        if succeeded is True:
            continue
        kind = "task failed" if state == "done" else f"run {state}"
        pattern = _NUMBER.sub("#", reason or "")
        group = groups.setdefault((kind, pattern), _Group(kind, reason or "no reason given"))
        group.rows.append(row)
        group.reasons.add(reason or "")
    return sorted(groups.values(), key=lambda g: -len(g.rows))
