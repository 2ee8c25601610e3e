"""The experiment on infrared fingers: its plan, its rules on made-up runs, its table and figure."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.helix.reflex_grasp_parameters import ReflexGraspParameters
from handover.scenarios.published.helix.helix_reflex import CAMERAS, MISMATCHES, HelixReflex, offsets, pairs
from handover.scenarios.published.published_experiment import Verdict

NOTHING: Mapping[str, str] = {}
HOLDS, NOT, FEW = Verdict.REPRODUCED, Verdict.NOT_REPRODUCED, Verdict.NOT_COMPARABLE


def table_of(
    n: int = 40, failed: dict[tuple[str, bool], int] | None = None, beside: dict[tuple[str, bool], float] | None = None
) -> CampaignTable:
    """Return runs of which the first of a case fail without closing, and the ball's offset as they close, m."""
    rows: list[dict[str, Any]] = []
    cases: list[tuple[str, bool, str]] = [(cameras, reflex, "") for cameras in CAMERAS for reflex in (True, False)]
    cases += [("covered", True, mismatch) for mismatch in MISMATCHES]
    for cameras, reflex, mismatch in cases:
        for k in range(n):
            fails = k < (failed or {}).get((mismatch or cameras, reflex), 0)
            offset = (beside or {}).get((mismatch or cameras, reflex), 0.002) + 1e-5 * k * (2.0 if reflex else 1.0)
            closed = {"closing_offset_lateral": offset, "closing_offset_axial": 0.0, "felt_error": 0.001}
            rows.append(
                {
                    "cameras": cameras,
                    "reflex": reflex,
                    **{name: float(x) for name, x in MISMATCHES.get(mismatch, NOTHING).items()},
                    "seed": k,
                    "status": "done",
                    "success": not fails,
                    "reason": "the arm pressed on the hand with 9 N" if fails else "the ball left the hand",
                    **(dict.fromkeys(closed) if fails else closed),
                    "grasp_offset_lateral": None if fails else 0.001,
                }
            )
    usual = {name: getattr(ReflexGraspParameters(), name) for m in MISMATCHES.values() for name in m}
    rows = [{**usual, **row} for row in rows]
    return CampaignTable(pa.Table.from_pylist(rows))


def test_every_seed_is_run_in_all_four_cases():
    plan = HelixReflex().plan(quick=False)
    assert plan.size == (4 + 5) * 40
    assert len({run.seed for run in plan.runs()}) == 40
    assert HelixReflex().plan(quick=True).size == 18


@pytest.mark.parametrize(
    ("failed", "beside", "verdicts"),
    [
        (
            {("covered", False): 20},
            {("covered", False): 0.01, ("free", False): 0.004},
            [HOLDS, HOLDS, HOLDS, HOLDS, HOLDS],
        ),
        ({}, {}, [NOT, NOT, HOLDS, NOT, NOT]),
        ({("covered", True): 20, ("free", True): 9}, {("covered", True): 0.01}, [NOT, NOT, NOT, NOT, NOT]),
        ({("covered", False): 40}, {}, [HOLDS, FEW, HOLDS, NOT, FEW]),
        (
            {("covered", False): 20},
            {("covered", False): 0.01, ("free", False): 0.004, ("palm returns twice the light", True): 0.01},
            [HOLDS, HOLDS, HOLDS, HOLDS, NOT],
        ),
    ],
    ids=["better", "alike", "worse", "never closes without", "one mismatch too many"],
)
def test_verdicts_follow_from_the_pairs(failed: Any, beside: Any, verdicts: list[Verdict]):
    claims = HelixReflex().claims(table_of(failed=failed, beside=beside))
    assert [c.verdict for c in claims] == verdicts
    assert all(c.beyond and not c.published for c in claims)


def test_of_few_runs_nothing_is_concluded():
    beside = {("covered", False): 0.01, ("free", False): 0.01}
    assert {c.verdict for c in HelixReflex().claims(table_of(2, beside=beside))} == {FEW}
    assert {c.verdict for c in HelixReflex().claims(CampaignTable(table_of().table.slice(0, 0)))} == {FEW}


def test_offsets_are_those_of_seeds_that_closed_both_times():
    of_pairs = pairs(table_of(failed={("covered", False): 3, ("covered", True): 5}), "covered")
    assert len(of_pairs) == 40
    assert offsets(of_pairs).shape == (35, 2)
    assert np.all(offsets(of_pairs)[:, 1] > offsets(of_pairs)[:, 0])


def test_the_table_tells_success_offsets_and_why_runs_failed():
    made = table_of(failed={("covered", False): 20, ("a ball of 20 mm radius expected", True): 5})
    table, of_mismatches = HelixReflex().tables(made)
    assert [row[2] for row in table.rows] == ["40/40 (100 %)", "20/40 (50 %)", *["40/40 (100 %)"] * 2]
    assert [row[3] for row in table.rows] == ["40", "20", "40", "40"]
    assert [row[0] for row in of_mismatches.rows[1:]] == list(MISMATCHES)
    assert [row[1] for row in of_mismatches.rows] == ["40/40 (100 %)", "35/40 (88 %)", *["40/40 (100 %)"] * 4]
    assert table.rows[1][-1] == "pressed on the hand (20)"
    assert "only with the reflex 20 of 40 were taken, only without it 0" in table.note


@pytest.mark.slow
def test_offsets_are_drawn(tmp_path: Path):
    (drawn,) = HelixReflex().draw(table_of(failed={("covered", False): 20}), tmp_path, tmp_path)
    assert (tmp_path / f"{drawn.name}.png").is_file()
