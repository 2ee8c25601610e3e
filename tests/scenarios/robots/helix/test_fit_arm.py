"""The closed loop that the arm is fitted by, and what scaling an arm does."""

import numpy as np
import pytest

from handover.plants.helix.arm.tendon_parameters import Params
from handover.scenarios.robots.helix.fit_arm import FACTORS, approach, described, places_at, scaled_arm

FRONT = np.array([0.16, 0.0, -0.6])


def test_factors_scale_what_they_are_named_after():
    arm, p = Params(), scaled_arm(np.array([0.5, 0.7, 0.5, 2.0]), Params())
    assert pytest.approx((0.5, 0.7)) == (p.EI / arm.EI, p.EA / arm.EA)
    assert p.natural_length == pytest.approx([0.13, 0.251, 0.251])
    assert (p.gripper_mass, p.plate_mass[2], p.segment_mass[1]) == pytest.approx((0.2, 0.1, 0.32))
    assert p.tendon_length == pytest.approx(arm.tendon_length)


def test_an_arm_that_weighs_nothing_goes_where_its_command_says_and_another_leaves_its_model_behind():
    loaded, free = (approach(Params(gravity=g), FRONT) for g in (Params().gravity, 0.0))
    assert (loaded.closes, free.closes) == (True, True)
    assert free.end[2] < 0.015 < 0.07 < loaded.end[2]
    lengths = loaded.lengths
    assert lengths[0] == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert lengths[10, 2] > lengths[5, 2] > lengths[1, 2] > 0.0001
    low, high = np.sort(lengths[-2:], axis=0)
    assert np.all((low <= loaded.end) & (loaded.end <= high))


@pytest.mark.slow
def test_an_arm_that_sags_more_is_farther_from_its_model_at_every_place():
    ones = np.ones(len(FACTORS))
    places = places_at(0.16, -0.6)[2:3]
    usual, heavy = (described(factors, places, Params()) for factors in (ones, ones * [1.0, 1.0, 1.0, 1.5]))
    for a, b in zip(usual.approaches, heavy.approaches, strict=True):
        assert b.end[2] > 1.2 * a.end[2]
    assert heavy.ends.apart == pytest.approx(np.mean([a.end[2] for a in heavy.approaches]))
