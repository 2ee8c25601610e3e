"""Evaluates how well the tip followed its path, by the tracker, which the arm's controller does not see.

A `PathPoint` is kept for each desired point, with the arm's positions at the end of the time allotted to it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from handover.cosim.blocks.ports import Floats
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import PlacedUnit
from handover.scenarios.experiment.experiment import Evaluator, Metric, Outcome
from handover.scenarios.robots.vsl.arms import arm_of, unlike_lengths
from handover.scenarios.robots.vsl.parameters import HybridParameters, Parameters
from handover.scenarios.robots.vsl.training_data import beyond_loads, is_heavy


def _point(signals: Signals, name: str) -> Floats:
    """Return a position, NaN where the controller does not give it."""
    return signals[name] if name in signals else np.full(3, np.nan)


@dataclass(frozen=True)
class PathPoint:
    """Positions of the tip at time t, each of shape (3,), in W, m.

    Attributes:
        t: time, s.
        desired: the point that the arm was commanded to reach.
        tracked: the tip by the tracker.
        true: the tip itself.
        servo: the tip by encoders and rigid links; NaN where the controller does not give it.
        estimated: the tip by the forward model; likewise.
        outside: whether the learned model had to extrapolate; None where the controller does not say.
        mismatch: whether a sensor tells that the arm is not the one learned from; None where none is looked at.
    """

    t: float
    desired: Floats
    tracked: Floats
    true: Floats
    servo: Floats
    estimated: Floats
    outside: bool | None
    mismatch: bool | None = None

    @classmethod
    def take(cls, t: float, desired: Floats, signals: Signals, *, monitored: bool) -> "PathPoint":
        """Return the point with the current positions; if monitored, a sensor may tell of a mismatch."""
        return cls(
            t,
            desired,
            signals["arm.p_WG_meas"],
            signals["arm.p_WG"],
            _point(signals, "kinematics.p_WG_model"),
            _point(signals, "kinematics.p_WG_est"),
            bool(signals["kinematics.outside"]) if "kinematics.outside" in signals else None,
            bool(signals["kinematics.model_mismatch"])
            if monitored and "kinematics.model_mismatch" in signals
            else None,
        )

    @property
    def reach(self) -> float:
        """Horizontal distance of the desired point from the first joint's axis, m."""
        return float(np.hypot(self.desired[0], self.desired[1]))

    @property
    def error(self) -> float:
        """Distance of the tracked tip from the desired point, m."""
        return distance(self.tracked, self.desired)


def distance(p: Floats, q: Floats) -> float:
    """Return the distance between two points, m."""
    return float(np.linalg.norm(p - q))


def distance_to_path(p: Floats, path: Floats) -> float:
    """Return the distance of a point from the polyline through two or more points, shape (n, 3), m."""
    start, along = path[:-1], np.diff(path, axis=0)
    squares = np.maximum(np.sum(along**2, axis=1), np.finfo(np.float64).tiny)  # for legs without length: their start
    share = np.clip(np.sum((p - start) * along, axis=1) / squares, 0.0, 1.0)
    return float(np.min(np.linalg.norm(start + share[:, None] * along - p, axis=1)))


EXTRAPOLATION_TO_REPORT = 0.1
"""Share of points at which a model had to extrapolate from which on the verdict says so (assumed)."""

_REACH_SPAN = 0.01
"""Paths that reach equally far throughout, to this many metres, have no near and far part (assumed)."""


