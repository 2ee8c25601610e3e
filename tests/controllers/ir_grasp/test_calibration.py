import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handover.controllers.ir_grasp.parameters import Calibration

CURVE = Calibration(0.062, -0.0030, 0.022, -0.00043)


def test_the_distance_is_equation_11():
    assert CURVE.distance(0.0) == pytest.approx(0.084)
    assert CURVE.distance(1000.0) == pytest.approx(0.062 * math.exp(-3.0) + 0.022 * math.exp(-0.43))
    assert CURVE.distance(4095.0) < 0.004 < 0.065 < CURVE.distance(0.0)


@given(st.floats(0.0, 4095.0))
def test_ticks_are_the_inverse_of_the_distance_and_distances_beyond_the_curve_are_at_its_ends(x: float):
    assert CURVE.ticks(CURVE.distance(x)) == pytest.approx(x, abs=1e-6)
    assert (CURVE.ticks(1.0), CURVE.ticks(0.0)) == pytest.approx((0.0, 4095.0))


def test_a_curve_that_does_not_fall_is_refused():
    assert CURVE.faults() == []
    assert [fault[:2] for fault in Calibration(-0.062, 0.003, 0.022, -0.00043).faults()] == ["a ", "b "]
