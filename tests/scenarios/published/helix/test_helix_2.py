"""Guidance by a hand: the plan, and how its claims and table are judged, on tables that a test makes up."""

from pathlib import Path
from typing import Any

import pytest
from support.scenarios.made_tables import made_table

from handover.scenarios.published.helix.helix_2 import Helix2
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.runs.campaign.table import CampaignTable


def table_of(guided: float = 15.0, quick: bool = False, never: bool = False) -> CampaignTable:
    """Return the plan's runs: those without guidance take from 40 s on, or never close the gripper."""
    rows: list[dict[str, Any]] = []
    for k, run in enumerate(Helix2().plan(quick).runs()):
        numbers = {name: float(run.parameters[name]) for name in ("alpha", "guidance", "control_period")}
        time = guided + 0.1 * k if numbers["guidance"] > 0.0 else 40.0 + k
        row = {**numbers, "place": run.parameters["place"], "status": "done", "success": True, "run": f"{k:03}"}
        closed = None if never and numbers["guidance"] == 0.0 else time
        rows.append(row | {"arm_time": closed, "steps": time / 1.4})
    return made_table(rows)


def test_the_table_has_guided_runs_beside_the_others():
    (table,) = Helix2().tables(table_of())
    assert [row[:4] for row in table.rows] == [
        [alpha, arm, *2 * [f"{n} of {n}"]] for alpha in ("0.1", "0.2") for arm, n in (("guided", 2), ("alone", 8))
    ]


def test_a_run_that_never_closes_counts_as_longer_than_any_and_two_runs_cannot_tell(tmp_path: Path):
    claim = Helix2().claims(table_of(never=True))[1]
    assert claim.verdict is Verdict.REPRODUCED
    assert claim.measured.endswith("against never (medians)")
    claim = Helix2().claims(table_of(quick=True))[1]
    assert claim.verdict is Verdict.NOT_COMPARABLE
    assert "With so few runs p cannot be less than 1" in claim.reason
    assert Helix2().draw(table_of(), tmp_path, tmp_path) == []  # without records


@pytest.mark.parametrize(
    ("guided", "verdict"), [(15.0, Verdict.REPRODUCED), (52.0, Verdict.NOT_REPRODUCED), (90.0, Verdict.NOT_REPRODUCED)]
)
def test_guided_runs_are_faster_only_if_a_test_of_ranks_says_so(guided: float, verdict: Verdict):
    claims = Helix2().claims(table_of(guided))
    assert [c.verdict for c in claims[1:]] == [verdict, verdict]
    assert claims[0].verdict is Verdict.REPRODUCED
    assert claims[0].published == "4/4 (100 %)"
