"""Campaigns beside each other: their points matched by the values of their parameters, and tests at each point."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, count
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from handover.cosim.exceptions import counted, nearest
from handover.scenarios.pages.campaign_report.point_layout import PointLayout, layout_of, list_layout
from handover.scenarios.pages.comparison.entries import CampaignEntry, NotComparable, full_parameters
from handover.scenarios.runs.campaign.folder import PARAMETER_UNITS
from handover.scenarios.runs.campaign.results import CampaignResults, PointResults
from handover.scenarios.runs.campaign.statistics import (
    LEVEL,
    DifferenceTest,
    PairedTest,
    holm,
    least_p_of_pairs,
    paired_difference,
    paired_test,
    two_proportions,
    unpaired_difference,
)
from handover.scenarios.runs.campaign.table import CampaignTable

ENTRY = "in campaign"
"""The parameter, in the table of all, that tells the campaigns apart; no parameter has a name with a space."""

MAX_TESTS = 100
"""Tests of a metric: the interval of each takes some 20 ms."""

_MAX_METRICS = 4

Key = tuple[tuple[str, str], ...]
"""Names and values by which points are matched."""

EVERY: Key = ()
"""Stands for all points at once, where there are several."""


class ComparedCampaigns(CampaignResults):
    """The runs of several campaigns as those of one, whose points are told apart by the campaign, too.

    Attributes:
        entries: the campaigns.
        keys: the parameters by which points are matched: those that vary within any campaign.
        matched: the points, by these parameters' values; one that a campaign leaves at its default counts with that.
        tested: tests that were made, by metric.

    Args:
        entries: the campaigns.
        chosen: metrics that are shown; by default the first of the headline.

    Raises:
        NotComparable: a campaign shares no point with another, a metric has another unit than elsewhere, or a chosen
            metric is in none of them.
    """

    def __init__(self, entries: Sequence[CampaignEntry], chosen: Sequence[str] = ()) -> None:
        self.entries = entries
        self.keys = tuple(dict.fromkeys(name for e in entries for name in e.results.varied))
        by_entry = [self._points_of(e) for e in entries]
        faults = _faults_of_points(entries, by_entry) + _faults_of_metrics(entries, chosen)
        if faults:
            raise NotComparable(faults)
        self._chosen = tuple(dict.fromkeys(chosen))
        self.tested: dict[str, list[MetricTest]] = {}
        self.matched: Sequence[Key] = tuple(dict.fromkeys(key for points in by_entry for key in points))
        pairs = [(key, k) for key in self.matched for k, points in enumerate(by_entry) if key in points]
        numbers = {pair: number for number, pair in enumerate(pairs)}
        metadata: dict[str, Any] = {
            "scenario": entries[0].scenario,
            "source": entries[0].metadata.get("source", {}),
            "headline": entries[0].metadata.get("headline", []),
            "points": [{**dict(key), ENTRY: entries[k].name} for key, k in pairs],
            "fixed": {},
            "repetitions": 1,
            PARAMETER_UNITS: {n: u for e in entries for n, u in e.metadata.get(PARAMETER_UNITS, {}).items()},
        }
        super().__init__(metadata, _merged(entries, [_numbers(by_entry[k], k, numbers) for k in range(len(entries))]))

    def _points_of(self, entry: CampaignEntry) -> dict[Key, list[int]]:
        """Return the numbers of a campaign's points by the values that tell points apart."""
        points: dict[Key, list[int]] = {}
        for number, values in enumerate(entry.metadata["points"]):
            full = full_parameters(entry.results, {**entry.metadata["fixed"], **values})
            key = tuple((name, full[name]) for name in self.keys if name in full)
            points.setdefault(key, []).append(number)
        return points

    @property
    def shown_metrics(self) -> tuple[str, ...]:
        """Metrics that tables and figures of points show: those chosen, else the first of the headline, or of all."""
        return self._chosen or super().shown_metrics or self.measured[:_MAX_METRICS]

    def words(self, parameter: str, text: str) -> str:
        """Return a value that is not a number as one reads it; a campaign's name as it was given."""
        return text if parameter == ENTRY else super().words(parameter, text)

    def at(self, key: Key) -> Mapping[str, PointResults]:
        """Return the results of a matched point by the campaign's name; those without a run that has ended lack."""
        return self._by_key.get(key, {})

    @cached_property
    def _by_key(self) -> Mapping[Key, Mapping[str, PointResults]]:
        by_key: dict[Key, dict[str, PointResults]] = {}
        for point in self.points:
            by_key.setdefault(_key_of(point), {})[point.values[ENTRY]] = point
        return by_key

    def label_of(self, key: Key) -> str:
        """Return what a matched point is called."""
        return ", ".join(self.named_value(name, text) for name, text in key) or "all runs"

    @property
    def layout(self) -> PointLayout:
        """The points along an axis, the campaigns beside each other at each, told apart by colour."""
        if len(self.matched) == 1:
            return replace(layout_of(self), title="")
        base, order = self._without_entries()
        layout = layout_of(base)
        if len(layout.group_names) > 1:
            layout = list_layout(base)
        names = [e.name for e in self.entries]
        room = layout.room / len(names)
        groups = [names.index(p.values[ENTRY]) for p in self.points]
        sign = -1.0 if layout.listed else 1.0
        shift = np.array([sign * (g - (len(names) - 1) / 2) * room for g in groups])
        return replace(layout, places=layout.places[order] + shift, room=room, groups=groups, group_names=names)

    def _without_entries(self) -> tuple[CampaignResults, list[int]]:
        """Return the matched points as those of one campaign without metrics, and which of them each point is."""
        keys = [_key_of(p) for p in self.points]
        present = list(dict.fromkeys(keys))
        n = len(present)
        table: Any = pa.table({"point": list(range(n)), "status": ["done"] * n, "success": [True] * n})
        return CampaignResults({**self.metadata, "points": [dict(key) for key in present]}, CampaignTable(table)), [
            present.index(key) for key in keys
        ]


