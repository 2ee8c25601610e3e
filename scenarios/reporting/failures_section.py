"""Why runs of a campaign did not succeed, grouped by reason."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from markupsafe import Markup

from handover.scenarios.campaign.campaign_results import CampaignResults
from handover.scenarios.reporting.rows_table import Cell, rows_table
from handover.scenarios.reporting.runs_section import run_html
from handover.scenarios.reporting.section import Section

_NUMBER = re.compile(r"(?<![\w.])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\w])")
_EXAMPLES = 3
_MOST_REASONS = 40


@dataclass
class _Group:
    kind: str
    told: str
    rows: list[int] = field(default_factory=list[int])


def failures_section(results: CampaignResults, folder: Path) -> Section | None:
    """Return the table of reasons, most frequent first; None if all runs succeeded.

    Reasons that differ but in their numbers are one; the first run's is told.
    """
    groups = _groups(results)
    if not groups:
        return None
    names = results.table.column("run")
    rows = [
        (
            Cell(str(len(g.rows)), len(g.rows)),
            Markup("<span class='bad brief'>{}</span>").format(g.kind),
            Markup("<div class='prose'>{}</div>").format(g.told),
            Markup("<span class='examples'>{}</span>").format(
                Markup(", ").join(run_html(str(names[row]), folder) for row in g.rows[:_EXAMPLES])
            ),
        )
        for g in groups[:_MOST_REASONS]
    ]
    left = len(groups) - _MOST_REASONS
    more = Markup("<p class='soft'>{} reasons more, of fewer runs each.</p>").format(left) if left > 0 else Markup()
    table = rows_table(("runs", "how", "reason, such as", "examples"), rows, numbers=(0,), cards=True)
    return Section(anchor="failures", title="Failures", html=table + more)


def _groups(results: CampaignResults) -> Sequence[_Group]:
    status, success, reasons = (results.table.column(n) for n in ("status", "success", "reason"))
    groups: dict[tuple[str, str], _Group] = {}
    for row, (state, fine, reason) in enumerate(zip(status, success, reasons, strict=True)):
        if fine is True:
            continue
        kind = "task failed" if state == "done" else f"run {state}"
        same = _NUMBER.sub("#", reason or "")
        groups.setdefault((kind, same), _Group(kind, reason or "no reason told")).rows.append(row)
    return sorted(groups.values(), key=lambda g: -len(g.rows))
