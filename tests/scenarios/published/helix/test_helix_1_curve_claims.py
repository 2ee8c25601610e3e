"""Rules of the claims about curves: each is met by curves as the thesis describes them, and missed by others."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenarios.chosen_curves import curves_as
from support.scenarios.helix_1_rows import table_of
from support.scenarios.made_tables import one
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

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
    return one([*error_claims(curves), *model_claims(curves)], part)


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
    both: dict[str, Any] = {"way_meas": np.linspace(start, 0.16, 12), "apart_sys": np.linspace(start, end, 12)}
    both |= {"pose_sys": np.linspace(0.02, 0.2, 12)} | chosen
    return [curves_as(np.linspace(0.2, 0.05, 12), **both) for _ in range(n)]


@pytest.mark.parametrize(
    ("part", "like", "unlike"),
    [
        ("the faster the larger", thesis_like(), evenly()),
        ("rises at the change", thesis_like(), evenly()),
        ("rises at the change", thesis_like(), [*thesis_like(7), evenly(1)[0]]),  # one is one too many
        ("smoothly at first", thesis_like(), evenly()),
        ("At the start", [*outward(0.14, 0.03), *outward(0.14, 0.031)], [*outward(0.14, 0.002), *outward(0.14, 0.003)]),
        ("The farther the arm", outward(0.14), outward(0.0)),
        ("always farther", outward(0.14), outward(0.14, pose_sys=np.linspace(0.004, 0.2, 12))),  # once within
    ],
)
def test_curves_as_the_thesis_tells_them_are_reproduced(
    part: str, like: Sequence[RunCurves], unlike: Sequence[RunCurves], wording: Wording
):
    for runs, verdict in ((like, Verdict.REPRODUCED), (unlike, Verdict.NOT_REPRODUCED)):
        claim = judged(runs, part)
        assert claim.verdict is verdict
        wording.check(claim.measured)


def test_three_runs_are_too_few_for_a_sign_test():
    assert judged(thesis_like(3), "the faster the larger").verdict is Verdict.NOT_COMPARABLE


@pytest.mark.parametrize(("last", "verdict"), [(0.125, Verdict.REPRODUCED), (0.11, Verdict.NOT_REPRODUCED)])
def test_ends_that_differ_by_more_than_their_reading_are_not_alike(last: float, verdict: Verdict):
    claims = model_claims({0.1: outward(0.14), 0.2: outward(0.14), 0.4: outward(last)})
    assert one(claims, "very similar").verdict is verdict


def test_an_estimate_at_the_bound_but_for_one_step_is_told_with_that_step():
    at = np.full(12, 0.005)
    assert judged(outward(0.14, pose_est=at), "The estimate is always").verdict is Verdict.REPRODUCED
    but_one = np.where(np.arange(12) == 1, 0.004, at)
    claim = judged(outward(0.14, pose_est=but_one), "The estimate is always")
    assert (claim.verdict, claim.measured) == (Verdict.NOT_REPRODUCED, "at 5 mm at 132 of 144 steps")
    assert claim.reason.endswith("the last of which is number 2 of its run.")


def test_without_records_nothing_is_judged():
    claims = [*error_claims(dict.fromkeys(ALPHAS, ())), *model_claims(dict.fromkeys(ALPHAS, ()))]
    assert {c.verdict for c in claims} == {Verdict.NOT_COMPARABLE}


@pytest.mark.slow
def test_model_and_estimate_are_drawn_for_the_step_sizes_that_have_records(tmp_path: Path, sketches: Sketches):
    arm = Helix1Runs.of(table_of({0.1: [40.0] * 8, 0.2: [30.0] * 8, 0.4: [20.0] * 8}), Tuning.THESIS)
    curves = {0.1: outward(0.14), 0.2: [], 0.4: outward(0.14)}
    draw_model(arm, curves, tmp_path)
    draw_estimate(arm, curves, tmp_path)
    assert list(sketches) == ["model", "estimate"]
    assert not draw_model(arm, {0.1: []}, tmp_path)