def _key_of(point: PointResults) -> Key:
    return tuple((name, text) for name, text in point.values.items() if name != ENTRY)


def _numbers(points: Mapping[Key, Sequence[int]], entry: int, numbers: Mapping[tuple[Key, int], int]) -> dict[int, int]:
    """Return the number in the table of all of each of a campaign's points."""
    return {own: numbers[key, entry] for key, owns in points.items() for own in owns}


def _faults_of_points(entries: Sequence[CampaignEntry], by_entry: Sequence[Mapping[Key, Any]]) -> list[str]:
    faults: list[str] = []
    for k, entry in enumerate(entries):
        others = dict.fromkeys(key for j, points in enumerate(by_entry) for key in points if j != k)
        if not others.keys() & by_entry[k].keys():
            own, theirs = _values(by_entry[k]), _values(others)
            apart = [n for n in {**own, **theirs} if not own.get(n, {}).keys() & theirs.get(n, {}).keys()]
            why = [f"{n} is {_list(own.get(n, {}))} in it, {_list(theirs.get(n, {}))} in others" for n in apart]
            text = "; ".join(why) or "the values of its parameters are combined otherwise"
            faults.append(f"{entry.folder}: none of its points is in another campaign: {text}")
    return faults


def _values(keys: Iterable[Key]) -> dict[str, dict[str, None]]:
    values: dict[str, dict[str, None]] = {}
    for key in keys:
        for name, text in key:
            values.setdefault(name, {})[text] = None
    return values


def _list(texts: Iterable[str]) -> str:
    shown = list(texts)
    return ", ".join(shown[:4]) + (", ..." if len(shown) > 4 else "") if shown else "not given"


def _faults_of_metrics(entries: Sequence[CampaignEntry], chosen: Sequence[str]) -> list[str]:
    faults: list[str] = []
    units: dict[str, tuple[str, Path]] = {}
    for entry in entries:
        for name in _metrics(entry):
            unit = entry.results.table.unit(_column(entry, name))
            first = units.setdefault(name, (unit, entry.folder))
            if first[0] != unit:
                faults.append(f"{entry.folder}: its metric {name} is in {unit}, in {first[1]} in {first[0]}")
    return faults + [f"no campaign has a metric {n!r}; {nearest(n, units)}" for n in chosen if n not in units]


def _metrics(entry: CampaignEntry) -> list[str]:
    """Return the names of a campaign's metrics, without what tells their columns from those of parameters."""
    columns = entry.results.table.metrics
    bare = [c.removesuffix("_metric") for c in columns]
    return [c if n != c and n in columns else n for c, n in zip(columns, bare, strict=True)]


def _column(entry: CampaignEntry, metric: str) -> str:
    columns = entry.results.table.metrics
    return metric if metric in columns else f"{metric}_metric"


_KEPT = {
    **dict.fromkeys(("repetition", "seed"), pa.int64()),
    **dict.fromkeys(("status", "reason"), pa.string()),
    "success": pa.bool_(),
}


def _merged(entries: Sequence[CampaignEntry], numbers: Sequence[Mapping[int, int]]) -> CampaignTable:
    """Return the runs of all campaigns in one table, by the points' new numbers; a metric that one lacks is null."""
    parts = [_renumbered(e, of_points) for e, of_points in zip(entries, numbers, strict=True)]
    arrow: Any = pa  # whose stubs do not know the option
    return CampaignTable(arrow.concat_tables(parts, promote_options="permissive"))


