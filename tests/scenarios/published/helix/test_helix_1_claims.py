import json
from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from support.scenarios.helix_1_rows import spread, table_of
from support.scenarios.made_tables import made_table, one

from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.published_experiment import Claim, Verdict

PUBLISHED = {0.1: spread(104.8, 52.0), 0.2: spread(42.2, 10.8), 0.4: spread(22.4, 4.3)}


def judged(table: CampaignTable, part: str) -> Claim:
    return one(Helix1().claims(table), part)


def times(**changed: Sequence[float | None]) -> Mapping[float, Sequence[float | None]]:
    return {alpha: changed.get(f"a{alpha:.1f}".replace(".", ""), PUBLISHED[alpha]) for alpha in PUBLISHED}


def test_the_published_figures_reproduce_themselves():
    table = table_of(PUBLISHED)
    claims = {c.claim: c for c in Helix1().claims(table)}
    lengths = ("model's gripper", "control step takes", "Doubling the smallest")  # whose eight runs leave open
    for text, claim in claims.items():
        expected = Verdict.NOT_COMPARABLE if any(part in text for part in lengths) else Verdict.REPRODUCED
        assert claim.verdict is expected, text


def test_one_ball_that_was_not_taken_is_one_too_many_and_a_crash_counts_neither_way():
    claim = judged(table_of(times(a04=[*PUBLISHED[0.4][:7], None])), "Every handover")
    assert (claim.measured, claim.verdict) == ("23 of 24", Verdict.NOT_REPRODUCED)
    assert claim.interval is not None
    assert claim.interval[1] < 1.0
    assert claim.reason.endswith("p = 1.")
    rows = table_of(PUBLISHED, success=False).rows  # grippers that closed beside the ball have moved their arms
    assert judged(made_table(rows), "begins to close").verdict is Verdict.REPRODUCED
    rows[0] |= {"status": "failed", "success": None, "arm_time": None}
    claim = judged(made_table(rows), "Every handover")
    assert claim.measured == "0 of 23"
    assert "1 runs that did not come to their end" in claim.reason


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (times(a04=PUBLISHED[0.2]), Verdict.NOT_REPRODUCED),
        (dict.fromkeys(PUBLISHED, spread(40.0, 5.0)), Verdict.NOT_REPRODUCED),
        (times(a01=[None] * 8), Verdict.REPRODUCED),  # a run that never closes took longer than any
    ],
)
def test_times_that_do_not_fall_are_seen(found: Mapping[float, Sequence[float | None]], verdict: Verdict):
    claim = judged(table_of(found), "The arm's time falls")
    assert claim.verdict is verdict
    assert claim.measured.startswith("never, ") is (None in found[0.1])


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


def test_two_runs_are_too_few_for_a_mean_and_an_error_that_can_stall_at_the_threshold_is_told():
    table = table_of(times(a04=[20.0, 25.0]))
    assert judged(table, "At step size 0.4").verdict is Verdict.NOT_COMPARABLE
    stalls = [alpha for alpha in PUBLISHED if "50 mm, the threshold" in judged(table, f"At step size {alpha}").reason]
    assert stalls == [0.1]


@pytest.mark.parametrize(("length", "verdict"), [(0.14, Verdict.NOT_COMPARABLE), (0.08, Verdict.NOT_REPRODUCED)])
def test_a_mismatch_that_the_arm_was_fitted_to_can_only_fail(length: float, verdict: Verdict):
    same = {"model_mismatch": length, "arm_travel": 0.2, "model_travel": 0.28}
    assert judged(table_of(PUBLISHED, "thesis", **same), "model's gripper").verdict is verdict


def test_runs_that_all_take_alike_have_no_interval_that_json_cannot_hold():
    alike = table_of({0.1: [40.0] * 8, 0.2: [20.0] * 8, 0.4: [20.0] * 8})
    assert json.dumps([c.as_data() for c in Helix1().claims(alike)], allow_nan=False)
    assert judged(alike, "spread").interval is None


@pytest.mark.parametrize(("distance", "verdict"), [(0.0049, Verdict.REPRODUCED), (0.0051, Verdict.NOT_REPRODUCED)])
def test_our_settings_are_judged_beyond_the_paper_and_last(distance: float, verdict: Verdict):
    ours = table_of(PUBLISHED, "own", grasp_offset_lateral=0.004, final_distance=distance)
    theirs = table_of(PUBLISHED, "thesis", grasp_offset_lateral=0.02, final_distance=0.02)
    claims = Helix1().claims(made_table([*ours.rows, *theirs.rows]))
    assert [c.beyond for c in claims] == [False] * (len(claims) - 3) + [True] * 3
    assert [c.verdict for c in claims[-3:]] == [Verdict.REPRODUCED, Verdict.REPRODUCED, verdict]
    assert claims[-2].measured == "0.0040 m against 0.0200 m (medians)"
    assert claims[-1].measured == f"{1e3 * distance:.1f} mm in the median, {1e3 * distance:.1f} mm at most"
