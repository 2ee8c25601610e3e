"""Curves of a run's record, written as a campaign leaves it, their means, and rules of the claims about them."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.scenarios.made_tables import one
from support.sketched_figures import Sketches
from support.sketched_figures import sketches as sketches
from support.wording import Wording

from handover.controllers.helix.servo.constant_curvature import forward_kinematics
from handover.controllers.helix.servo.visual_servo import Phase
from handover.cosim.blocks.ports import Floats
from handover.scenarios.published.helix.helix_1_curves import (
    RunCurves,
    curve_claims,
    curves_of,
    draw_curves,
    mean_curve,
)
from handover.scenarios.published.published_experiment import Claim, Verdict
from handover.scenarios.published.runs import Runs

PERIOD = 1.45


def curves_as(
    error: Floats, descent: int | None = None, rise: float = np.nan, period: float = PERIOD, **chosen: Floats
) -> RunCurves:
    """Return a run's curves; those that are not chosen are zeros, as long as the error's."""
    names = [f.name for f in fields(RunCurves) if f.name not in ("period", "error", "descent", "rise")]
    rest = {name: chosen.get(name, np.zeros(len(error))) for name in names}
    return RunCurves(period=period, error=error, descent=descent, rise=rise, **rest)


Q_CALIB = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.24, 0.0, 0.0, 0.24])
BENT = np.array([0.3, 0.1, 0.11, 0.2, 0.0, 0.25, -0.4, 0.1, 0.22])
W_FROM_B = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])


def pose(q: Floats) -> Floats:
    """Return wrist and gripper in W."""
    return W_FROM_B * forward_kinematics(q, 0.1)


def write_run(folder: Path, phases: list[Phase], q_sys: Floats, q_est: Floats, X_meas: Floats, p_WO: Floats) -> None:
    """Write a record of control steps of 1.45 s, each of whose results is in force until the next."""
    folder.mkdir(parents=True)
    time = np.arange(0.0, PERIOD * len(phases), 0.05)
    k = np.minimum((time / PERIOD).astype(int), len(phases) - 1)
    columns: dict[str, Floats] = {"time": time, "servo.phase": np.array(phases)[k], "servo.error": 0.1 / (1.0 + k)}
    ports = {"q_sys": q_sys, "q_est": q_est, "p_WR_est": X_meas[:, :3], "p_WG_est": X_meas[:, 3:], "p_WO_est": p_WO}
    for name, values in ports.items():
        columns |= {f"servo.{name}[{i + 1}]": values[k, i] for i in range(values.shape[1])}
    pq.write_table(pa.Table.from_pydict(columns), folder / "signals.parquet")


def one_run(folder: Path, p_WO: Floats) -> RunCurves:
    """Return a run of four steps: one of waiting, two towards the first goal, one towards the second."""
    phases = [Phase.WAIT, Phase.APPROACH, Phase.APPROACH, Phase.DESCEND]
    share = np.array([[0.0], [0.2], [0.6], [1.0]])
    q_sys = Q_CALIB + share * (BENT - Q_CALIB)
    q_est = Q_CALIB + 0.5 * share * (BENT - Q_CALIB)
    X_meas = np.array([pose(q) for q in q_est])
    write_run(folder / "runs" / "a", phases, q_sys, q_est, X_meas, np.tile(p_WO, (4, 1)))
    row = {"run": "a", "arm_time": 3 * PERIOD, "steps": 4.0, "control_period": PERIOD}
    rows = Runs([row, {**row, "run": "b", "arm_time": None}, {**row, "run": "lost"}], {})
    (curves,) = curves_of({0.4: rows}, folder / "runs")[0.4]
    return curves


def test_the_model_is_of_the_command_that_was_in_force_when_the_picture_was_taken(tmp_path: Path):
    run = one_run(tmp_path, np.array([0.0, 0.0, -0.65]))
    assert np.isnan(run.way_sys[0])
    assert run.way_sys[1] == pytest.approx(0.0, abs=1e-12)  # the calibrated arm's: nothing was commanded before
    p_WG_calib = np.array([0.0, 0.0, -0.7])
    before = pose(Q_CALIB + 0.6 * (BENT - Q_CALIB))
    measured = pose(Q_CALIB + 0.5 * (BENT - Q_CALIB))
    assert run.way_sys[3] == pytest.approx(np.linalg.norm(before[3:] - p_WG_calib))
    assert run.way_meas[3] == pytest.approx(np.linalg.norm(measured[3:] - p_WG_calib))
    assert run.apart_sys[3] == pytest.approx(np.linalg.norm((before - measured)[3:]))
    assert run.pose_sys[3] == pytest.approx(np.linalg.norm(before - measured))
    assert run.pose_est[1:] == pytest.approx(0.0, abs=1e-12)  # the estimate explains the measured pose
    assert run.way_est[1:] == pytest.approx(run.way_meas[1:])


def test_a_second_goal_below_the_arm_makes_the_error_larger_and_one_above_it_smaller(tmp_path: Path):
    measured = pose(Q_CALIB + 0.5 * (BENT - Q_CALIB))
    above, below = (one_run(tmp_path / str(z), measured[3:] + np.array([0.0, 0.0, z])) for z in (0.05, -0.05))
    assert above.descent == below.descent == 3
    assert below.rise > 0.03
    assert above.rise < -0.03


def test_a_mean_is_of_the_runs_still_under_way_and_as_long_as_their_median():
    curve = mean_curve([np.full(2, 1.0), np.array([np.nan, 3.0, 5.0, 7.0]), np.full(9, 5.0)], 2.0)
    assert curve.time.tolist() == [0.0, 2.0, 4.0, 6.0]
    assert curve.runs.tolist() == [2, 3, 2, 2]
    assert curve.mean.tolist() == [3.0, 3.0, 5.0, 6.0]
    assert curve.deviation.tolist() == pytest.approx([2.0, (8.0 / 3.0) ** 0.5, 0.0, 1.0])
    seen_late = mean_curve([np.array([np.nan, 2.0]), np.array([np.nan, 4.0])], 1.0)
    assert seen_late.time.tolist() == [1.0]


ALPHAS = (0.1, 0.2, 0.4)


def judged(runs: Sequence[RunCurves], part: str) -> Claim:
    curves = dict.fromkeys(ALPHAS, runs)
    return one(curve_claims(curves), part)


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
    claims = curve_claims({0.1: outward(0.14), 0.2: outward(0.14), 0.4: outward(last)})
    assert one(claims, "very similar").verdict is verdict


def test_an_estimate_at_the_bound_but_for_one_step_is_reported_with_that_step():
    at = np.full(12, 0.005)
    assert judged(outward(0.14, pose_est=at), "The estimate is always").verdict is Verdict.REPRODUCED
    but_one = np.where(np.arange(12) == 1, 0.004, at)
    claim = judged(outward(0.14, pose_est=but_one), "The estimate is always")
    assert (claim.verdict, claim.measured) == (Verdict.NOT_REPRODUCED, "at 5 mm at 132 of 144 steps")
    assert "is number 2 of its run." in claim.reason


def test_without_records_nothing_is_judged():
    claims = curve_claims(dict.fromkeys(ALPHAS, ()))
    assert {c.verdict for c in claims} == {Verdict.NOT_COMPARABLE}


@pytest.mark.slow
def test_model_and_estimate_are_drawn_for_the_step_sizes_that_have_records(tmp_path: Path, sketches: Sketches):
    curves = {0.1: outward(0.14), 0.2: [], 0.4: outward(0.14)}
    draw_curves(curves, ("", ""), 0.005, tmp_path)
    assert list(sketches) == ["model", "estimate"]
    assert not draw_curves({0.1: []}, ("", ""), 0.005, tmp_path)
