import json
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
import pytest
from support.scenarios.helix_1_rows import spread, table_of

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.published_experiment import Claim, Verdict

PUBLISHED = {0.1: spread(104.8, 52.0), 0.2: spread(42.2, 10.8), 0.4: spread(22.4, 4.3)}


def judged(table: CampaignTable, part: str) -> Claim:
    (claim,) = [c for c in Helix1().claims(table) if part in c.claim]
    return claim


def times(**changed: Sequence[float | None]) -> Mapping[float, Sequence[float | None]]:
    return {alpha: changed.get(f"a{alpha:.1f}".replace(".", ""), PUBLISHED[alpha]) for alpha in PUBLISHED}


def test_the_published_figures_reproduce_themselves():
    table = table_of(PUBLISHED)
    claims = {c.claim: c for c in Helix1().claims(table)}
    lengths = ("model's gripper", "control step takes", "Doubling the smallest")  # whose eight runs leave open
    for text, claim in claims.items():
        expected = Verdict.NOT_COMPARABLE if any(part in text for part in lengths) else Verdict.REPRODUCED
        assert claim.verdict is expected, text


def test_one_ball_that_was_not_taken_is_one_too_many():
    table = table_of(times(a04=[*PUBLISHED[0.4][:7], None]))
    claim = judged(table, "Every handover")
    assert (claim.measured, claim.verdict) == ("23 of 24", Verdict.NOT_REPRODUCED)
    assert claim.interval is not None
    assert claim.interval[1] < 1.0
    assert claim.reason.endswith("p = 1.")


def test_a_gripper_that_closed_beside_the_ball_has_moved_its_arm():
    table = table_of(PUBLISHED, success=False)
    assert judged(table, "begins to close").verdict is Verdict.REPRODUCED
    assert judged(table, "Every handover").measured == "0 of 24"


def test_a_run_that_crashed_counts_neither_way_and_is_reported():
    rows = table_of(PUBLISHED).table.to_pylist()
    rows[0] |= {"status": "failed", "success": None, "arm_time": None}
    claim = judged(CampaignTable(pa.Table.from_pylist(rows)), "Every handover")
    assert claim.measured == "23 of 23"
    assert "1 runs that did not come to their end" in claim.reason


def test_times_that_do_not_fall_are_seen():
    assert judged(table_of(times(a04=PUBLISHED[0.2])), "The arm's time falls").verdict is Verdict.NOT_REPRODUCED
    assert (
        judged(table_of(dict.fromkeys(PUBLISHED, spread(40.0, 5.0))), "The arm's time falls").verdict
        is Verdict.NOT_REPRODUCED
    )


def test_a_run_that_never_closes_took_longer_than_any():
    claim = judged(table_of(times(a01=[None] * 8)), "The arm's time falls")
    assert claim.measured.startswith("never, ")
    assert claim.verdict is Verdict.REPRODUCED


@pytest.mark.parametrize(
    ("mean", "std", "verdict"),
    [(44.8, 5.0, Verdict.REPRODUCED), (24.0, 2.0, Verdict.NOT_REPRODUCED), (30.0, 40.0, Verdict.NOT_COMPARABLE)],
)
def test_a_ratio_is_of_two_unless_its_interval_says_otherwise_or_nothing(mean: float, std: float, verdict: Verdict):
    claim = judged(table_of(times(a02=np.abs(spread(mean, std)).tolist())), "from 0.2 to 0.4")
    assert claim.verdict is verdict


@pytest.mark.parametrize(("mean", "verdict"), [(24.0, Verdict.REPRODUCED), (16.0, Verdict.NOT_REPRODUCED)])
def test_a_mean_time_is_compared_with_the_published_one_and_its_spread(mean: float, verdict: Verdict):
    claim = judged(table_of(times(a04=spread(mean, 1.0))), "At step size 0.4")
    assert claim.verdict is verdict
    assert claim.interval is not None
    assert claim.interval[0] < mean < claim.interval[1]


def test_the_step_size_whose_error_can_stall_at_the_threshold_says_so():
    table = table_of(PUBLISHED)
    stalls = {alpha: "50 mm, the threshold" in judged(table, f"At step size {alpha}").reason for alpha in PUBLISHED}
    assert stalls == {0.1: True, 0.2: False, 0.4: False}


def test_two_runs_are_too_few_for_a_mean():
    assert judged(table_of(times(a04=[20.0, 25.0])), "At step size 0.4").verdict is Verdict.NOT_COMPARABLE


@pytest.mark.parametrize(("length", "verdict"), [(0.14, Verdict.NOT_COMPARABLE), (0.08, Verdict.NOT_REPRODUCED)])
def test_a_mismatch_that_the_arm_was_fitted_to_can_only_fail(length: float, verdict: Verdict):
    same = {"model_mismatch": length, "arm_travel": 0.2, "model_travel": 0.28}
    assert judged(table_of(PUBLISHED, "thesis", **same), "model's gripper").verdict is verdict


def test_runs_that_all_take_alike_have_no_interval_that_json_cannot_hold():
    alike = table_of({0.1: [40.0] * 8, 0.2: [20.0] * 8, 0.4: [20.0] * 8})
    assert json.dumps([c.as_data() for c in Helix1().claims(alike)], allow_nan=False)
    assert judged(alike, "spread").interval is None


def test_our_settings_are_judged_beyond_the_paper_and_last():
    ours = table_of(PUBLISHED, "own", grasp_offset_lateral=0.004, final_distance=0.004).table
    theirs = table_of(PUBLISHED, "thesis", grasp_offset_lateral=0.02, final_distance=0.02).table
    claims = Helix1().claims(CampaignTable(pa.concat_tables([ours, theirs])))
    assert [c.beyond for c in claims] == [False] * (len(claims) - 3) + [True] * 3
    assert claims[-2].measured == "0.0040 m against 0.0200 m (medians)"
    assert claims[-1].measured == "4.0 mm in the median, 4.0 mm at most"
    assert {c.verdict for c in claims[-3:]} == {Verdict.REPRODUCED}


@pytest.mark.parametrize(("distance", "verdict"), [(0.0049, Verdict.REPRODUCED), (0.0051, Verdict.NOT_REPRODUCED)])
def test_a_gripper_that_ends_farther_off_than_its_fingers_need_is_told(distance: float, verdict: Verdict):
    ours = table_of(PUBLISHED, "own", grasp_offset_lateral=0.004, final_distance=distance)
    assert Helix1().claims(ours)[-1].verdict is verdict
