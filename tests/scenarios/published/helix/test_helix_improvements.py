from typing import Any

import pytest
from support.scenarios.handover_columns import columns
from support.scenarios.made_tables import empty, made_table

from handover.scenarios.published.helix.helix_improvements import CHANGES, HelixImprovements
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.runs.campaign.table import CampaignTable

PLAN = HelixImprovements().plan(quick=False)
COLUMNS = columns(PLAN)


def table_of(closing: dict[str, float], failing: str = "") -> CampaignTable:
    """Return a run at each point: 10 mm off, or what is given for a value of a parameter; a value may fail, too."""
    rows: list[dict[str, Any]] = []
    for i, (point, plain) in enumerate(zip(PLAN.points, COLUMNS, strict=True)):
        distance = next((closing[x] for x in point.values() if x in closing), 0.01) + 1e-6 * i
        result = {"status": "done", "success": failing not in point.values(), "steps": 20, "reason": "lost ring: far"}
        rows.append({**plain, **result, "closing_distance": distance, "final_distance": 0.001})
    return made_table(rows)


def test_every_case_is_run_at_every_place_with_the_same_seeds():
    assert len({run.seed for run in PLAN.runs()}) == 16


@pytest.mark.parametrize(
    ("distance", "failing", "verdict"),
    [(0.002, "", Verdict.REPRODUCED), (0.03, "", Verdict.NOT_REPRODUCED), (0.002, "side", Verdict.NOT_REPRODUCED)],
)
def test_a_change_helps_if_the_gripper_closes_nearer_and_no_handover_is_lost(
    distance: float, failing: str, verdict: Verdict
):
    claims = HelixImprovements().claims(table_of({"side": distance}, failing))
    of_side = [c.verdict for c, change in zip(claims, CHANGES, strict=True) if "at the side" in change.what]
    assert of_side == [verdict] * 2


def test_rows_are_pairs_without_and_with_the_change():
    (table,) = HelixImprovements().tables(table_of({"side": 0.002}))
    assert len(table.rows) == len(CHANGES)
    row = next(row for row in table.rows if row[0] == "our settings" and "side" in row[1])
    assert row[3] == "16 of 16 → 16 of 16"
    before, after = (float(x) for x in row[4].split(" → "))
    assert after < 3.0 < 9.0 < before
    assert row[6] == "20 → 20"


def test_without_runs_nothing_is_claimed():
    claims = HelixImprovements().claims(empty(table_of({})))
    assert {(c.verdict, c.published) for c in claims} == {(Verdict.NOT_COMPARABLE, "suggested")}
