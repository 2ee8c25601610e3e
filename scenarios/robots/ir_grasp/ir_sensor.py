"""One of the soft hand's infrared sensors comes to the face of a box, as one takes a sensor's curve. [Luberto] fig. 8.

There is no controller: the wrist goes to one place at a constant speed, and what the sensor reads is recorded beside
the distance along its beam.
"""

import enum
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import ClassVar

import numpy as np

from handover.cosim.blocks.origins import assumed
from handover.cosim.blocks.ports import Floats, parameter
from handover.cosim.blocks.units import Metre, MetrePerSecond, Number, Radian
from handover.cosim.record.reader import Record
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.plants.ir_grasp.hand import JOINTS, sensor_rays
from handover.plants.ir_grasp.objects import SOLIDS, Thing
from handover.plants.ir_grasp.parameters import OUT_OF_RANGE
from handover.plants.ir_grasp.shapes import Rectangle
from handover.scenarios.experiment.experiment import Evaluator, Experiment, FmuOf, Metric, Outcome
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.experiment.places import Place
from handover.scenarios.experiment.replay import Replay
from handover.scenarios.experiment.time_plot import TimeFigure
from handover.scenarios.robots.ir_grasp.places import PLACE_OF_SENSORS
from handover.scenarios.robots.ir_grasp.sensor_curve import (
    apparent_distance,
    fit_curve,
    in_order_of_scans,
    rank_correlation,
)

THING = Thing.PAPER_BOX_A
"""What has the face: flat, and wide enough for the whole beam."""

AT: Mapping[str, float] = {f"apparent_at_{mm}_mm": mm / 1000 for mm in (10, 20, 30, 40, 60)}
"""Metrics of the distance that the controller's curve gives, by name: at which distance, m."""

_AT_REST = 0.2
"""How long the hand stays at its place before the run ends, s (assumed)."""

_ARRIVED = 1e-4
"""Distance of the wrist from its place at which it has come there, m (assumed)."""


class Finger(enum.IntEnum):
    """Whose sensor is looked at, in the order of ticks and ranges."""

    THUMB = 0
    INDEX = 1
    RING = 2


@dataclass(frozen=True, kw_only=True)
class SensorParameters:
    """One approach to a face."""

    finger: Finger = parameter(
        Finger.THUMB,
        "whose sensor looks at the face",
        origin=assumed("fig. 8 is of one sensor; of which is not stated"),
    )
    reflectivity: Number = parameter(
        1.0,
        "reflectivity of the face over that of the surface the curve is of",
        minimum=0.01,
        maximum=2.0,
        origin=assumed("not given; of what fig. 8 was taken is not stated"),
    )
    incidence: Radian = parameter(
        0.0,
        "angle between the beam and the normal of the face, which is met whole",
        minimum=-0.4,
        maximum=0.4,
        origin=assumed("not given; squarely"),
    )
    first: Metre = parameter(
        0.085,
        "distance of the sensor from the face at the start",
        minimum=0.01,
        maximum=0.15,
        origin=assumed("not given; beyond the operating range of sec. V-B"),
    )
    last: Metre = parameter(
        0.010,
        "distance at the end; nearer than about 9 mm another finger than the index touches",
        minimum=0.0,
        origin=assumed("not given; where no finger touches the box, and the reflex's target distance"),
    )
    speed: MetrePerSecond = parameter(
        0.005, "speed of the approach", minimum=1e-3, maximum=0.1, origin=assumed("not given; 0.08 mm between scans")
    )


def bench_pose(p: SensorParameters, distance: float) -> tuple[Floats, float]:
    """Return wrist, (2,) in m, and heading, rad, in W at which the sensor is so far, in m, from the face.

    The beam comes along x of W, with the open hand's joints at 0, and meets the middle of the face that the box turns
    to it.
    """
    origins, directions = sensor_rays(np.zeros(2), 0.0, np.zeros(JOINTS))
    yaw = -math.atan2(directions[p.finger, 1], directions[p.finger, 0])
    origins, _ = sensor_rays(np.zeros(2), yaw, np.zeros(JOINTS))
    box = SOLIDS[THING].parts[0]
    assert isinstance(box, Rectangle), "the box has flat faces"
    return np.array([box.low[0] / math.cos(p.incidence) - distance, 0.0]) - origins[p.finger], yaw


