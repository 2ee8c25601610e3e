"""Guidance by a hand: the plan, and how its claims and table are judged, on tables that a test makes up."""

from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_2 import Helix2
from handover.scenarios.published.published_experiment import Verdict


def table_of(guided: float = 15.0, quick: bool = False, never: bool = False) -> CampaignTable:
    """Return the plan's runs: those without guidance take from 40 s on, or never close the gripper."""
    rows: list[dict[str, Any]] = []
    for run in Helix2().plan(quick).runs():
        given, k = dict(run.parameters), len(rows)
        is_guided = float(given["guidance"]) > 0.0
        time = guided + 0.1 * k if is_guided else 40.0 + k
        rows.append(
            {"alpha": float(given["alpha"]), "guidance": float(given["guidance"]), "place": given["place"]}
            | {"control_period": float(given["control_period"]), "status": "done", "success": True, "run": f"{k:03}"}
            | {"arm_time": None if never and not is_guided else time, "steps": time / 1.4}
        )
    return CampaignTable(pa.Table.from_pylist(rows))


def test_the_plan_has_two_guided_runs_beside_eight_at_either_step_size():
    plan = Helix2().plan(quick=False)
    assert plan.size == 20
    guided = [point for point in plan.points if float(point["guidance"]) > 0.0]
    assert [point["alpha"] for point in guided] == ["0.1", "0.2"]
    assert Helix2().plan(quick=True).size == 2


@pytest.mark.parametrize(
    ("guided", "verdict"), [(15.0, Verdict.REPRODUCED), (52.0, Verdict.NOT_REPRODUCED), (90.0, Verdict.NOT_REPRODUCED)]
)
def test_guided_runs_are_faster_only_if_a_test_of_ranks_says_so(guided: float, verdict: Verdict):
    claims = Helix2().claims(table_of(guided))
    assert [c.verdict for c in claims[1:]] == [verdict, verdict]
    assert claims[0].verdict is Verdict.REPRODUCED
    assert claims[0].published == "4/4 (100 %)"


def test_a_run_that_never_closes_counts_as_longer_than_any():
    claim = Helix2().claims(table_of(never=True))[1]
    assert claim.verdict is Verdict.REPRODUCED
    assert claim.measured.endswith("against never (medians)")


def test_two_runs_cannot_tell():
    claims = Helix2().claims(table_of(quick=True))
    assert claims[1].verdict is Verdict.NOT_COMPARABLE
    assert "With so few runs p cannot be less than 1" in claims[1].reason


def test_the_table_has_guided_runs_beside_the_others():
    (table,) = Helix2().tables(table_of())
    assert [row[:4] for row in table.rows] == [
        [alpha, arm, *2 * [f"{n} of {n}"]] for alpha in ("0.1", "0.2") for arm, n in (("guided", 2), ("alone", 8))
    ]


def test_without_records_there_is_nothing_to_draw(tmp_path: Path):
    assert Helix2().draw(table_of(), tmp_path, tmp_path / "figures") == []
