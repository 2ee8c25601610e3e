"""Medians of points: one value for figures and tables, with an interval where it says something."""

import math

import pytest
from campaigns import results_of

from handover.scenarios.campaign.results import CampaignResults
from handover.scenarios.campaign.statistics import time_interval


def moved(points: int, values: list[float]) -> CampaignResults:
    return results_of("ir_grasp", [{"forward": f"{k}"} for k in range(points)], len(values), moved=values * points)


def test_a_median_has_its_bootstrapped_interval_and_is_made_once():
    results = moved(1, [0.1, 0.2, 0.4, math.nan])
    assert results.median(results.points[0], "moved") == 0.2
    found = results.median_interval(results.points[0], "moved")
    assert found == time_interval([0.1, 0.2, 0.4])
    assert results.median_interval(results.points[0], "moved") is found


@pytest.mark.parametrize(("points", "values"), [(1, [0.2, 0.2, 0.2]), (1, [0.1, 0.3]), (151, [0.1, 0.2, 0.3])])
def test_there_is_no_interval_that_says_nothing_or_takes_too_long(points: int, values: list[float]):
    results = moved(points, values)
    assert results.median(results.points[0], "moved") == pytest.approx(0.2)
    assert results.median_interval(results.points[0], "moved") is None


def test_there_is_no_median_of_no_values():
    results = moved(1, [math.nan, math.nan])
    assert math.isnan(results.median(results.points[0], "moved"))