class PathEvaluator(Evaluator):
    """Follows one run along a path and measures how far the tip was from it.

    A point is measured at the instant at which the planner proceeds to the next: the arm had time until then.

    Attributes:
        points: the path's points in order, with the arm's positions.
        completed: time at which the path was completed, s; None before.
    """

    records = (PathPoint,)

    def __init__(self, parameters: Parameters, *, hybrid: bool) -> None:
        self.parameters, self.hybrid = parameters, hybrid
        self.points: list[PathPoint] = []
        self.completed: float | None = None
        self._monitored = isinstance(parameters, HybridParameters) and parameters.is_monitored
        self._lengths = ""
        self._began: float | None = None
        self._t = 0.0
        self._start: Floats = np.zeros(3)
        self._segment = 0
        self._goal: Floats | None = None
        self._moving = False
        self._lowest = math.inf

    def note_units(self, units: Mapping[str, PlacedUnit]) -> None:
        """Keep which links are not as long as planner and kinematics assume."""
        self._lengths = unlike_lengths(units)

    def __call__(self, t: float, signals: Signals) -> None:
        """Follow the planner; keep a point when the planner proceeds to the next."""
        goal, moving = signals["planner.p_WG_goal"], bool(signals["planner.moving"])
        if self._goal is not None and self._moving and not (moving and np.array_equal(goal, self._goal)):
            point = PathPoint.take(t, self._goal, signals, monitored=self._monitored)
            held = self.parameters.loads().at(t)
            load = self.parameters.load if held is None else held[0]
            if point.outside is not None and self.hybrid:
                point = replace(point, outside=point.outside or is_heavy(load))
            self.points.append(point)
        if moving and self._began is None:
            self._began = t
            self._start = goal if self._goal is None else self._goal
        if bool(signals["planner.done"]) and self.completed is None:
            self.completed = t
        self._t, self._goal, self._moving = t, goal, moving
        self._lowest = min(self._lowest, float(np.min(signals["arm.shape"][1:, 2])))  # without the base
        self._segment = int(signals["planner.segment"])

    @property
    def path(self) -> Floats:
        """The path as far as it was followed: its start and its points, shape (n, 3), in W, m."""
        return np.array([self._start, *(p.desired for p in self.points)])

    @property
    def over(self) -> bool:
        """Whether the path was completed."""
        return self.completed is not None

    def outcome(self) -> Outcome:
        """Return whether the path was completed within the tolerance and above the ground, and the errors along it."""
        metrics = {**(self._metrics() if self.points else {}), **arm_of(self.parameters).metrics}
        within = "mean_error" in metrics and metrics["mean_error"].value <= self.parameters.tolerance
        return Outcome(
            success=self.over and within and self._lowest >= 0.0, reason=self._reason(metrics), metrics=metrics
        )

    def _reason(self, metrics: dict[str, Metric]) -> str:
        if self.completed is None:
            if self._began is None:
                return f"stopped at {self._t:.1f} s, before the path began"
            passed = f"{len(self.points)} of the path's {self.parameters.points_in_all} points visited"
            return f"stopped at {self._t:.1f} s in segment {self._segment} of the path, {passed}"
        if "mean_error" not in metrics:
            return f"the path was completed at {self.completed:.1f} s without a point on it"
        error, tolerance = metrics["mean_error"].value, self.parameters.tolerance
        verdict = "within" if error <= tolerance else "above"
        digits = 1 if f"{1000 * error:.1f}" != f"{1000 * tolerance:.1f}" else 3
        share = metrics["outside"].value if "outside" in metrics else 0.0
        beyond = ""
        if share >= EXTRAPOLATION_TO_REPORT:
            beyond = f"; the model had to extrapolate at {100 * share:.0f} % of the points"
            beyond += beyond_loads(max([self.parameters.load, *self.parameters.masses]))
        return (
            f"the path was completed at {self.completed:.1f} s; mean error of the tip {1000 * error:.{digits}f} mm, "
            f"{verdict} the tolerance of {1000 * tolerance:.{digits}f} mm{beyond}{self._dip}{self._lengths}"
        )

    @property
    def _dip(self) -> str:
        """How far the arm was below the ground, which is no obstacle in the simulation, as a clause of the reason."""
        if self._lowest >= 0.0:
            return ""
        return f"; a real arm would have struck the ground: the links dipped {-self._lowest * 1000:.1f} mm below it"

    def _metrics(self) -> dict[str, Metric]:
        path = self.path
        metrics = {
            **_distribution([p.error for p in self.points]),
            "mean_error_true": self._mean(lambda p: distance(p.true, p.desired), "mean error of the tip, ground truth"),
            "path_distance": self._mean(
                lambda p: distance_to_path(p.tracked, path), "mean distance of the tip, by the tracker, from the path"
            ),
            **self._over_reach(),
        }
        if np.isfinite(self.points[0].servo).all():
            metrics["servo_error"] = self._mean(
                lambda p: distance(p.servo, p.desired), "mean error by the encoders, links taken as rigid"
            )
            metrics["model_error"] = self._mean(
                lambda p: distance(p.servo, p.true), "mean error of the rigid-link model's estimate of the tip"
            )
        if self.hybrid and np.isfinite(self.points[0].estimated).all():
            metrics["estimate_error"] = self._mean(
                lambda p: distance(p.estimated, p.true), "mean error of the hybrid forward model's estimate of the tip"
            )
        if self.hybrid and self.points[0].outside is not None:
            metrics["outside"] = self._mean(
                lambda p: float(bool(p.outside)), "share of points at which the model had to extrapolate", "1"
            )
        if self.points[0].mismatch is not None:
            metrics["model_mismatch"] = self._mean(
                lambda p: float(bool(p.mismatch)),
                "share of points at which a sensor showed that the arm is not the one that was learned from",
                "1",
            )
        visited = f"points visited of the path's {self.parameters.points_in_all}"
        if self.completed is not None and len(self.points) < self.parameters.points_in_all:
            visited += "; the others fell between two periods of the planner"
        metrics["points_visited"] = Metric(len(self.points), "1", visited)
        metrics["lowest"] = Metric(self._lowest, "m", "height of the links' lowest point above the ground, z in W")
        if self.completed is not None and self._began is not None:
            metrics["path_time"] = Metric(self.completed - self._began, "s", "time on the path")
        return metrics

    def _over_reach(self) -> dict[str, Metric]:
        """Return the errors of the third of the points that are nearest to the base and of the farthest third."""
        order = sorted(self.points, key=lambda p: p.reach)
        if order[-1].reach - order[0].reach < _REACH_SPAN:
            return {}
        n = max(1, len(order) // 3)
        near, far = (float(np.mean([p.error for p in part])) for part in (order[:n], order[-n:]))
        return {
            "error_near": Metric(near, "m", "mean error of the tip over the third of the points nearest to the base"),
            "error_far": Metric(far, "m", "mean error of the tip over the third of the points farthest from the base"),
        }

    def _mean(self, of: Callable[[PathPoint], float], description: str, unit: str = "m") -> Metric:
        return Metric(float(np.mean([of(p) for p in self.points])), unit, description)


def _distribution(errors: Sequence[float]) -> dict[str, Metric]:
    low, middle, high = (float(x) for x in np.percentile(errors, (25, 50, 75)))
    of_tip = "distance of the tip, by the tracker, from the desired point"
    return {
        "mean_error": Metric(float(np.mean(errors)), "m", f"mean {of_tip}"),
        "median_error": Metric(middle, "m", f"median {of_tip}"),
        "error_p25": Metric(low, "m", f"25th percentile of the {of_tip}"),
        "error_p75": Metric(high, "m", f"75th percentile of the {of_tip}"),
        "max_error": Metric(float(np.max(errors)), "m", f"largest {of_tip}"),
    }
