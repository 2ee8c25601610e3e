import math

import numpy as np
import pytest

from handover.scenarios.published.verdicts import ratio_interval


def test_the_interval_holds_the_ratio_and_narrows_with_more_values():
    rng = np.random.default_rng(1)
    few, many = (ratio_interval(rng.normal(40, 4, n), rng.normal(20, 2, n), np.mean) for n in (8, 200))
    assert few is not None
    assert many is not None
    assert few[0] < 2.0 < few[1]
    assert many[1] - many[0] < 0.4 * (few[1] - few[0])


def test_it_is_the_normal_one_where_both_means_are_certain_enough():
    """By the delta method: the ratio's standard error is ratio sqrt(cv_x^2 / n + cv_y^2 / n)."""
    rng = np.random.default_rng(2)
    x, y = rng.normal(40, 4, 100), rng.normal(20, 2, 100)
    low, high = ratio_interval(x, y, np.mean) or (0.0, 0.0)
    (a, da), (b, db) = ((float(np.mean(v)), float(np.std(v)) / 10.0) for v in (x, y))
    error = a / b * math.hypot(da / a, db / b)
    assert high - low == pytest.approx(2 * 1.96 * error, rel=0.1)


def test_nothing_can_be_divided_by_a_spread_of_nothing():
    assert ratio_interval(np.array([1.0, 2.0, 3.0]), np.full(3, 5.0), np.std) is None
    assert ratio_interval(np.full(3, 5.0), np.full(3, 5.0), np.std) is None
