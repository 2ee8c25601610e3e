"""Tables that tests make up, as campaigns leave them, and what an experiment makes of them."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pyarrow as pa

from handover.scenarios.published.published_experiment import Claim, ComparisonTable
from handover.scenarios.runs.campaign.table import CampaignTable


def made_table(rows: Iterable[Mapping[str, Any]]) -> CampaignTable:
    """Return rows as a campaign's table; what a row does not have is missing in it."""
    rows = list(rows)
    names = dict.fromkeys(name for row in rows for name in row)
    return CampaignTable(pa.Table.from_pylist([{name: row.get(name) for name in names} for row in rows]))


def empty(table: CampaignTable) -> CampaignTable:
    """Return the table without its rows."""
    return CampaignTable(table.table.slice(0, 0))


def one(claims: Iterable[Claim], part: str) -> Claim:
    """Return the claim that has these words."""
    (found,) = (claim for claim in claims if part in claim.claim)
    return found


def text_of(tables: Sequence[ComparisonTable]) -> str:
    """Return all cells and notes, for the golden file."""
    lines: list[str] = []
    for table in tables:
        lines += [table.title, *(" | ".join(row) for row in (table.header, *table.rows)), table.note]
    return "\n".join(line.replace("\N{NO-BREAK SPACE}", " ") for line in lines if line)
