from typing import Any

import pytest
from support.scenarios.handover_columns import columns
from support.scenarios.made_tables import empty, made_table

from handover.scenarios.published.helix.helix_cases import runs_by_case
from handover.scenarios.published.helix.helix_disturbances import CASES, HelixDisturbances
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.runs.campaign.table import CampaignTable

PLAN = HelixDisturbances().plan(quick=False)
COLUMNS = columns(PLAN)


def table_of(failing: frozenset[str] = frozenset(), far: float = 0.002) -> CampaignTable:
    """Return a run at each point of the plan, with the values that a campaign's table has."""
    rows: list[dict[str, Any]] = []
    for point, plain in zip(PLAN.points, COLUMNS, strict=True):
        fails = any(name in failing for name in point)
        row = {**plain, "status": "done", "success": not fails, "steps": 20, "closing_distance": 0.003}
        row |= {"reason": "lost ring: the gripper stays" if fails else "the hand let go"}
        rows.append(row | {"final_distance": 0.05 if fails else far})
    return made_table(rows)


def test_every_case_is_run_at_every_place_with_the_seeds_of_that_place():
    found = runs_by_case(HelixDisturbances(), table_of(), CASES)
    assert [len(runs) for runs in found.values()] == [4] * len(CASES)
    runs = PLAN.runs()
    assert len({(run.point % 4, run.seed) for run in runs}) == len({run.seed for run in runs}) == 4


def test_sizes_of_a_disturbance_are_rows_with_success_error_and_why_it_failed():
    (table,) = HelixDisturbances().tables(table_of(frozenset({"light"})))
    rows = {(row[0], row[1]): row[2:] for row in table.rows}
    assert len(rows) == len(CASES)
    assert rows["nothing", ""] == ["4 of 4", "3.0 (3.0)", "2.0 (2.0)", "20", ""]
    assert rows["light", "0.4 times"] == ["0 of 4", "", "", "", "lost ring (4)"]


@pytest.mark.parametrize(
    ("failing", "far", "holds"),
    [
        ("", 0.002, [True, True]),
        ("", 0.008, [True, False]),
        ("light", 0.002, [False, True]),
        ("filters", 0.002, [True, True]),  # one that is not mild
    ],
)
def test_claims_are_about_mild_disturbances(failing: str, far: float, holds: list[bool]):
    claims = HelixDisturbances().claims(table_of(frozenset({failing}), far))
    assert [c.verdict is Verdict.REPRODUCED for c in claims] == holds


def test_without_runs_nothing_is_claimed():
    claims = HelixDisturbances().claims(empty(table_of()))
    assert [c.verdict for c in claims] == [Verdict.NOT_COMPARABLE] * 2
