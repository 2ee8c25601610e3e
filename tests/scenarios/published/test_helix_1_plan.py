from collections import Counter

import pytest

from handover.scenarios.campaign.statistics import MIN_SAMPLES
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.parameters import parse_parameters
from handover.scenarios.published.helix_1 import Helix1

PERIODS = {"0.1": "1.38", "0.2": "1.51", "0.4": "1.45"}


def test_each_step_size_has_its_published_period_at_each_place_twice():
    plan = Helix1().plan(quick=False)
    assert plan.repetitions == 2
    seen = Counter((p["tuning"], p["alpha"], p["control_period"]) for p in plan.points)
    assert seen == {(tuning, *pair): 4 for tuning in ("thesis", "own") for pair in PERIODS.items()}
    assert len({tuple(p.values()) for p in plan.points}) == 24


def test_runs_may_take_longer_than_the_longest_published_one():
    assert float(Helix1().plan(quick=False).fixed["patience"]) > 2 * 214.9


def test_a_quick_one_has_each_step_size_as_often_as_intervals_need():
    plan = Helix1().plan(quick=True)
    assert Counter(p["alpha"] for p in plan.points) == dict.fromkeys(PERIODS, MIN_SAMPLES)
    assert plan.repetitions == 1
    assert {p["tuning"] for p in plan.points} == {"thesis"}


@pytest.mark.parametrize("quick", [False, True])
def test_the_scenario_takes_every_point(quick: bool):
    plan = Helix1().plan(quick)
    scenario = SCENARIOS[plan.scenario]
    for point in plan.points:
        assert parse_parameters(scenario, [f"{name}={value}" for name, value in {**plan.fixed, **point}.items()])