def _renumbered(entry: CampaignEntry, numbers: Mapping[int, int]) -> Any:
    """Return a campaign's runs, named with the campaign, with their points' new numbers and metrics' own names.

    Columns have one type, whatever the table has: two that differ, as integers and floats, are not always merged.
    """
    table: Any = entry.results.table.table
    metrics = _metrics(entry)
    part = table.select([*_KEPT, *(_column(entry, name) for name in metrics)]).rename_columns([*_KEPT, *metrics])
    kinds = {**_KEPT, **dict.fromkeys(metrics, pa.float64())}
    schema = pa.schema([part.schema.field(name).with_type(kind) for name, kind in kinds.items()])
    part = part.cast(schema, safe=False) if len(part) else schema.empty_table()  # of which no type was checked
    runs = pa.array([f"{entry.name}: {run}" for run in table.column("run").to_pylist()], pa.string())
    points = pa.array([numbers.get(k, -1) for k in table.column("point").to_pylist()], pa.int64())
    return part.append_column("run", runs).append_column("point", points)


@dataclass(frozen=True, kw_only=True)
class SuccessTest:
    """Whether one campaign succeeds more often than another at a point.

    Attributes:
        key: the point.
        first, second: names of the campaigns.
        counts: successes and runs done of the first, then of the second; of the pairs, where there are any.
        pairs: the runs with shared seeds, by McNemar's exact test; None where none are, and Fisher's test is taken.
        p, corrected: of the test, and by Holm's method for the number of such tests.
    """

    key: Key
    first: str
    second: str
    counts: tuple[int, int, int, int]
    pairs: PairedTest | None
    p: float
    corrected: float = 1.0

    @property
    def method(self) -> str:
        """The test's name."""
        return "Fisher" if self.pairs is None else "McNemar"

    @property
    def paired(self) -> bool:
        """Whether the runs have shared seeds, and the test is of these pairs."""
        return self.pairs is not None

    @property
    def n(self) -> int:
        """Pairs, or runs of the campaign that has fewer."""
        return min(self.counts[1], self.counts[3])

    @property
    def least_p(self) -> float:
        """Below which p cannot fall with so many runs, however they end."""
        _, n, _, others = self.counts
        return least_p_of_pairs(n) if self.paired else two_proportions(n, n, 0, others)

    @property
    def all_alike(self) -> bool:
        """Whether all runs of both campaigns have succeeded, or none, so that only their metrics can differ."""
        succeeded, n, others_succeeded, others = self.counts
        return succeeded + others_succeeded in (0, n + others)


@dataclass(frozen=True, kw_only=True)
class MetricTest:
    """In what a metric differs between two campaigns at a point, and by which test; see `SuccessTest`.

    Attributes:
        paired: whether the runs have shared seeds, and the test is of these pairs.
        runs: pairs, or runs done of the campaign that has fewer, whether they have a value or not.
    """

    key: Key
    first: str
    second: str
    metric: str
    test: DifferenceTest
    paired: bool
    runs: int
    corrected: float = 1.0

    @property
    def n(self) -> int:
        """Pairs, or values of the campaign that has fewer."""
        return self.test.n

    @property
    def least_p(self) -> float:
        """Below which p cannot fall with so many values."""
        return self.test.least_p


def bounds_of_p(tests: Iterable[SuccessTest | MetricTest]) -> list[str]:
    """Return a sentence for each number of runs that cannot show a difference, as p cannot fall below LEVEL."""
    too_few = {(t.paired, t.n, t.least_p) for t in tests if t.least_p >= LEVEL}
    enough = next(n for n in count(1) if least_p_of_pairs(n) < LEVEL)
    sentences: list[str] = []
    for paired, n, least in sorted(too_few, reverse=True):
        of = counted(n, "pair") if paired else f"{counted(n, 'run')} each"
        more = f"{enough} pairs" if paired else "more runs"
        sentences.append(f"With {of} p cannot fall below {least:.3g}; with {more} it can be less than {LEVEL}.")
    return sentences


def remarks_on_metrics(results: ComparedCampaigns) -> list[str]:
    """Return what a difference of pairs is, if there are any, and which metrics are not tested and why."""
    tests = {m: metric_tests(results, m) for m in results.shown_metrics}
    remarks = [f"{m} is not tested{why}" for m, found in tests.items() if (why := _why_untested(results, m, found))]
    if any(t.paired for found in tests.values() for t in found):
        remarks.append(
            "A difference of pairs is the median of their differences. It can have another sign than the difference of "
            "the medians."
        )
    return remarks


