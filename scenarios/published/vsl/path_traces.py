"""The tip along its path, point by point, from the records of runs: of each run, and of repetitions together."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from handover.controllers.vsl.hybrid_kinematics import Params as KinematicsParams
from handover.controllers.vsl.kinematics import VslKinematics
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.scenarios.published.figures import SOFT, Mark, records_of
from handover.scenarios.published.runs import Row, is_done

EQUAL: Any = {"aspect": "equal", "adjustable": "datalim"}
"""Of a panel whose axes have one scale."""


def has_completed_path(row: Row) -> bool:
    """Return whether a run came to the end of its path, however far off it was."""
    return is_done(row) and row.get("path_time") is not None


@dataclass(frozen=True, kw_only=True)
class PathTrace:
    """Positions as the planner leaves each point of the path for the next, each of shape (n, 3), in W, m.

    Attributes:
        desired: the points.
        tracked: the tip by the tracker.
        servo: the tip by encoders and rigid links.
        estimated: the tip by the controller's forward model.
        commanded: where the commanded angles would put the tip of a rigid arm.
    """

    desired: Floats
    tracked: Floats
    servo: Floats
    estimated: Floats
    commanded: Floats

    @property
    def along(self) -> Floats:
        """Distance along the path from its first point, shape (n,), m."""
        return distances_along(self.desired)


def distances_along(points: Floats) -> Floats:
    """Return the distance of each of the points, shape (n, 3), from the first along the polyline, shape (n,), m."""
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


def trace_of(record: Record) -> PathTrace:
    """Return a run's trace; its points are those at which `PathEvaluator` measures the run's errors."""
    goal, moving = record["planner.p_WG_goal"], record["planner.moving"].astype(bool)
    left = moving[:-1] & ~(moving[1:] & np.all(goal[1:] == goal[:-1], axis=1))
    ends = np.flatnonzero(left) + 1
    p = KinematicsParams()
    kinematics = VslKinematics(p.L_1, p.L_2, p.L_3, p.elbow)
    return PathTrace(
        desired=goal[ends - 1],
        tracked=record["arm.p_WG_meas"][ends],
        servo=record["kinematics.p_WG_model"][ends],
        estimated=record["kinematics.p_WG_est"][ends],
        commanded=np.array([kinematics.forward(q) for q in record["kinematics.q_cmd"][ends - 1]]).reshape(-1, 3),
    )


def traces_of(runs: Path, names: Sequence[str]) -> list[PathTrace]:
    """Return the traces of runs, given by the names of their folders, of those that left a record."""
    return [trace_of(record) for record in records_of(names, runs)]


@dataclass(frozen=True)
class Repetitions:
    """Mean and standard deviation of the positions of several runs along one path.

    Attributes:
        desired: the path's points, shape (n, 3), m.
        mean: mean positions, shape (n, 3), m.
        deviation: standard deviation of the positions, root of the sum of the axes' variances, shape (n,), m.
        errors: distance from the desired point, of each run, shape (runs, n), m.
    """

    desired: Floats
    mean: Floats
    deviation: Floats
    errors: Floats

    @property
    def along(self) -> Floats:
        """Distance along the path from its first point, shape (n,), m."""
        return distances_along(self.desired)

    @classmethod
    def of(cls, traces: Sequence[PathTrace], what: str) -> "Repetitions":
        """Return them of a position of `PathTrace` by its name.

        Raises:
            ValueError: there are none, or their paths differ.
        """
        desired = traces[0].desired if traces else np.zeros((0, 3))
        if not traces or any(not np.array_equal(t.desired, desired) for t in traces):
            raise ValueError(f"{len(traces)} runs that do not share a path have no mean")
        positions = np.array([getattr(t, what) for t in traces])
        spread = np.sqrt(np.sum(np.var(positions, axis=0, ddof=min(1, len(traces) - 1)), axis=1))
        errors = np.linalg.norm(positions - desired, axis=2)
        return cls(desired, positions.mean(axis=0), spread, errors)


@dataclass(frozen=True)
class PathBand:
    """The mean of repetitions in the plane XZ, mm, with their deviation as a band across the path."""

    curve: Repetitions
    colour: str
    label: str

    def draw(self, axes: Axes) -> None:
        """Draw it."""
        middle = 1000 * self.curve.mean[:, [0, 2]]
        along = np.gradient(self.curve.desired[:, [0, 2]], axis=0)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), np.finfo(np.float64).tiny)
        across = 1000 * self.curve.deviation[:, None] * np.column_stack([-along[:, 1], along[:, 0]])
        band: Floats = np.vstack([middle + across, (middle - across)[::-1]])
        axes.fill(band[:, 0], band[:, 1], color=self.colour, alpha=0.25, lw=0)
        path_of(self.curve.mean, self.colour, self.label).draw(axes)


def path_of(positions: Floats, colour: str, label: str, **style: Any) -> Mark:
    """Return positions, shape (n, 3), m, in the plane XZ, mm."""
    return Mark(1000 * positions[:, 0], 1000 * positions[:, 2], "-", colour, label, style={"lw": 1.1, **style})


def desired_path(points: Floats) -> Mark:
    """Return the desired path, to be under the others."""
    return path_of(points, SOFT, "desired", lw=3.0, alpha=0.3)
