"""Tables of a published experiment: a row for each of its cases, cells by their headings."""

from collections.abc import Iterable, Mapping

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.scenarios.published.published_experiment import ComparisonTable
from handover.scenarios.published.runs import Count
from handover.scenarios.published.verdicts import format_interval
from handover.scenarios.runs.campaign.statistics import Statistic, success_interval


def table_of(title: str, rows: Iterable[Mapping[str, str]], note: str = "") -> ComparisonTable:
    """Return a table of rows that have the same columns: cells by their headings."""
    rows = list(rows)
    header = list(rows[0]) if rows else []
    return ComparisonTable(title=title, header=header, rows=[[row[name] for name in header] for row in rows], note=note)


def number(values: Floats, form: str = ".1f", statistic: Statistic = np.median) -> str:
    """Return a statistic of values as text; "" of none."""
    return f"{statistic(values):{form}}" if len(values) else ""


def span(values: Floats, form: str = ".1f", to: str = " to ") -> str:
    """Return the least and the greatest of values as text, or the one that both are; "" of none."""
    low, high = (number(values, form, end) for end in (np.min, np.max))
    return low if low == high else f"{low}{to}{high}"


def median_and_range(values: Floats) -> str:
    """Return the median, and the least and the greatest in brackets, as text; "" of none."""
    median, low, high = (number(values, ".1f", statistic) for statistic in (np.median, np.min, np.max))
    return f"{median} ({low} to {high})" if len(values) else ""


def of(count: Count) -> str:
    """Return a count such as `11 of 15`."""
    return f"{count[0]} of {count[1]}"


def with_interval(count: Count) -> str:
    """Return a count with the interval of its rate, such as `11/15 (45 to 92 %)`; "" of no trials."""
    if not count[1]:
        return ""
    interval = success_interval(*count)
    return f"{count[0]}/{count[1]} ({format_interval(interval.low, interval.high)})"
