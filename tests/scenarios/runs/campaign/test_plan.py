"""Names and seeds of a campaign's runs, which later calls of the same campaign rely on."""

import re
from dataclasses import replace

import pytest
from support.wording import Wording

from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.runs.campaign.plan import MAX_REPETITIONS, CampaignPlan
from handover.scenarios.runs.campaign.plan_check import check_units, checked_plan, unit_fmus

PLAN = CampaignPlan(
    scenario="ir_grasp",
    points=[{"thing": "cylinder", "forward": "0.1"}, {"thing": "paper_box_a", "forward": "0.1"}],
    fixed={"strategy": "forward"},
    repetitions=3,
    seed=7,
)
SEEDS = [6558637776629615, 7582661982661486, 8804234512720521, 11597181391079, 174569547476390, 5151011548111942]
PAIRED = [1653442781704951, 1973877946906281, 8573731580185675]


def test_seeds_are_these_for_ever():
    assert [run.seed for run in PLAN.runs()] == SEEDS
    assert [run.seed for run in replace(PLAN, paired=True).runs()] == PAIRED * 2
    assert [(run.point, run.repetition) for run in PLAN.runs()] == [(p, r) for p in range(2) for r in range(3)]
    assert PLAN.runs()[3].parameters == {"strategy": "forward", "thing": "paper_box_a", "forward": "0.1"}
    assert PLAN.size == 6


def test_more_repetitions_leave_names_and_seeds_of_the_others():
    before = {run.name: run.seed for run in PLAN.runs()}
    after = {run.name: run.seed for run in replace(PLAN, repetitions=200).runs()}
    assert {name: after[name] for name in before} == before


def test_all_runs_of_a_large_campaign_differ_in_seed_and_name():
    runs = CampaignPlan(scenario="ir_grasp", points=[{"forward": "0.1"}] * 10, repetitions=100).runs()
    assert len({run.seed for run in runs}) == len({run.name for run in runs}) == 1_000
    assert [run.name for run in runs] == sorted(run.name for run in runs)
    assert all(0 <= run.seed < 2**53 for run in runs)


def test_names_are_those_of_files_whatever_the_values_are():
    values = {"model": "/home/x/my model.json", "load": "0.1", "pressure": "1" * 90}
    (run, *_, last) = CampaignPlan(scenario="vsl_hybrid", points=[values], repetitions=MAX_REPETITIONS).runs()
    assert run.name.startswith("000_model=-home-x-my-model.json_load=0.1_pressure=111")
    assert re.fullmatch(r"[A-Za-z0-9.,=+_-]{80}", run.name)
    assert last.name.endswith("_r9999")


def test_a_campaign_that_varies_nothing_has_plain_names():
    runs = CampaignPlan(scenario="ir_grasp", points=[{}], repetitions=2).runs()
    assert [run.name for run in runs] == ["000_r0000", "000_r0001"]


def test_paired_points_of_different_scenes_share_no_seed():
    points = [{"thing": thing, "strategy": s} for thing in ("cylinder", "baby_cup_a") for s in ("reflex", "blind")]
    plan = CampaignPlan(scenario="ir_grasp", points=points, repetitions=3, paired=True, scenes=("thing",))
    seeds = [[r.seed for r in plan.runs() if r.point == point] for point in range(4)]
    assert seeds[0] == seeds[1]
    assert seeds[2] == seeds[3]
    assert len({*seeds[0], *seeds[2]}) == 6


def plan(**given: object) -> CampaignPlan:
    return CampaignPlan(**{"scenario": "ir_grasp", "points": [{}], **given})  # type: ignore[arg-type]


def test_texts_of_the_same_values_make_the_same_plan():
    one = plan(points=[{"forward": ".10"}], fixed={"strategy": "FORWARD", "perturbed": "True"})
    other = plan(points=[{"forward": "0.1"}], fixed={"strategy": "forward", "perturbed": "true"})
    assert checked_plan(one) == checked_plan(other) == other


def test_values_that_do_not_fit_each_other_are_reported_with_their_point():
    wrong = plan(points=[{"shift_least": "0.04"}, {"shift_least": "0.06"}, {"shift_least": "9"}])
    with pytest.raises(InvalidParameter) as caught:
        checked_plan(wrong)
    assert list(caught.value.faults) == [
        "at shift_least=0.06: shift_least 0.06 m must be at most shift_most 0.05 m",
        "shift_least: 9.0 is out of range: from 0 to 0.1 m",
    ]
    with pytest.raises(InvalidParameter) as caught:
        checked_plan(plan(points=[{"shift_least": f"0.0{n}"} for n in range(51, 75)]))
    assert len(caught.value.faults) == 24
    assert str(caught.value).endswith("; and 4 more")


def test_a_value_counts_if_something_comes_of_it_at_one_of_the_points():
    """One that nothing comes of at any point is refused."""
    strategies = [{"strategy": "reflex"}, {"strategy": "forward"}]
    checked_plan(plan(points=strategies, fixed={"forward": "0.055"}))
    with pytest.raises(InvalidParameter) as caught:
        checked_plan(plan(points=[*strategies[:1], {"strategy": "blind"}], fixed={"forward": "0.055"}))
    assert [fault.partition(":")[0] for fault in caught.value.faults] == ["forward"]


@pytest.mark.parametrize(("points", "repetitions"), [(0, 1), (1, 0), (1, 10_001), (20, 9000)])
def test_sizes_out_of_bounds(points: int, repetitions: int, wording: Wording):
    with pytest.raises(InvalidParameter) as e:
        checked_plan(plan(points=[dict[str, str]()] * points, repetitions=repetitions))
    wording.check(e.value)


def test_values_of_units_are_checked_together_as_each_point_has_them():
    in_the_arm, beside = "0,0,-0.3", "0.3,0,-0.3"
    points = [{"hand.room": "0.12", "hand.p_WO_0": in_the_arm}, {"hand.room": "0", "hand.p_WO_0": beside}]
    good = plan(scenario="helix_handover", points=points)
    check_units(good, unit_fmus(good))
    wrong = plan(scenario="helix_handover", points=[*points, {"hand.room": "0", "hand.p_WO_0": in_the_arm}])
    with pytest.raises(InvalidParameter) as refused:
        check_units(wrong, unit_fmus(wrong))
    assert all(f.startswith("at hand.room=0, hand.p_WO_0=0,0,-0.3: hand.p_WO_0: ") for f in refused.value.faults)
