"""Errors of the free-flyer's navigation: the plan, and how it is judged, on tables that a test makes up."""

from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.made_tables import made_table
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches

from handover.plants.free_flyer.robot.navigation import Params
from handover.scenarios.published.free_flyer.flyer_navigation import (
    DELAY,
    ESTIMATE_ERRORS,
    VARIATIONS,
    VELOCITY_BIAS,
    FlyerNavigation,
    count_probability,
    rest_probability,
)
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.robots.free_flyer.handover.person_evaluation import Cause
from handover.scenarios.runs.campaign.table import CampaignTable

Run = Mapping[str, str]


def as_models_say(given: Run, k: int) -> bool:
    """Return whether a robot signals: with a biased velocity as often as rest is seen, else always."""
    bias = given.get("navigation.velocity_bias")
    return bias is None or (k + 0.5) / 3 < rest_probability(float(bias))


def each(*_given: Any) -> bool:
    """Return that all do."""
    return True


def none(_given: Run) -> bool:
    """Return that no run fails."""
    return False


def by_position(given: Run) -> bool:
    """Return whether a run fails: where the object is fetched with a biased position, or a loop cannot bear a delay."""
    late = float(given.get("navigation.delay", 0.0))
    fetches = given["task"] == "robot_to_human" and "navigation.position_bias" in given
    return fetches or late > (0.02 if given["behaviour"] == "rigid" else 0.11)


@cache
def table_of(
    fails: Callable[[Run], bool] = by_position,
    signals: Callable[[Run, int], bool] = as_models_say,
    alone: bool = False,
    quick: bool = False,
) -> CampaignTable:
    """Return the plan's runs, of which some fail, some never signal, and, if alone, one acts with nobody there."""
    rows: list[dict[str, Any]] = []
    for number, run in enumerate(FlyerNavigation().plan(quick).runs()):
        given = run.parameters
        asks = signals(given, run.repetition)
        success = asks and not fails(given)
        row: dict[str, Any] = {"status": "done", "run": run.name, "success": success, "handed_over": float(success)}
        row |= {"task": given["task"], "behaviour": given["behaviour"], "saturated_share": 0.2}
        row |= {name: float(given[name]) if name in given else None for v in VARIATIONS for name in v.parameters}
        row |= {"phase_signal": 20.0 if asks else None, "unprovoked": int(alone and number == 99) if asks else None}
        row |= {"transfer_displacement": 0.1 if asks else None, "transfer_time": 3.0 if success else None}
        rows.append(row | {"decided_by": int(Cause.NONE if success else Cause.OUT_OF_REACH)})
    return made_table(rows)


@cache
def verdicts(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim: claim for claim in FlyerNavigation().claims(table)}


def test_the_plan_has_one_error_at_a_time_and_the_navigation_takes_every_level():
    for point in FlyerNavigation().plan(quick=False).points:
        assert len({n for n in point if n.startswith("navigation.")} - {"navigation.drift_time"}) <= 1
    for error, level in ((each, level) for each in ESTIMATE_ERRORS for level in each.levels):
        parameters = error.variation(level).parameters
        given: dict[str, Any] = {n.removeprefix("navigation."): float(x) for n, x in parameters.items()}
        Params(**given).check()
        assert given[error.parameter] == level


def test_every_claim_is_judged_both_ways_but_what_the_thesis_does_not_give():
    good = verdicts(table_of())
    bad, without = verdicts(table_of(fails=each, signals=each, alone=True)), verdicts(table_of(fails=none))
    (of_paper,) = (c for c in good.values() if not c.beyond)
    assert [c for c in good.values() if c.verdict is not Verdict.REPRODUCED] == [of_paper]
    assert of_paper.verdict is Verdict.NOT_COMPARABLE
    assert "no figure" in of_paper.reason
    for text in good.keys() - {of_paper.claim}:
        other = without if "unstable" in text else bad
        assert other[text].verdict is Verdict.NOT_REPRODUCED, text


def test_of_the_quick_plan_little_is_concluded():
    claims = verdicts(table_of(quick=True)).values()
    assert {c.verdict for c in claims} == {Verdict.NOT_COMPARABLE}
    assert {c.verdict_text for c in claims if c.beyond} == {"too few runs"}
    reported = [c.reason for c in claims if c.beyond and c.measured]
    assert reported
    assert all("Judged from" in reason or "it takes at least" in reason for reason in reported)


def test_runs_that_did_not_come_to_their_end_are_failures():
    first, second, *rest = table_of().rows
    failed = [row | {"status": "failed", "success": None, "decided_by": None} for row in (first, second)]
    claim = verdicts(made_table([*failed, *rest]))["With the assumed noise alone every handover succeeds"]
    assert (claim.verdict, claim.measured) == (Verdict.NOT_REPRODUCED, "10/12 (83 %)")
    assert "2 of 12 runs, which did not come to an end" in claim.reason


def test_a_robot_that_acted_alone_and_had_luck_is_no_success_and_no_figure():
    rows = table_of().rows
    lucky = next(row for row in rows if row["navigation.delay"] == 0.016 and row["task"] == "human_to_robot")
    lucky |= {"unprovoked": 1, "transfer_displacement": 9.0}
    (shown,) = FlyerNavigation().tables(made_table(rows))
    late = next(row for row in shown.rows if row[0] == DELAY.variation(0.016).label)
    assert (late[2][:6], late[3], late[6]) == ("5 of 6", "12 of 12", "100 and 100")


def test_a_transfer_before_a_failed_retreat_is_told_apart():
    retreats = {"handed_over": 1.0, "decided_by": int(Cause.NOT_RETREATED)}
    (shown,) = FlyerNavigation().tables(made_table(row | retreats for row in table_of(fails=each).rows))
    first = shown.rows[0]
    assert (first[1][:6], first[3], first[-1]) == ("0 of 6", "12 of 12", "not retreated")


def test_a_bias_below_the_gate_is_as_likely_as_drawn_ones_are():
    drawn = np.linalg.norm(np.random.default_rng(1).normal(0.0, 0.008, (200_000, 3)), axis=1)
    assert rest_probability(0.008) == pytest.approx(np.count_nonzero(drawn < 0.01) / len(drawn), abs=0.004)
    assert VELOCITY_BIAS.levels[0] < 0.01 < VELOCITY_BIAS.levels[-1]


def test_the_counts_test_is_the_binomial_one_for_equal_chances():
    assert count_probability(5, [0.5] * 10) == pytest.approx(1.0)
    assert count_probability(0, [0.5] * 10) == pytest.approx(2 / 1024)
    assert count_probability(3, [1.0, 1.0, 1.0]) == pytest.approx(1.0)


def test_the_table_has_a_row_for_each_variation_and_a_quick_plan_no_figure(tmp_path: Path):
    (table,) = FlyerNavigation().tables(table_of())
    assert len(table.rows) == 1 + len(VARIATIONS)
    assert table.rows[0][1].startswith("6 of 6")
    assert FlyerNavigation().draw(table_of(quick=True), tmp_path, tmp_path) == []


@pytest.mark.slow
def test_figures_are_drawn(tmp_path: Path, sketches: Sketches):
    FlyerNavigation().draw(table_of(), tmp_path, tmp_path)
    sketches.check("navigation_success", "navigation_displacement", "navigation_time")