class SensorEvaluator(Evaluator):
    """Follows one approach: whether the hand came to its place and touched nothing.

    Metrics are the fit of eq. (11) to its readings, and what the controller's curve makes of them: where they are at
    the distances of `AT`, and whether they are in the order of the distances.
    """

    records = (Metric,)

    def __init__(self, parameters: SensorParameters) -> None:
        self.parameters = parameters
        self._t, self._arrived = 0.0, math.nan
        self._distance, self._touched = math.inf, False
        self._first_seen = math.nan
        self._apparent: dict[str, float] = {}
        self._readings: tuple[list[float], list[float]] = ([], [])

    def __call__(self, t: float, signals: Signals) -> None:
        """Take in distance and reading."""
        p, self._t = self.parameters, t
        before, self._distance = self._distance, float(signals["scene.range"][p.finger])
        self._touched = self._touched or int(signals["scene.touching"]) > 0
        ticks = float(signals["scene.ticks"][p.finger])
        if max(before, self._distance) < OUT_OF_RANGE:
            at_scan = in_order_of_scans(np.array(before), np.array(self._distance), p.finger)
            self._readings[0].append(float(at_scan))
            self._readings[1].append(ticks)
        apparent = float(apparent_distance(np.array(ticks)))
        if math.isnan(self._first_seen) and math.isfinite(apparent):
            self._first_seen = self._distance
        for name, at in AT.items():
            if name not in self._apparent and self._distance <= at:
                self._apparent[name] = apparent
        goal, _ = bench_pose(p, p.last)
        if math.isnan(self._arrived) and float(np.linalg.norm(signals["scene.p_WH"] - goal)) < _ARRIVED:
            self._arrived = t

    @property
    def over(self) -> bool:
        """Whether the hand has rested at its place."""
        return self._t >= self._arrived + _AT_REST

    def outcome(self) -> Outcome:
        """Return whether the sensor came to the face without a touch, and the errors of the curve."""
        metrics = {
            "last_distance": Metric(self._distance, "m", "sensor to face along the beam at the end"),
            "first_seen": Metric(self._first_seen, "m", "distance at which the curve first put the face in range"),
        }
        for name, at in AT.items():
            value = self._apparent.get(name, math.nan)
            metrics[name] = Metric(value, "m", f"distance by [Luberto] eq. (11) where it is {1000 * at:g} mm")
        metrics.update(_curve_metrics(*self._readings))
        who = self.parameters.finger.name.lower()
        if self._touched:
            reason = "the hand touched the box: choose a larger `last`"
        elif math.isnan(self._arrived):
            reason = f"the {who}'s sensor was still {1000 * self._distance:.1f} mm from the face at {self._t:.1f} s"
        else:
            reason = f"the {who}'s sensor came to {1000 * self._distance:.1f} mm from the face and touched nothing"
            if math.isnan(self._first_seen):
                reason += "; it returns so little light that the curve never put it in range"
        return Outcome(success=not math.isnan(self._arrived) and not self._touched, reason=reason, metrics=metrics)


def _curve_metrics(distance: list[float], ticks: list[float]) -> dict[str, Metric]:
    """Return the constants of eq. (11) fitted to readings, NaN without a fit, and the order of the distances by it."""
    fit, of = fit_curve(distance, ticks), "fitted to the readings, [Luberto] eq. (11)"
    a, b, c, d, residual = (math.nan,) * 5 if fit is None else (fit.a, fit.b, fit.c, fit.d, fit.residual)
    return {
        "fit_a": Metric(a, "m", f"a {of}"),
        "fit_b": Metric(b, "1/tick", f"b {of}"),
        "fit_c": Metric(c, "m", f"c {of}"),
        "fit_d": Metric(d, "1/tick", f"d {of}"),
        "fit_residual": Metric(residual, "m", "root mean square of distances from the fit"),
        "rank_correlation": Metric(
            rank_correlation(distance, ticks), "1", "rank correlation of distances by the controller's curve with true"
        ),
    }


class IrSensor(Experiment[SensorEvaluator]):
    """One sensor of the hand approaches a flat face: the bench of [Luberto] fig. 8."""

    name: ClassVar[str] = "ir_sensor"
    title: ClassVar[str] = "an infrared sensor on a soft hand approaches a face, as its curve is taken"
    parameters_type: ClassVar[type[SensorParameters]] = SensorParameters
    units: ClassVar[Mapping[str, str]] = {"scene": "GraspScene"}
    places: ClassVar[Mapping[str, Place]] = {"scene": PLACE_OF_SENSORS}
    headline: ClassVar[tuple[str, ...]] = ("first_seen", *AT, "fit_a", "fit_b", "fit_c", "fit_d", "fit_residual")

    def build(self, parameters: SensorParameters, seed: int, fmu: FmuOf) -> System:
        """Put the hand before the box.

        Raises:
            InvalidParameter: the approach would lead away from the face.
        """
        p = parameters
        if not p.last < p.first:
            raise InvalidParameter([f"last {p.last:g} m must be less than first {p.first:g} m"])
        start, yaw = bench_pose(p, p.first)
        s = System()
        s.add(
            "scene",
            fmu("scene"),
            thing=THING,
            yaw_O_0=p.incidence,
            p_WH_0=start,
            yaw_H_0=yaw,
            wrist_speed=p.speed,
            reflectivity=p.reflectivity,
            seed=int(np.random.SeedSequence(seed).generate_state(1)[0] >> 1),
            p_WH_cmd=bench_pose(p, p.last)[0],
            yaw_cmd=yaw,
        )
        return s

    def stop_time(self, parameters: SensorParameters) -> Fraction:
        """Return twice the time of the way, and some."""
        return Fraction(math.ceil(2.0 * (parameters.first - parameters.last) / parameters.speed) + 2)

    def evaluator(self, parameters: SensorParameters) -> SensorEvaluator:
        """Return the evaluator of one approach."""
        return SensorEvaluator(parameters)

    def time_figures(self, parameters: SensorParameters, record: Record) -> Sequence[TimeFigure]:
        """Return the reading, and the distance in truth and by the curve, over time."""
        from handover.scenarios.robots.ir_grasp.sensor_plots import figures_of_sensor  # matplotlib is slow to import

        return figures_of_sensor(parameters.finger, record)

    def replay(self, parameters: SensorParameters, record: Record) -> Replay:
        """Return hand, box and beams in space."""
        from handover.scenarios.robots.ir_grasp.sensor_plots import replay_sensor

        return replay_sensor(THING, parameters.finger, record)
