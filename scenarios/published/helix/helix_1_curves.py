"""Curves of a Helix run by its record, at its control steps, and their mean and deviation over several runs.

[Vervloet2025] figs. 7 to 10 and 16 to 21 show such means. How they are formed, sec. 4 says in part: "the length of
these average values will be the median length of the measurements". What becomes of a run that is shorter than that it
does not say. Here a mean is over the runs that are still under way, so beyond the end of the shorter ones over fewer: a
run that is over has no error any more, and its last one, held, would pull the mean to the threshold.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handover.controllers.helix.servo.constant_curvature import W_FROM_B, forward_kinematics
from handover.controllers.helix.servo.servo_parameters import Params as ServoParams
from handover.controllers.helix.servo.visual_servo import Phase
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record

_ON_BALL = [int(phase) for phase in (Phase.DESCEND, Phase.GRASP, Phase.HOLD)]
_MODEL_SIGNALS = ("servo.q_sys", "servo.q_est", "servo.p_WO_est", "servo.p_WR_est", "servo.p_WG_est")


@dataclass(frozen=True, eq=False)
class RunCurves:
    """What a run's controller had at each of its steps, shape (steps,), m, until the gripper began to close.

    At a step it measures X_meas, estimates q_est from it and from the command q_sys that has been in force until then
    ([Vervloet2025] algorithm 3, lines 6 to 11), and changes the command. So X_sys = f(q_sys) is of the command before.
    Ways are distances of the gripper from where it hangs after calibration, [0, 0, -0.7] m. NaN before it is seen.

    Attributes:
        period: control period, s.
        error: |X_goal - X_meas| over wrist and gripper.
        descent: step at which the goal changed from above the ball to the ball; None if it never did.
        rise: by how much that change made the error larger, for the measurement of that step; NaN if it never did.
        way_meas: of the measured gripper.
        way_sys: of the gripper of the commanded state.
        way_est: of the gripper of the estimated state.
        apart_sys: gripper of the commanded state to the measured one.
        apart_est: gripper of the estimated state to the measured one.
        pose_sys: |X_sys - X_meas| over wrist and gripper, which the bound of eq. (16) is about.
        pose_est: |X_est - X_meas| likewise.
    """

    period: float
    error: Floats
    descent: int | None
    rise: float
    way_meas: Floats
    way_sys: Floats
    way_est: Floats
    apart_sys: Floats
    apart_est: Floats
    pose_sys: Floats
    pose_est: Floats

    @classmethod
    def of(cls, record: Record, steps: int, period: float) -> "RunCurves":
        """Read the curves of a run that took so many control steps."""
        servo = vars(ServoParams())
        d_gripper, offset = float(servo["d_gripper"]), float(servo["d_grasp_offset"])
        index = rows_of_steps(record, steps, period)
        phase: NDArray[np.int64] = np.asarray(record["servo.phase"][index], dtype=np.int64)
        seen: NDArray[np.bool_] = phase != int(Phase.WAIT)
        q_est: Floats = record["servo.q_est"][index]
        l_calib: list[float] = servo["l_calib"]
        q_calib = np.array([x for l in l_calib for x in (0.0, 0.0, l)])
        q_sys: Floats = np.vstack([q_calib, record["servo.q_sys"][index[:-1]]])
        X_meas: Floats = np.hstack([record["servo.p_WR_est"][index], record["servo.p_WG_est"][index]])
        X_sys, X_est = (W_FROM_B * np.array([forward_kinematics(q, d_gripper) for q in of]) for of in (q_sys, q_est))
        p_WG_calib = np.array([0.0, 0.0, -sum(l_calib) - d_gripper])
        error: Floats = record["servo.error"][index]
        descents: NDArray[np.int64] = np.flatnonzero(np.isin(phase, _ON_BALL))
        descent = int(descents[0]) if len(descents) else None
        rise = np.nan
        if descent is not None:
            p_WO: list[float] = record["servo.p_WO_est"][index[descent]].tolist()
            X_goal = np.array([*p_WO, *p_WO]) + np.array([0.0, 0.0, offset + d_gripper, 0.0, 0.0, offset])
            goal: Floats = X_goal - X_meas[descent]
            on_ball: Floats = goal - offset * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0])
            rise = float(np.linalg.norm(on_ball)) - float(np.linalg.norm(goal))

        def known(values: Floats) -> Floats:
            return np.where(seen, values, np.nan)

        def norms(differences: Floats) -> Floats:
            return known(np.linalg.norm(differences, axis=1))

        return cls(
            period=period,
            error=known(error),
            descent=descent,
            rise=rise,
            way_meas=norms(X_meas[:, 3:] - p_WG_calib),
            way_sys=norms(X_sys[:, 3:] - p_WG_calib),
            way_est=norms(X_est[:, 3:] - p_WG_calib),
            apart_sys=norms((X_sys - X_meas)[:, 3:]),
            apart_est=norms((X_est - X_meas)[:, 3:]),
            pose_sys=norms(X_sys - X_meas),
            pose_est=norms(X_est - X_meas),
        )


@dataclass(frozen=True, eq=False)
class MeanCurve:
    """Mean and standard deviation over runs, by control step; steps at which no run has a value are left out.

    Attributes:
        time: of the steps, s.
        mean: over the runs that are still under way.
        deviation: likewise, of these runs as a population.
        runs: how many they are.
    """

    time: Floats
    mean: Floats
    deviation: Floats
    runs: NDArray[np.int64]


def rows_of_steps(record: Record, steps: int, period: float) -> NDArray[np.int64]:
    """Return the row of a record at which each control step's results are in force: in the middle between two steps."""
    middle = (np.arange(steps, dtype=np.float64) + 0.5) * period
    after = np.asarray(np.searchsorted(record.time, middle), dtype=np.int64)
    return np.minimum(after, len(record.time) - 1)


