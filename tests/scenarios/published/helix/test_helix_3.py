"""The use case's plan, and how its claims and table are judged, on tables that a test makes up."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_3 import Helix3
from handover.scenarios.published.published_experiment import Verdict


def table_of(failed: int = 0) -> CampaignTable:
    """Return the plan's runs, the first so many of the thesis's failed."""
    rows: list[dict[str, Any]] = []
    for run in Helix3().plan(quick=False).runs():
        tuning, k = dict(run.parameters)["tuning"], len(rows)
        fails = k < failed
        rows.append(
            {"tuning": tuning, "place": dict(run.parameters)["place"], "status": "done", "success": not fails}
            | {"reason": "the ball missed the bowl by 0.010 m: it fell" if fails else "the ball rests in the bowl"}
            | {"arm_time": 40.0 + k, "carry_time": 50.0, "task_time": 110.0, "run": f"{k:03}"}
            | {"drop_offset": 0.01 + 1e-4 * k}
        )
    return CampaignTable(pa.Table.from_pylist(rows))


def test_the_plan_has_the_thesis_s_eight_runs_and_as_many_of_ours():
    plan = Helix3().plan(quick=False)
    assert plan.size == 16
    thesis = [point for point in plan.points if point["tuning"] == "thesis"]
    assert [point["alpha"] for point in thesis] == ["0.1"] * 4
    assert {point["control_period"] for point in thesis} == {"1.38"}
    assert Helix3().plan(quick=True).size == 2


@pytest.mark.parametrize(("failed", "verdict"), [(0, Verdict.REPRODUCED), (1, Verdict.NOT_REPRODUCED)])
def test_the_thesis_s_success_is_reproduced_if_every_ball_gets_into_the_bowl(failed: int, verdict: Verdict):
    first = Helix3().claims(table_of(failed))[0]
    claims = Helix3().claims(table_of(failed))
    assert [c.beyond for c in claims] == [False, True]
    assert first.verdict is verdict
    assert first.published == "8/8 (100 %)"
    assert first.measured == f"{8 - failed}/8 ({88 if failed else 100} %)"


def test_the_table_says_why_runs_failed():
    (table,) = Helix3().tables(table_of(failed=2))
    rows = {row[0]: row[1:] for row in table.rows}
    assert rows["published"][0] == "8 of 8"
    assert rows["the thesis's settings"][0] == "6 of 8"
    assert rows["the thesis's settings"][-1] == "the ball missed the bowl by 0.010 m (2)"
    assert rows["our settings"][-1] == ""


def test_without_records_there_is_nothing_to_draw(tmp_path: Path):
    assert Helix3().draw(table_of(), tmp_path, tmp_path / "figures") == []