def _why_untested(results: ComparedCampaigns, metric: str, tests: Sequence[MetricTest]) -> str:
    """Return where campaigns are not tested against each other, and which of them lack the metric; "" if nowhere."""
    tested = {(t.key, t.first, t.second) for t in tests}
    cases = [c for c in _pairs_of_campaigns(results)[:MAX_TESTS] if c[0] != EVERY or len(results.matched) == 1]
    missing = [c for c in cases if c not in tested]
    if not missing:
        return ""
    where = f" at {counted(len(missing), 'point')}" if tested else ""
    lack = {n for key, *names in missing for n in names if not results.number_measured(results.at(key)[n], metric)}
    who = " and ".join(e.name for e in results.entries if e.name in lack)
    return (
        f"{where}: {who} {'have' if len(lack) > 1 else 'has'} no value of it" if lack else f"{where}: no pair has both"
    )


def success_tests(results: ComparedCampaigns) -> list[SuccessTest]:
    """Return tests of successes of each two campaigns: paired where they share seeds.

    The first are over all points at once, where there are several with pairs; the others are at each that both have.
    """
    success = results.table.column("success")
    tests: list[SuccessTest] = []
    for key, first, second in _pairs_of_campaigns(results):
        rows = _pairs_at(results, key, first, second)
        if rows:
            ours, theirs = ([bool(success[pair[k]]) for pair in rows] for k in (0, 1))
            test = paired_test(ours, theirs)
            counts = (sum(ours), len(rows), sum(theirs), len(rows))
            p = test.p
        else:
            a, b = results.at(key)[first], results.at(key)[second]
            test, counts = None, (a.successes, len(a.done), b.successes, len(b.done))
            p = two_proportions(*counts)
        tests.append(SuccessTest(key=key, first=first, second=second, counts=counts, pairs=test, p=p))
    corrected = holm([t.p for t in tests])
    return [replace(t, corrected=p) for t, p in zip(tests, corrected, strict=True)]


def metric_tests(results: ComparedCampaigns, metric: str) -> list[MetricTest]:
    """Return tests of a metric, likewise, over the runs done; at the first points, where there are very many."""
    if metric not in results.tested:
        results.tested[metric] = _metric_tests(results, metric)
    return results.tested[metric]


def _metric_tests(results: ComparedCampaigns, metric: str) -> list[MetricTest]:
    values = results.table.column(metric)
    tests: list[MetricTest] = []
    for key, first, second in _pairs_of_campaigns(results)[:MAX_TESTS]:
        rows = _pairs_at(results, key, first, second)
        if rows:
            test = paired_difference(*(values[[pair[k] for pair in rows]] for k in (0, 1)))
        else:
            a, b = results.at(key)[first], results.at(key)[second]
            test = unpaired_difference(values[a.done], values[b.done])
        if test is not None:
            runs = len(rows) or min(len(results.at(key)[name].done) for name in (first, second))
            tests.append(
                MetricTest(key=key, first=first, second=second, metric=metric, test=test, paired=bool(rows), runs=runs)
            )
    corrected = holm([t.test.p for t in tests])
    return [replace(t, corrected=p) for t, p in zip(tests, corrected, strict=True)]


def _pairs_of_campaigns(results: ComparedCampaigns) -> list[tuple[Key, str, str]]:
    """Return the points with each two campaigns that have done runs there, in the campaigns' order; first EVERY."""
    pairs: list[tuple[Key, str, str]] = []
    for first, second in combinations([e.name for e in results.entries], 2):
        if sum(bool(_pairs_at(results, key, first, second)) for key in results.matched) > 1:
            pairs.append((EVERY, first, second))
    for key in results.matched:
        here = results.at(key)
        names = [e.name for e in results.entries if e.name in here and len(here[e.name].done)]
        pairs += [(key, first, second) for first, second in combinations(names, 2)]
    return pairs


def _pairs_at(results: ComparedCampaigns, key: Key, first: str, second: str) -> list[tuple[int, int]]:
    """Return the rows of runs with shared seeds at a point, or at EVERY point."""
    every = key == EVERY and len(results.matched) > 1
    found: list[tuple[int, int]] = []
    for at in results.matched if every else (key,):
        here = results.at(at)
        if first in here and second in here:
            found += _shared_rows(results, here[first], here[second])
    return found


def _shared_rows(results: ComparedCampaigns, a: PointResults, b: PointResults) -> list[tuple[int, int]]:
    """Return the rows of runs done with the same seed; none where a seed is there twice, as in merged points."""
    seed = results.table.column("seed")
    ours, theirs = ({int(seed[row]): int(row) for row in point.done} for point in (a, b))
    if len(ours) < len(a.done) or len(theirs) < len(b.done):
        return []
    return [(ours[s], theirs[s]) for s in sorted(ours.keys() & theirs.keys())]
