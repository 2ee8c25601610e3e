"""The experiment on infrared fingers: its plan, its rules on made-up runs, its table and figure."""

from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.made_tables import empty, made_table, text_of
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.scenarios.published.helix.helix_reflex import CAMERAS, MISMATCHES, HelixReflex, offsets, pairs
from handover.scenarios.published.published_experiment import Verdict
from handover.scenarios.robots.helix.reflex_grasp_parameters import ReflexGraspParameters
from handover.scenarios.runs.campaign.table import CampaignTable

NOTHING: Mapping[str, str] = {}
HOLDS, NOT, FEW = Verdict.REPRODUCED, Verdict.NOT_REPRODUCED, Verdict.NOT_COMPARABLE


def table_of(
    n: int = 40, failed: Mapping[tuple[str, bool], int] = {}, beside: Mapping[tuple[str, bool], float] = {}
) -> CampaignTable:
    """Return runs of which the first of a case fail without closing, and the ball's offset as they close, m."""
    rows: list[dict[str, Any]] = []
    cases: list[tuple[str, bool, str]] = [(cameras, reflex, "") for cameras in CAMERAS for reflex in (True, False)]
    cases += [("covered", True, mismatch) for mismatch in MISMATCHES]
    usual = {name: getattr(ReflexGraspParameters(), name) for m in MISMATCHES.values() for name in m}
    for (cameras, reflex, mismatch), k in product(cases, range(n)):
        fails = k < failed.get((mismatch or cameras, reflex), 0)
        offset = beside.get((mismatch or cameras, reflex), 0.002) + 1e-5 * k * (2.0 if reflex else 1.0)
        closed = {"closing_offset_lateral": offset, "closing_offset_axial": 0.0, "felt_error": 0.001}
        row: dict[str, Any] = {"cameras": cameras, "reflex": reflex, **usual}
        row |= {name: float(x) for name, x in MISMATCHES.get(mismatch, NOTHING).items()}
        row |= {"seed": k, "status": "done", "success": not fails, **(dict.fromkeys(closed) if fails else closed)}
        row |= {"reason": "the arm pressed on the hand with 9 N" if fails else "the ball left the hand"}
        rows.append(row | {"grasp_offset_lateral": None if fails else 0.001})
    return made_table(rows)


def test_every_seed_is_run_in_all_cases():
    assert len({run.seed for run in HelixReflex().plan(quick=False).runs()}) == 40


FAR = {("covered", False): 0.01, ("free", False): 0.004}


@pytest.mark.parametrize(
    ("failed", "beside", "verdicts"),
    [
        ({("covered", False): 20}, FAR, [HOLDS] * 5),
        ({}, {}, [NOT, NOT, HOLDS, NOT, NOT]),
        ({("covered", True): 20, ("free", True): 9}, {("covered", True): 0.01}, [NOT] * 5),
        ({("covered", False): 40}, {}, [HOLDS, FEW, HOLDS, NOT, FEW]),
        ({("covered", False): 20}, {**FAR, ("palm returns twice the light", True): 0.01}, [*[HOLDS] * 4, NOT]),
    ],
    ids=["better", "alike", "worse", "never closes without", "one mismatch too many"],
)
def test_verdicts_follow_from_the_pairs(failed: Any, beside: Any, verdicts: list[Verdict]):
    claims = HelixReflex().claims(table_of(failed=failed, beside=beside))
    assert [c.verdict for c in claims] == verdicts
    assert all(c.beyond and not c.published for c in claims)


def test_of_few_runs_nothing_is_concluded():
    for table in (table_of(2, beside={("covered", False): 0.01, ("free", False): 0.01}), empty(table_of(2))):
        assert {c.verdict for c in HelixReflex().claims(table)} == {FEW}


def test_runs_of_points_that_set_no_mismatch_are_found_without_its_columns():
    names = {name for values in MISMATCHES.values() for name in values}
    whole = [r for r in table_of(2).rows if r["expected_radius"] == ReflexGraspParameters().expected_radius]
    few = made_table([{k: v for k, v in row.items() if k not in names} for row in whole])
    assert len(pairs(few, "covered")) == len(pairs(few, "free")) == 2


def test_offsets_are_those_of_seeds_that_closed_both_times():
    of_pairs = pairs(table_of(failed={("covered", False): 3, ("covered", True): 5}), "covered")
    assert len(of_pairs) == 40
    assert offsets(of_pairs).shape == (35, 2)
    assert np.all(offsets(of_pairs)[:, 1] > offsets(of_pairs)[:, 0])


def test_the_table_tells_success_offsets_and_why_runs_failed(tmp_path: Path, sketches: Sketches, wording: Wording):
    made = table_of(failed={("covered", False): 20, ("a ball of 20 mm radius expected", True): 5})
    tables = HelixReflex().tables(made)
    assert [row[2] for row in tables[0].rows] == ["40/40 (100 %)", "20/40 (50 %)", *["40/40 (100 %)"] * 2]
    assert [row[1] for row in tables[1].rows] == ["40/40 (100 %)", "35/40 (88 %)", *["40/40 (100 %)"] * 4]
    wording.check(text_of(tables))
    (drawn,) = HelixReflex().draw(made, tmp_path, tmp_path)
    sketches.check(drawn.name)
