"""Rules of the claims about curves: each is met by curves as the thesis describes them, and missed by others."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.chosen_curves import curves_as
from support.scenarios.helix_1_rows import table_of

from handover.cosim.blocks.ports import Floats
from handover.scenarios.helix.parameters import Tuning
from handover.scenarios.published.helix.helix_1_curve_claims import error_claims, model_claims
from handover.scenarios.published.helix.helix_1_curves import RunCurves
from handover.scenarios.published.helix.helix_1_model_figures import draw_estimate, draw_model
from handover.scenarios.published.helix.helix_1_runs import Helix1Runs
from handover.scenarios.published.published_experiment import Claim, Verdict

ALPHAS = (0.1, 0.2, 0.4)


def judged(runs: Sequence[RunCurves], part: str) -> Claim:
    curves = dict.fromkeys(ALPHAS, runs)
    (claim,) = [c for c in [*error_claims(curves), *model_claims(curves)] if part in c.claim]
    return claim


def approach(fall: Floats, rise: float) -> RunCurves:
    """Return a run whose error falls to the first goal's threshold, and then rises and is there."""
    on_ball = fall[-1] + rise * np.array([1.0, 0.5, 0.0])
    return curves_as(np.concatenate([[np.nan], fall, on_ball]), descent=len(fall) + 1, rise=rise)


def thesis_like(n: int = 8) -> list[RunCurves]:
    """Return runs of lengths that differ, whose errors fall exponentially and rise by 20 mm."""
    return [approach(0.2 * np.exp(-np.arange(8 + k) / (6.0 + k)), 0.02) for k in range(n)]


def evenly(n: int = 8) -> list[RunCurves]:
    """Return runs whose errors fall by as much in each step, also at the second goal, but for a wobble at first."""
    error = np.append(np.nan, np.linspace(0.2, 0.02, 13))
    error[3] += 0.002
    return [curves_as(error, descent=11, rise=-0.015) for _ in range(n)]


def outward(end: float, start: float = 0.02, n: int = 4, **chosen: Any) -> list[RunCurves]:
    """Return runs in which the model leaves the arm behind, by so much at the end, m."""
    way = np.linspace(start, 0.16, 12)
    both: dict[str, Any] = {
        "way_meas": way,
        "apart_sys": np.linspace(start, end, 12),
        "pose_sys": np.linspace(0.02, 0.2, 12),
    }
    return [curves_as(np.linspace(0.2, 0.05, 12), **{**both, **chosen}) for _ in range(n)]


@pytest.mark.parametrize("part", ["the faster the larger", "rises at the change", "smoothly at first"])
def test_an_error_as_the_thesis_tells_it_is_reproduced(part: str):
    assert judged(thesis_like(), part).verdict is Verdict.REPRODUCED
    assert judged(evenly(), part).verdict is Verdict.NOT_REPRODUCED


def test_one_run_whose_error_falls_at_the_second_goal_is_one_too_many():
    claim = judged([*thesis_like(7), evenly(1)[0]], "rises at the change")
    assert claim.verdict is Verdict.NOT_REPRODUCED
    assert claim.measured.startswith("in 21/24 (88 %); by 20 mm")


def test_three_runs_are_too_few_for_a_sign_test():
    assert judged(thesis_like(3), "the faster the larger").verdict is Verdict.NOT_COMPARABLE


def test_an_error_that_falls_evenly_takes_as_long_for_its_second_half():
    assert judged(evenly(), "the faster the larger").measured == "1.0, 1.0, 1.0 times as long (medians)"


@pytest.mark.parametrize(("start", "verdict"), [(0.03, Verdict.REPRODUCED), (0.002, Verdict.NOT_REPRODUCED)])
def test_an_arm_that_starts_off_its_calibrated_place_is_seen(start: float, verdict: Verdict):
    runs = [*outward(0.14, start), *outward(0.14, start + 0.001)]
    assert judged(runs, "At the start").verdict is verdict


@pytest.mark.parametrize(("end", "verdict"), [(0.14, Verdict.REPRODUCED), (0.0, Verdict.NOT_REPRODUCED)])
def test_a_mismatch_that_grows_with_the_way_is_seen(end: float, verdict: Verdict):
    assert judged(outward(end), "The farther the arm").verdict is verdict


@pytest.mark.parametrize(("last", "verdict"), [(0.125, Verdict.REPRODUCED), (0.11, Verdict.NOT_REPRODUCED)])
def test_ends_that_differ_by_more_than_their_reading_are_not_alike(last: float, verdict: Verdict):
    claims = model_claims({0.1: outward(0.14), 0.2: outward(0.14), 0.4: outward(last)})
    (claim,) = [c for c in claims if "very similar" in c.claim]
    assert claim.verdict is verdict


def test_an_estimate_at_the_bound_but_for_one_step_is_told_with_that_step():
    at = np.full(12, 0.005)
    assert judged(outward(0.14, pose_est=at), "The estimate is always").verdict is Verdict.REPRODUCED
    but_one = np.where(np.arange(12) == 1, 0.004, at)
    claim = judged(outward(0.14, pose_est=but_one), "The estimate is always")
    assert (claim.verdict, claim.measured) == (Verdict.NOT_REPRODUCED, "at 5 mm at 132 of 144 steps")
    assert claim.reason.endswith("the last of which is number 2 of its run.")


def test_a_model_that_is_within_the_bound_once_is_not_always_beyond():
    assert judged(outward(0.14), "always farther").verdict is Verdict.REPRODUCED
    near = np.linspace(0.004, 0.2, 12)
    assert judged(outward(0.14, pose_sys=near), "always farther").verdict is Verdict.NOT_REPRODUCED


def test_without_records_nothing_is_judged():
    claims = [*error_claims(dict.fromkeys(ALPHAS, ())), *model_claims(dict.fromkeys(ALPHAS, ()))]
    assert {c.verdict for c in claims} == {Verdict.NOT_COMPARABLE}


@pytest.mark.slow
def test_model_and_estimate_are_drawn_for_the_step_sizes_that_have_records(tmp_path: Path):
    arm = Helix1Runs.of(table_of({0.1: [40.0] * 8, 0.2: [30.0] * 8, 0.4: [20.0] * 8}), Tuning.THESIS)
    curves = {0.1: outward(0.14), 0.2: [], 0.4: outward(0.14)}
    drawn = [*draw_model(arm, curves, tmp_path), *draw_estimate(arm, curves, tmp_path)]
    assert [figure.name for figure in drawn] == ["model", "estimate"]
    assert {f.name for f in tmp_path.iterdir()} == {f"{n}.{s}" for n in ("model", "estimate") for s in ("png", "svg")}
    assert not draw_model(arm, {0.1: []}, tmp_path)
