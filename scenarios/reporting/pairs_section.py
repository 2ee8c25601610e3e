"""A paired campaign's points against each other, run by run in the same scenes."""

import itertools
from collections.abc import Mapping

from markupsafe import Markup

from scenarios.campaign.campaign_results import CampaignResults, PointResults
from scenarios.campaign.statistics import paired_test
from scenarios.reporting.rows_table import Cell, rows_table
from scenarios.reporting.section import Section

_MOST_PAIRS = 60


def pairs_section(results: CampaignResults) -> Section | None:
    """Return exact tests of points that differ in one parameter; None if the campaign is not paired."""
    if not results.told.get("paired") or len(results.points) < 2:
        return None
    outcomes = [_outcomes(results, p) for p in results.points]
    rows: list[tuple[str | Cell, ...]] = []
    left = 0
    for a, b in itertools.combinations(range(len(results.points)), 2):
        if _difference(results.points[a], results.points[b]) is None:
            continue
        if len(rows) >= _MOST_PAIRS:
            left += 1
            continue
        row = _row(results, a, b, outcomes[a], outcomes[b])
        if row:
            rows.append(row)
    if not rows:
        return None
    told = (
        "Pairs are runs with the same seed. p: McNemar's exact test, two-sided, not corrected for the number of tests."
    )
    if left:
        told += f" {left} pairs of points more are left out."
    header = ("of", "first", "second", "pairs", "both", "only first", "only second", "neither", "p")
    table = rows_table(header, rows, numbers=range(3, 9), sortable=True)
    html = Markup("<div class='tall'>{}</div><p class='soft'>{}</p>").format(table, told)
    return Section(anchor="pairs", title="Paired comparisons", html=html, scripts=("campaign.js",))


def _difference(first: PointResults, second: PointResults) -> str | None:
    """Return the one parameter in which two points differ; None if there are more."""
    names = [n for n in first.values.keys() & second.values.keys() if first.values[n] != second.values[n]]
    return names[0] if len(names) == 1 and first.values.keys() == second.values.keys() else None


def _outcomes(results: CampaignResults, point: PointResults) -> Mapping[int, bool]:
    """Return success by seed of the runs done."""
    seed, success = results.table.column("seed"), results.table.column("success")
    return {int(seed[row]): bool(success[row]) for row in point.done}


def _row(
    results: CampaignResults, a: int, b: int, first: Mapping[int, bool], second: Mapping[int, bool]
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
        *_labels(results, results.points[a], results.points[b]),
        *(Cell(str(n), n) for n in numbers),
        Cell(f"{test.p:.2g}", test.p),
    )


def _labels(results: CampaignResults, a: PointResults, b: PointResults) -> tuple[str, str, str]:
    """Return what two points have in common, and what each has for itself."""
    name = _difference(a, b)
    shared = [results.value_text(n, a.values[n]) for n in results.varied if n != name and n in a.values]
    first, second = ("", "") if name is None else (results.value_text(name, p.values[name]) for p in (a, b))
    return ", ".join(shared) or "all", first, second
