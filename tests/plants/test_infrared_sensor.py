import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.wording import Wording

from handover.plants.infrared_sensor import InfraredSensor, InvalidSensorParameters

CURVE = {"a": 0.062, "b": -0.0030, "c": 0.022, "d": -0.00043}
USUAL = CURVE | {"nearest": 0.004, "farthest": 0.065, "contact": 0.4, "exponent": 1.0}
SENSOR = InfraredSensor(**USUAL)


def sensor(**changes: Any) -> InfraredSensor:
    return InfraredSensor(**(USUAL | changes))


def test_characteristic_is_the_sum_of_two_exponentials():
    assert SENSOR.distance(0.0) == pytest.approx(0.084)
    assert SENSOR.distance(1000.0) == pytest.approx(0.062 * math.exp(-3.0) + 0.022 * math.exp(-0.43))


@given(st.floats(0.004, 0.065))
def test_ticks_are_the_inverted_characteristic_and_a_reading_says_the_distance_to_within_a_tick(
    distance: float,
):
    ticks = SENSOR.ticks(distance, 1.0, 1.0)
    assert SENSOR.distance(ticks) == pytest.approx(distance, abs=2e-7)
    reading = SENSOR.reading(ticks)
    tick = abs(SENSOR.distance(reading + 1.0) - SENSOR.distance(reading))
    assert SENSOR.distance(reading) == pytest.approx(distance, abs=tick)


def test_a_slanted_or_darker_surface_returns_less():
    square = SENSOR.ticks(0.02, 1.0, 1.0)
    assert SENSOR.ticks(0.02, 0.5, 1.0) == pytest.approx(0.5 * square)
    assert sensor(exponent=2.0).ticks(0.02, 0.5, 1.0) == pytest.approx(0.25 * square)
    assert SENSOR.ticks(0.02, 1.0, 0.8) == pytest.approx(0.8 * square)
    assert SENSOR.ticks(0.02, 0.5, 0.8) == pytest.approx(0.4 * square)


def test_nothing_comes_back_from_afar_or_from_a_surface_that_looks_away():
    assert SENSOR.ticks(0.0651, 1.0, 1.0) == 0.0
    assert SENSOR.ticks(0.0649, 1.0, 1.0) > 100.0
    assert SENSOR.ticks(0.02, 0.0, 1.0) == 0.0
    assert SENSOR.ticks(0.02, -0.3, 1.0) == 0.0


def test_readings_fold_back_near_contact():
    x = [SENSOR.ticks(d, 1.0, 1.0) for d in np.linspace(0.004, 0.0, 9)]
    entries = [SENSOR.distance(t) for t in x]
    assert all(np.diff(x) < 0.0)
    assert all(np.diff(entries) > 0.0)
    assert x[0] == pytest.approx(max(SENSOR.ticks(d, 1.0, 1.0) for d in np.linspace(0.0, 0.065, 1001)), rel=6e-3)
    assert x[-1] == pytest.approx(0.4 * x[0])
    assert SENSOR.ticks(-0.001, 1.0, 1.0) == x[-1]


@given(st.floats(-1e6, 1e6))
def test_a_reading_is_a_whole_number_of_12_bits(ticks: float):
    reading = SENSOR.reading(ticks)
    assert reading == round(reading)
    assert 0.0 <= reading <= 4095.0


@pytest.mark.parametrize(
    ("changes", "faults"),
    [
        ({"b": 0.003, "nearest": 0.0}, 3),
        ({"c": -0.022}, 2),
        ({"farthest": 0.09}, 1),
        ({"nearest": 0.003}, 1),
        ({"nearest": 0.065, "farthest": 0.004}, 1),
    ],
)
def test_a_characteristic_that_cannot_be_inverted_is_refused(changes: dict[str, float], faults: int, wording: Wording):
    with pytest.raises(InvalidSensorParameters) as caught:
        sensor(**changes)
    assert len(caught.value.faults) == faults
    wording.check(caught.value)
