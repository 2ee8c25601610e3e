"""The experiment `vsl-1`: its plan, and how claims and tables are judged, on tables that a test makes up."""

import re
from collections.abc import Callable, Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.made_tables import made_table, text_of
from support.wording import Wording

from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.vsl.separation import MIN_RUNS, Comparison, p_value_of_separation, separation_claim
from handover.scenarios.published.vsl.vsl_1 import Vsl1, Vsl1Runs, cell
from handover.scenarios.runs.campaign.table import CampaignTable


def usual(given: Mapping[str, str]) -> float:
    """Error that grows with the load and falls with pressure, m."""
    if given["links"] == "rigid":
        return 0.004 + 0.01 * float(given["load"])
    return (0.02 + 0.1 * float(given["load"])) / (0.5 + 1e-5 * float(given["pressure"]))


def table_of(
    error: Callable[[Mapping[str, str]], float] = usual, quick: bool = False, far: float = 2.0, **same: Any
) -> CampaignTable:
    """Return the plan's runs with made-up errors, 0.01 mm apart; far from the base `far` times those near."""
    rows: list[dict[str, Any]] = []
    for run in Vsl1().plan(quick).runs():
        given, size = run.parameters, error(run.parameters) + 1e-5 * run.repetition
        row: dict[str, Any] = {"run": run.name, "status": "done", "path": given["path"], "links": given["links"]}
        row |= {"load": float(given["load"]), "pressure": float(given["pressure"]) if "pressure" in given else None}
        spread = given["path"] != "linear"
        row |= {"error_near": size if spread else None, "error_far": far * size if spread else None}
        rows.append(row | {"mean_error": size, "servo_error": 0.001, "path_time": 8.0} | same)
    return made_table(rows)


def claims_of(table: CampaignTable) -> dict[str, Claim]:
    return {claim.claim.split(":")[-1].strip(): claim for claim in Vsl1().claims(table)}


SOFT_LOAD = "On soft links the tip's error grows with the load."
PRESSURE = "The lower the pressure, the larger the tip's error."


def test_a_claim_is_judged_in_every_cell():
    claims = claims_of(table_of())
    assert claims[SOFT_LOAD].measured.startswith("48 of 48")
    assert claims["the arm yields a little."].measured.startswith("12 of 12")
    assert claims["on the curve, too."].verdict_text == "holds"
    assert claims["on the square."].measured.startswith("25 of 25")
    assert claims["on the curve, too."].beyond

    def one_cell(given: Mapping[str, str]) -> float:
        odd = given == cell("square", "50 g", "1 bar")
        return usual(given) - (0.01 if odd else 0.0)

    broken = claims_of(table_of(one_cell, far=0.5))
    assert broken[SOFT_LOAD].measured.startswith("47 of 48")
    assert re.search(r"It fails at: square, 1 bar, 25 g to 50 g \(-\d+\.\d\d mm\)\.", broken[SOFT_LOAD].reason)
    assert broken["on the curve, too."].verdict is Verdict.NOT_REPRODUCED
    assert broken["on the square."].verdict is Verdict.NOT_COMPARABLE


def test_what_the_arm_was_made_for_is_not_comparable_and_still_counted(wording: Wording):
    claims = claims_of(table_of())
    without = [c for c in claims.values() if c.verdict is Verdict.NOT_COMPARABLE]
    wording.check("\n".join(c.claim for c in without))
    assert all("so agreement proves nothing" in c.reason for c in without)
    assert claims[PRESSURE].measured.startswith("45 of 45")
    stiff = claims_of(table_of(lambda given: 0.02 + 0.1 * float(given["load"])))
    assert stiff[PRESSURE].measured.startswith("0 of 45")


@pytest.mark.parametrize("same", [{"status": "failed"}, {"path_time": None}])
def test_without_any_run_that_completed_the_path_there_are_no_verdicts_and_no_failure(
    same: Mapping[str, Any], tmp_path: Path
):
    table = table_of(**same)
    assert {c.verdict for c in Vsl1().claims(table)} == {Verdict.NOT_COMPARABLE}
    assert "375 runs that did not complete the path" in Vsl1().tables(table)[0].note
    assert not Vsl1().draw(table, tmp_path, tmp_path)


def test_of_the_quick_plan_nothing_is_concluded():
    claims = Vsl1().claims(table_of(quick=True))
    assert {c.verdict for c in claims} == {Verdict.NOT_COMPARABLE}
    assert "at least 4" in claims[0].reason


def test_tables_have_a_cell_for_each_of_the_figures(wording: Wording):
    linear, curve, square, reach = Vsl1().tables(table_of())
    assert [len(t.rows) for t in (linear, curve, square, reach)] == [5, 5, 5, 10]
    wording.check(text_of([linear]))
    assert reach.rows[0][:2] == ["square, 0 g", "4.0 to 8.0"]


def test_a_cells_runs_are_its_own():
    runs = Vsl1Runs(table_of())
    cells = product(("curve", "square"), runs.loads, runs.arms)
    names = [name for of_cell in cells for name in runs.done.of(cell(*of_cell)).names]
    assert len(set(names)) == len(names) == 2 * 5 * 5 * 5


def test_groups_that_overlap_do_not_hold_and_few_runs_decide_nothing():
    assert p_value_of_separation(5) == pytest.approx(2 / 252)
    assert p_value_of_separation(MIN_RUNS) < 0.05 < p_value_of_separation(MIN_RUNS - 1)
    low, high = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([4.5, 6.0, 7.0, 8.0, 9.0])
    assert not Comparison("overlapping", low, high).holds
    assert Comparison("apart", low, high + 1.0).margin == pytest.approx(0.5)
    apart = Comparison("apart", low[:3], high[:3] + 1.0)
    assert separation_claim("c", "", "", [apart]).verdict is Verdict.NOT_COMPARABLE
    none = Comparison("none", np.zeros(0), high)
    assert separation_claim("c", "", "", [apart, none]).measured == ""


def test_errors_of_the_same_runs_are_compared_run_by_run_without_a_p_value():
    less, more = np.array([1.0, 2.0, 3.0, 4.0, 5.0]), np.array([1.5, 2.5, 3.5, 4.5, 5.5])
    pairs, groups = Comparison("pairs", less, more, paired=True), Comparison("groups", less, more)
    assert pairs.margin == pytest.approx(0.5)
    assert (pairs.holds, groups.holds) == (True, False)
    assert not Comparison("pairs", less, more[::-1], paired=True).holds
    claim = separation_claim("c", "", "", [pairs])
    assert claim.verdict is Verdict.REPRODUCED
    assert "p =" not in claim.reason
    assert "p = 0.00" in separation_claim("c", "", "", [groups]).reason
    few = Comparison("pairs", less[:3], more[:3], paired=True)
    assert separation_claim("c", "", "", [few]).verdict is Verdict.NOT_COMPARABLE
