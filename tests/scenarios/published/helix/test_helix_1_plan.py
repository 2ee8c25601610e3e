from collections import Counter

from support.scenarios.made_tables import made_table

from handover.scenarios.campaign.plan_check import checked_plan
from handover.scenarios.campaign.statistics import MIN_SAMPLES
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.helix.helix_1_spread import fitted_rows, undisturbed

PERIODS = {"0.1": "1.38", "0.2": "1.51", "0.4": "1.45"}


def test_the_fitted_arm_is_tried_as_the_shipped_one_and_its_runs_are_found_again():
    plan = checked_plan(Helix1().plan(quick=False))
    fitted = [p for p in plan.points if "arm.natural_length" in p]
    assert Counter((p["alpha"], p["control_period"]) for p in fitted) == dict.fromkeys(PERIODS.items(), 4)
    unset = dict.fromkeys([name for p in plan.points for name in p], "")
    table = made_table({"run": str(i), **unset, **p} for i, p in enumerate(plan.points))
    assert len(fitted_rows(table).rows) == len(fitted)
    assert len(undisturbed(table).rows) == 24


def test_each_step_size_has_its_published_period_at_each_place_twice():
    plan = Helix1().plan(quick=False)
    assert plan.repetitions == 2
    plain = [p for p in plan.points if len(p) == 4]
    seen = Counter((p["tuning"], p["alpha"], p["control_period"]) for p in plain)
    assert seen == {(tuning, *pair): 4 for tuning in ("thesis", "own") for pair in PERIODS.items()}
    assert float(plan.fixed["patience"]) > 2 * 214.9  # the longest published one


def test_what_may_spread_the_times_is_tried_at_the_smallest_step_size_at_each_place_one_thing_at_a_time():
    disturbed = [p for p in Helix1().plan(quick=False).points if len(p) == 5]
    assert {(p["tuning"], p["alpha"], p["control_period"]) for p in disturbed} == {("thesis", "0.1", "1.38")}
    assert set(Counter(tuple(p.items())[4:] for p in disturbed).values()) == {4}


def test_a_quick_one_has_each_step_size_as_often_as_intervals_need():
    plan = Helix1().plan(quick=True)
    assert Counter((p["tuning"], p["alpha"]) for p in plan.points) == {("thesis", a): MIN_SAMPLES for a in PERIODS}
    assert plan.repetitions == 1
