"""Curves of a run's record, written as a campaign leaves it, and their means."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from support.scenarios.chosen_curves import PERIOD

from handover.controllers.helix.servo.constant_curvature import forward_kinematics
from handover.controllers.helix.servo.visual_servo import Phase
from handover.cosim.blocks.ports import Floats
from handover.scenarios.published.helix.helix_1_curves import RunCurves, curves_of, mean_curve

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
    (curves,) = curves_of([row, {**row, "run": "b", "arm_time": None}, {**row, "run": "lost"}], folder / "runs")
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
