"""Exact tests of a paired campaign's points against each other, run by run in the same scenes."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence

from markupsafe import Markup

from handover.cosim.exceptions import counted
from handover.scenarios.runs.campaign.results import CampaignResults, PointResults
from handover.scenarios.runs.campaign.statistics import paired_test
from handover.scenarios.runs.reporting.html import Cell, rows_table
from handover.scenarios.runs.reporting.page import Section

_MAX_PAIRS = 60


def pairs_section(results: CampaignResults) -> Section | None:
    """Return exact tests of points that differ in one parameter; None if the campaign is not paired."""
    if not results.metadata.get("paired") or len(results.points) < 2:
        return None
    alike, outcomes = _alike(results), _outcomes(results)
    rows: list[tuple[str | Cell, ...]] = []
    left = _number_of_pairs(results, alike)
    for a, b, name in _pairs(results, alike):
        if len(rows) >= _MAX_PAIRS:
            break
        left -= 1
        row = _row(results, (results.points[a], results.points[b], name), outcomes[a], outcomes[b])
        if row:
            rows.append(row)
    if not rows:
        return None
    text = (
        "Pairs are runs with the same seed. p: McNemar's exact test, two-sided, not corrected for the number of tests."
    )
    if left:
        text += f" Left out: {counted(left, 'more pair')} of points."
    header = ("of", "first", "second", "pairs", "both", "only first", "only second", "neither", "p")
    table = rows_table(header, rows, numbers=range(3, 9), sortable=True)
    html = Markup("<div class='tall names'>{}</div><p class='soft'>{}</p>").format(table, text)
    return Section(anchor="pairs", title="Paired comparisons", html=html, scripts=("campaign.js",))


Alike = Mapping[tuple[str, frozenset[tuple[str, str]]], Sequence[int]]
"""Points that differ in at most one parameter, by its name and by the values that they share."""


def _alike(results: CampaignResults) -> Alike:
    alike: dict[tuple[str, frozenset[tuple[str, str]]], list[int]] = defaultdict(list)
    for k, point in enumerate(results.points):
        for key in _keys(point):
            alike[key].append(k)
    return alike


def _keys(point: PointResults) -> list[tuple[str, frozenset[tuple[str, str]]]]:
    items = frozenset(point.values.items())
    return [(name, items - {(name, value)}) for name, value in point.values.items()]


def _pairs(results: CampaignResults, alike: Alike) -> Iterator[tuple[int, int, str]]:
    """Return the pairs of points that differ in one parameter, in the order of the points, and its name."""
    points = results.points
    for a, point in enumerate(points):
        others = [(b, key[0]) for key in _keys(point) for b in alike[key] if b > a]
        yield from ((a, b, n) for b, n in sorted(others) if points[b].values[n] != point.values[n])


def _number_of_pairs(results: CampaignResults, alike: Alike) -> int:
    def pairs(n: int) -> int:
        return n * (n - 1) // 2

    number = 0
    for (name, _), members in alike.items():
        same = Counter(results.points[k].values[name] for k in members)
        number += pairs(len(members)) - sum(map(pairs, same.values()))
    return number


def _outcomes(results: CampaignResults) -> Sequence[Mapping[int, bool]]:
    """Return, for each point, success by seed of the runs done."""
    seed, success = results.table.column("seed"), results.table.column("success")
    return [{int(seed[row]): bool(success[row]) for row in point.done} for point in results.points]


def _row(
    results: CampaignResults,
    pair: tuple[PointResults, PointResults, str],
    first: Mapping[int, bool],
    second: Mapping[int, bool],
) -> tuple[str | Cell, ...] | None:
    shared = sorted(first.keys() & second.keys())
    if not shared:
        return None
    ours, theirs = [first[k] for k in shared], [second[k] for k in shared]
    test = paired_test(ours, theirs)
    both = sum(x and y for x, y in zip(ours, theirs, strict=True))
    neither = len(shared) - both - test.only_first - test.only_second
    numbers = [len(shared), both, test.only_first, test.only_second, neither]
    return (
        *_labels(results, *pair),
        *(Cell(str(n), n) for n in numbers),
        Cell(f"{test.p:.3g}", test.p),
    )


def _labels(results: CampaignResults, a: PointResults, b: PointResults, name: str) -> tuple[str, str, str]:
    """Return labels of what two points have in common, and of the value in which each differs."""
    shared = [results.value_text(n, a.values[n]) for n in results.varied if n != name and n in a.values]
    first, second = (results.value_text(name, p.values[name]) for p in (a, b))
    return ", ".join(shared) or "all", first, second
