"""The use case's plan, and how its claims and table are judged, on tables that a test makes up."""

from pathlib import Path

import pytest
from support.scenarios.made_tables import made_table

from handover.scenarios.published.helix.helix_3 import Helix3
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.runs.campaign.table import CampaignTable


def table_of(failed: int = 0) -> CampaignTable:
    """Return the plan's runs, the first so many of the thesis's failed."""
    reasons = ("the ball has rested in the bowl", "the ball missed the bowl by 0.010 m: it fell")
    return made_table(
        {**run.parameters, "status": "done", "run": f"{k:03}"}
        | {"success": k >= failed, "reason": reasons[k < failed], "drop_offset": 0.01 + 1e-4 * k}
        | {"arm_time": 40.0 + k, "carry_time": 50.0, "task_time": 110.0}
        for k, run in enumerate(Helix3().plan(quick=False).runs())
    )


def test_the_plan_has_the_step_size_of_the_thesis():
    thesis = [point for point in Helix3().plan(quick=False).points if point["tuning"] == "thesis"]
    assert [(point["alpha"], point["control_period"]) for point in thesis] == [("0.1", "1.38")] * 4


@pytest.mark.parametrize(("failed", "verdict"), [(0, Verdict.REPRODUCED), (1, Verdict.NOT_REPRODUCED)])
def test_the_thesis_s_success_is_reproduced_if_every_ball_gets_into_the_bowl(failed: int, verdict: Verdict):
    claims = Helix3().claims(table_of(failed))
    assert [c.beyond for c in claims] == [False, True]
    assert (claims[0].verdict, claims[0].published) == (verdict, "8/8 (100 %)")
    assert claims[0].measured == f"{8 - failed}/8 ({88 if failed else 100} %)"


def test_the_table_says_why_runs_failed(tmp_path: Path):
    (table,) = Helix3().tables(table_of(failed=2))
    rows = {row[0]: (row[1], row[-1]) for row in table.rows}
    assert rows["published"][0] == "8 of 8"
    assert rows["the thesis's settings"] == ("6 of 8", "the ball missed the bowl by 0.010 m (2)")
    assert rows["our settings"][1] == ""
    assert Helix3().draw(table_of(), tmp_path, tmp_path) == []  # without records