def curves_of(rows: Sequence[Mapping[str, Any]], runs: Path) -> list[RunCurves]:
    """Return the curves of each run in which the gripper began to close and that has a record of all signals.

    Args:
        rows: of a campaign's table.
        runs: where the folders of its runs are.
    """
    return [
        RunCurves.of(record, round(row["steps"]), row["control_period"])
        for row, record in _records(rows, runs)
        if all(signal in record for signal in _MODEL_SIGNALS)
    ]


def errors_of(rows: Sequence[Mapping[str, Any]], runs: Path) -> list[Floats]:
    """Return the error at each control step, m, of each run that has a record, until the gripper began to close.

    Args:
        rows: of a campaign's table, of runs by the same step size.
        runs: where the folders of its runs are.
    """
    errors: list[Floats] = []
    for row, record in _records(rows, runs):
        index = rows_of_steps(record, round(row["steps"]), row["control_period"])
        seen: NDArray[np.bool_] = record["servo.phase"][index] != int(Phase.WAIT)
        errors.append(np.where(seen, record["servo.error"][index], np.nan))
    return errors


def mean_curve(curves: Sequence[Floats], period: float) -> MeanCurve:
    """Return mean and deviation of curves of one control period, s, up to their median length."""
    length = int(np.median([len(curve) for curve in curves]))
    padded = np.full((len(curves), length), np.nan)
    for line, curve in zip(padded, curves, strict=True):
        line[: len(curve)] = curve[:length]
    count: NDArray[np.int64] = np.sum(~np.isnan(padded), axis=0)
    known: NDArray[np.int64] = np.flatnonzero(count)
    return MeanCurve(
        time=np.asarray(period * known, dtype=np.float64),
        mean=np.nanmean(padded[:, known], axis=0),
        deviation=np.nanstd(padded[:, known], axis=0),
        runs=count[known],
    )


def _records(rows: Sequence[Mapping[str, Any]], runs: Path) -> Iterator[tuple[Mapping[str, Any], Record]]:
    for row in rows:
        path = runs / row["run"] / "signals.parquet"
        if row.get("arm_time") is not None and path.exists():
            yield row, Record(path)
