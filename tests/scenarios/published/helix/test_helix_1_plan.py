from collections import Counter

import pyarrow as pa

from handover.scenarios.campaign.plan_check import checked_plan
from handover.scenarios.campaign.statistics import MIN_SAMPLES
from handover.scenarios.campaign.table import CampaignTable
from handover.scenarios.published.helix.helix_1 import Helix1
from handover.scenarios.published.helix.helix_1_spread import fitted_rows, undisturbed

PERIODS = {"0.1": "1.38", "0.2": "1.51", "0.4": "1.45"}


def test_each_step_size_has_its_published_period_at_each_place_twice():
    plan = Helix1().plan(quick=False)
    assert plan.repetitions == 2
    plain = [p for p in plan.points if len(p) == 4]
    seen = Counter((p["tuning"], p["alpha"], p["control_period"]) for p in plain)
    assert seen == {(tuning, *pair): 4 for tuning in ("thesis", "own") for pair in PERIODS.items()}
    assert len({tuple(p.values()) for p in plain}) == 24


def test_what_may_spread_the_times_is_tried_at_the_smallest_step_size_at_each_place_one_thing_at_a_time():
    disturbed = [p for p in Helix1().plan(quick=False).points if len(p) == 5]
    assert {(p["tuning"], p["alpha"], p["control_period"]) for p in disturbed} == {("thesis", "0.1", "1.38")}
    amiss = Counter(tuple(p.items())[4:] for p in disturbed)
    assert set(amiss.values()) == {4}


def test_the_fitted_arm_is_tried_as_the_shipped_one_and_its_runs_are_found_again():
    plan = checked_plan(Helix1().plan(quick=False))
    fitted = [p for p in plan.points if "arm.natural_length" in p]
    assert Counter((p["alpha"], p["control_period"]) for p in fitted) == dict.fromkeys(PERIODS.items(), 4)
    empty = dict.fromkeys([name for p in plan.points for name in p], "")
    rows = [{"run": str(i), **empty, **p} for i, p in enumerate(plan.points)]
    table = CampaignTable(pa.Table.from_pylist(rows))
    assert fitted_rows(table).table.num_rows == len(fitted)
    assert undisturbed(table).table.num_rows == 24


def test_runs_may_take_longer_than_the_longest_published_one():
    assert float(Helix1().plan(quick=False).fixed["patience"]) > 2 * 214.9


def test_a_quick_one_has_each_step_size_as_often_as_intervals_need():
    plan = Helix1().plan(quick=True)
    assert Counter(p["alpha"] for p in plan.points) == dict.fromkeys(PERIODS, MIN_SAMPLES)
    assert plan.repetitions == 1
    assert {p["tuning"] for p in plan.points} == {"thesis"}
