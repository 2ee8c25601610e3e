"""A comparison as data: what `comparison.json` holds, and the rows of `comparison.csv`."""

import csv
import io
import math
from collections.abc import Sequence
from typing import Any

from handover.scenarios.pages.comparison.campaigns import ComparedCampaigns, metric_tests, success_tests
from handover.scenarios.pages.comparison.entries import CampaignEntry, Difference, Entry, RunEntry
from handover.scenarios.pages.comparison.runs import MetricRow
from handover.scenarios.runs.campaign.results import PointResults
from handover.scenarios.runs.campaign.statistics import Interval


def campaigns_data(results: ComparedCampaigns, differences: Sequence[Difference]) -> dict[str, Any]:
    """Return a comparison of campaigns as JSON can hold it: settings, rates and metrics by point, tests."""
    points = [
        {
            "parameters": dict(key),
            "campaigns": {name: _point(results, point) for name, point in results.at(key).items()},
        }
        for key in results.matched
    ]
    units = {m: results.table.unit(m) for m in results.shown_metrics}
    return {
        **_common("campaigns", results.entries, differences),
        "units": units,
        "points": points,
        "tests": [*_success_data(results), *(t for m in results.shown_metrics for t in _metric_data(results, m))],
    }


def runs_data(
    entries: Sequence[RunEntry], rows: Sequence[MetricRow], differences: Sequence[Difference], curves: Sequence[str]
) -> dict[str, Any]:
    """Return a comparison of runs as JSON can hold it: settings, metrics, and the names of the curves."""
    metrics = {
        row.name: {
            "unit": row.unit,
            "description": row.description,
            "values": {name: _number(value) for name, value in row.values.items()},
        }
        for row in rows
    }
    return {**_common("runs", entries, differences), "metrics": metrics, "curves": list(curves)}


def _common(kind: str, entries: Sequence[Entry], differences: Sequence[Difference]) -> dict[str, Any]:
    names = [e.name for e in entries]
    return {
        "compared": kind,
        "scenario": entries[0].scenario,
        "entries": [{"name": e.name, "folder": str(e.folder), **_outcome(e)} for e in entries],
        "differences": [
            {"kind": d.kind, "name": d.name, "values": dict(zip(names, d.values, strict=True))} for d in differences
        ],
    }


def _outcome(entry: Entry) -> dict[str, Any]:
    if isinstance(entry, CampaignEntry):
        r = entry.results
        return {"planned": r.planned, "ended": len(r.table), "done": r.done, "succeeded": r.successes}
    return {"success": bool(entry.facts.summary["success"]), "reason": entry.facts.summary["reason"]}


def _point(results: ComparedCampaigns, point: PointResults) -> dict[str, Any]:
    metrics = {
        m: {
            "median": _number(results.median(point, m)),
            "runs": results.number_measured(point, m),
            "interval": _interval(results.median_interval(point, m)),
        }
        for m in results.shown_metrics
    }
    return {
        "ended": len(point.rows),
        "done": len(point.done),
        "successes": point.successes,
        "rate": _number(point.rate),
        "interval": _interval(point.interval),
        "metrics": metrics,
    }


def _success_data(results: ComparedCampaigns) -> list[dict[str, Any]]:
    return [
        {
            "of": "success",
            "parameters": dict(t.key),
            "first": t.first,
            "second": t.second,
            "paired": t.pairs is not None,
            "counts": {"first": list(t.counts[:2]), "second": list(t.counts[2:])},
            **({} if t.pairs is None else {"only_first": t.pairs.only_first, "only_second": t.pairs.only_second}),
            "method": t.method,
            "p": t.p,
            "p_least": t.least_p,
            "p_holm": t.corrected,
        }
        for t in success_tests(results)
    ]


def _metric_data(results: ComparedCampaigns, metric: str) -> list[dict[str, Any]]:
    return [
        {
            "of": metric,
            "parameters": dict(t.key),
            "first": t.first,
            "second": t.second,
            "paired": t.paired,
            "n": t.test.n,
            "difference": t.test.difference,
            "interval": _interval(t.test.interval),
            "method": t.test.method,
            "p": t.test.p,
            "p_least": t.least_p,
            "p_holm": t.corrected,
        }
        for t in metric_tests(results, metric)
    ]


def _interval(interval: Interval | None) -> list[float] | None:
    return None if interval is None else [interval.low, interval.high]


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None


def campaigns_csv(results: ComparedCampaigns) -> str:
    """Return the table of points as CSV, a row for each campaign at each point; metrics in SI units."""
    metrics = [f"{m}_{part}" for m in results.shown_metrics for part in ("median", "low", "high")]
    rows: list[list[Any]] = [[*results.keys, "campaign", "ended", "done", "successes", "rate", "low", "high", *metrics]]
    for key in results.matched:
        for name, point in results.at(key).items():
            values = dict(key)
            span = _interval(point.interval) or ["", ""]
            row = [*(values.get(n, "") for n in results.keys), name, len(point.rows), len(point.done), point.successes]
            row += [_cell(point.rate), *span]
            for metric in results.shown_metrics:
                ends = _interval(results.median_interval(point, metric)) or ["", ""]
                row += [_cell(results.median(point, metric)), *ends]
            rows.append(row)
    return _csv(rows)


def runs_csv(entries: Sequence[RunEntry], rows: Sequence[MetricRow]) -> str:
    """Return the metrics of runs as CSV, a row for each; in SI units."""
    names = [e.name for e in entries]
    return _csv([["metric", "unit", *names], *([r.name, r.unit, *(_cell(r.values[n]) for n in names)] for r in rows)])


def _cell(value: float) -> Any:
    return value if math.isfinite(value) else ""


def _csv(rows: Sequence[Sequence[Any]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
