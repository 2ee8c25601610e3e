from typing import Any

import pyarrow as pa
import pytest
from support.scenarios.handover_columns import columns

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_cases import rows_by_case
from handover.scenarios.published.helix.helix_disturbances import CASES, HelixDisturbances
from handover.scenarios.published.published_experiment import Verdict

PLAN = HelixDisturbances().plan(quick=False)
COLUMNS = columns(PLAN)


def table_of(failing: frozenset[str] = frozenset(), far: float = 0.002) -> CampaignTable:
    """Return a run at each point of the plan, with the values that a campaign's table has."""
    rows: list[dict[str, Any]] = []
    for point, plain in zip(PLAN.points, COLUMNS, strict=True):
        fails = any(name in failing for name in point)
        rows.append(
            {**plain, "status": "done", "success": not fails, "final_distance": 0.05 if fails else far, "steps": 20}
            | {"closing_distance": 0.003}
            | {"reason": "lost ring: the gripper stays" if fails else "the hand let go"}
        )
    return CampaignTable(pa.Table.from_pylist(rows))


def test_every_case_is_run_at_every_place_with_the_seeds_of_that_place():
    assert PLAN.size == len(CASES) * 4
    assert {len(rows) for rows in rows_by_case(table_of(), CASES).values()} == {4}
    runs = PLAN.runs()
    assert len({(run.point % 4, run.seed) for run in runs}) == len({run.seed for run in runs}) == 4


def test_sizes_of_a_disturbance_are_rows_with_success_error_and_why_it_failed():
    (table,) = HelixDisturbances().tables(table_of(frozenset({"light"})))
    rows = {(row[0], row[1]): row[2:] for row in table.rows}
    assert len(rows) == len(CASES)
    assert rows["nothing", ""] == ["4 of 4", "3.0 (3.0)", "2.0 (2.0)", "20", ""]
    assert rows["light", "0.4 times"] == ["0 of 4", "", "", "", "lost ring (4)"]


@pytest.mark.parametrize(
    ("failing", "far", "verdicts"),
    [
        (frozenset[str](), 0.002, [Verdict.REPRODUCED, Verdict.REPRODUCED]),
        (frozenset[str](), 0.008, [Verdict.REPRODUCED, Verdict.NOT_REPRODUCED]),
        (frozenset({"light"}), 0.002, [Verdict.NOT_REPRODUCED, Verdict.REPRODUCED]),
        (frozenset({"filters"}), 0.002, [Verdict.REPRODUCED, Verdict.REPRODUCED]),
    ],
    ids=["all near", "far", "a mild one fails", "one that is not mild fails"],
)
def test_claims_are_about_mild_disturbances(failing: frozenset[str], far: float, verdicts: list[Verdict]):
    assert [c.verdict for c in HelixDisturbances().claims(table_of(failing, far))] == verdicts


def test_without_runs_nothing_is_claimed():
    claims = HelixDisturbances().claims(CampaignTable(table_of().table.slice(0, 0)))
    assert [c.verdict for c in claims] == [Verdict.NOT_COMPARABLE] * 2
