"""The curve through a sensor's readings, y = a e^(b x) + c e^(d x): [Luberto] eq. (11), and the flight of eq. (3)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.cosim.record.reader import Record
from handover.plants.ir_grasp.parameters import OUT_OF_RANGE
from handover.scenarios.experiment.paper import paper_values

_SENSORS = 3
_FULL_SCALE = 4095
_LIGHT_SPEED = 299_792_458.0  # m/s
_START = (60.0, -3.0, 20.0, -0.4)
"""Where fits begin, in mm and 1/1000 ticks, so that the four constants are of similar size."""

_MIN_READINGS = 8


@dataclass(frozen=True)
class Fit:
    """Distance y in m over readings x in ticks, by least squares in y; |b| >= |d|.

    Attributes:
        a, b, c, d: constants of eq. (11), m and 1/tick.
        residual: root mean square of the distances, m.
        n: readings.
    """

    a: float
    b: float
    c: float
    d: float
    residual: float = 0.0
    n: int = 0

    def distance(self, ticks: Floats) -> Floats:
        """Return distances in m."""
        return self.a * np.exp(self.b * ticks) + self.c * np.exp(self.d * ticks)


def controller_curve() -> Fit:
    """Return the one curve that the controller has for all its sensors and all objects."""
    c = ReflexParams().calibration
    return Fit(c.a, c.b, c.c, c.d)


def in_order_of_scans(before: Floats, after: Floats, finger: int) -> Floats:
    """Return distances at the instant of a finger's scan, between those at a step's beginning and end.

    A step of the scene has a scan of each sensor, one after the other.
    """
    return before + (finger + 1) / _SENSORS * (after - before)


def readings_of(record: Record, finger: int) -> tuple[Floats, Floats]:
    """Return distances along the beam, m, and readings, ticks, of all scans in which the beam met something."""
    distance, ticks = record["scene.range"][:, finger], record["scene.ticks"][:, finger]
    met = np.maximum(distance[:-1], distance[1:]) < OUT_OF_RANGE
    return in_order_of_scans(distance[:-1], distance[1:], finger)[met], ticks[1:][met]


def apparent_distance(ticks: Floats) -> Floats:
    """Return distances by the controller's curve, m; NaN where they are beyond its range: nothing is seen there."""
    y = controller_curve().distance(ticks)
    return np.where(y <= ReflexParams().distance_max, y, np.nan)


def fit_curve(distance: Sequence[float] | Floats, ticks: Sequence[float] | Floats) -> Fit | None:
    """Return the fit to readings (ticks) at distances (m).

    It takes those from the nearest of the operating range to epsilon, where the whole beam is in range, that are
    neither 0 nor the converter's largest. None if they are too few, or the fit does not converge.
    """
    from scipy.optimize import curve_fit  # slow to import, and most who import this fit nothing

    near, far = paper_values("ir_grasp", "published")["sensor_range"][0], ReflexParams().epsilon
    y, x = 1e3 * np.asarray(distance, dtype=np.float64), np.asarray(ticks, dtype=np.float64) / 1e3
    kept = (y >= 1e3 * near) & (y <= 1e3 * far) & (x > 0.0) & (x < _FULL_SCALE / 1e3)
    if np.count_nonzero(kept) < _MIN_READINGS:
        return None
    try:
        found, _ = curve_fit(_eq_11, x[kept], y[kept], p0=_START, bounds=([0, -200, 0, -200], [500, 0, 500, 0]))
    except RuntimeError:  # it has not converged
        return None
    a, b, c, d = (float(v) for v in found)
    if b > d:
        a, b, c, d = c, d, a, b
    error = _eq_11(x[kept], a, b, c, d) - y[kept]
    residual = float(np.sqrt(np.mean(error**2)))
    return Fit(a / 1e3, b / 1e3, c / 1e3, d / 1e3, residual / 1e3, int(np.count_nonzero(kept)))


def _eq_11(x: Floats, a: float, b: float, c: float, d: float) -> Floats:
    return a * np.exp(b * x) + c * np.exp(d * x)


def rank_correlation(distance: Sequence[float] | Floats, ticks: Sequence[float] | Floats) -> float:
    """Return Spearman's rank correlation of the distances by the controller's curve with the true ones.

    It takes those from the reflex's target to epsilon that are seen; NaN of fewer than three.
    """
    from scipy import stats

    far = ReflexParams().epsilon
    d, apparent = np.asarray(distance, dtype=np.float64), apparent_distance(np.asarray(ticks, dtype=np.float64))
    kept = (d >= ReflexParams().target) & (d <= far) & np.isfinite(apparent)
    if np.count_nonzero(kept) < 3:
        return float("nan")
    found: Any = stats.spearmanr(d[kept], apparent[kept])
    return float(found.statistic)


def time_of_flight(distance: Floats, speed: float = _LIGHT_SPEED) -> Floats:
    """Return how long a wave at a speed, m/s, flies over a distance, m, and back, s: t_f = 2 d / v of eq. (3)."""
    return 2.0 * distance / speed
