"""The curve of eq. (11) through readings, and the time of flight of eq. (3)."""

import numpy as np
import pytest

from handover.controllers.ir_grasp.parameters import Params as ReflexParams
from handover.cosim.blocks.ports import Floats
from handover.scenarios.ir_grasp.sensor_curve import (
    Fit,
    apparent_distance,
    controller_curve,
    fit_curve,
    rank_correlation,
    time_of_flight,
)

TICKS = np.linspace(150.0, 3600.0, 300)


def read_at(distance: Floats, curve: Fit) -> Floats:
    """Return the readings of a curve at distances, by interpolation."""
    x = np.linspace(0.0, 4095.0, 20_000)
    return np.interp(-distance, -curve.distance(x), x)


def test_a_fit_finds_the_constants_that_made_the_readings():
    curve = Fit(0.055, -0.0035, 0.025, -0.0005)
    fit = fit_curve(curve.distance(TICKS), TICKS)
    assert fit is not None
    assert (fit.a, fit.b, fit.c, fit.d) == pytest.approx((curve.a, curve.b, curve.c, curve.d), rel=1e-4)
    assert fit.residual < 1e-8


def test_the_steeper_exponential_comes_first_whichever_the_readings_are_of():
    swapped = Fit(0.025, -0.0005, 0.055, -0.0035)
    fit = fit_curve(swapped.distance(TICKS), TICKS)
    assert fit is not None
    assert fit.a == pytest.approx(0.055, rel=1e-4)


def test_readings_out_of_range_or_at_the_converters_end_are_left_out():
    distance, ticks = controller_curve().distance(TICKS), TICKS
    beside = [*distance.tolist(), 0.08, 0.003, 0.01, 0.02], [*ticks.tolist(), 900.0, 900.0, 4095.0, 0.0]
    assert fit_curve(*beside) == fit_curve(distance, ticks)


def test_there_is_no_fit_to_a_few_readings():
    assert fit_curve(controller_curve().distance(TICKS[:5]), TICKS[:5]) is None


def test_what_the_curve_puts_beyond_the_range_is_not_seen():
    edge = ReflexParams().calibration.ticks(ReflexParams().distance_max)
    assert np.isnan(apparent_distance(np.array([0.0, edge - 1.0]))).all()
    assert apparent_distance(np.array([edge + 1.0])) == pytest.approx(ReflexParams().distance_max, abs=3e-4)


def test_a_dark_face_keeps_the_order_of_distances_and_a_saturated_reading_loses_it():
    distance = np.linspace(0.010, 0.050, 200)
    ticks = read_at(distance, controller_curve())
    assert rank_correlation(distance, 0.6 * ticks) == pytest.approx(1.0)
    assert rank_correlation(distance, np.minimum(ticks, 300.0)) < 0.9
    assert np.isnan(rank_correlation(distance[:2], ticks[:2]))


def test_light_flies_a_millimetre_and_back_in_7_picoseconds():
    assert time_of_flight(np.array([1e-3]))[0] == pytest.approx(6.671e-12, rel=1e-4)
    assert time_of_flight(np.array([0.3]), speed=2.0)[0] == pytest.approx(0.3)
