"""The minimum-jerk course of a hand."""

import numpy as np
import pytest

from handover.plants.hand_motion import minimum_jerk


def test_a_minimum_jerk_course_begins_and_ends_at_rest():
    s = np.linspace(0.0, 1.0, 1001)
    way = np.array([minimum_jerk(x) for x in s])
    speed = np.gradient(way, s, edge_order=2)
    acceleration = np.gradient(speed, s, edge_order=2)
    np.testing.assert_allclose(way[[0, 500, 1000]], [0.0, 0.5, 1.0], atol=1e-15)
    np.testing.assert_allclose(speed[[0, -1]], [0.0, 0.0], atol=1e-3)
    np.testing.assert_allclose(acceleration[[0, -1]], [0.0, 0.0], atol=0.1)  # 5.8 at most between
    assert speed.max() == pytest.approx(1.875, rel=1e-5)


def test_before_and_after_its_time_the_hand_stands_still():
    assert [minimum_jerk(s) for s in (-0.5, 1.5)] == [0.0, 1.0]
