"""An invalid plan is rejected as a whole before any of its runs begins."""

import re

import pytest

from handover.scenarios.campaign.plan import CampaignPlan
from handover.scenarios.campaign.plan_check import check_units, checked_plan, unit_fmus
from handover.scenarios.execution.errors import UsageError
from handover.scenarios.experiment.parameters import InvalidParameter


def plan(**given: object) -> CampaignPlan:
    return CampaignPlan(**{"scenario": "ir_grasp", "points": [{}], **given})  # type: ignore[arg-type]


def test_texts_of_the_same_values_make_the_same_plan():
    one = plan(points=[{"forward": ".10"}], fixed={"thing": "CYLINDER", "literal": "True"})
    other = plan(points=[{"forward": "0.1"}], fixed={"thing": "cylinder", "literal": "true"})
    assert checked_plan(one) == checked_plan(other) == other


def test_values_that_do_not_fit_each_other_are_reported_with_their_point():
    wrong = plan(points=[{"shift_least": "0.04"}, {"shift_least": "0.06"}, {"shift_least": "9"}])
    with pytest.raises(InvalidParameter) as caught:
        checked_plan(wrong)
    assert list(caught.value.faults) == [
        "at shift_least=0.06: shift_least 0.06 m must be at most shift_most 0.05 m",
        "shift_least: 9.0 is out of range: from 0 to 0.1 m",
    ]


def test_of_many_faults_the_first_are_reported_and_how_many_more():
    wrong = plan(points=[{"shift_least": f"0.0{n}"} for n in range(51, 75)])
    with pytest.raises(InvalidParameter) as caught:
        checked_plan(wrong)
    assert len(caught.value.faults) == 9
    assert caught.value.faults[-1] == "and 16 faults more"


SIZES: list[tuple[int, int, str]] = [
    (0, 1, "the campaign has no runs"),
    (1, 0, "the campaign has no runs"),
    (1, 10_001, "10,001 repetitions; at most 10,000 can be planned"),
    (20, 9000, "20 points times 9,000 repetitions are 180,000 runs; at most 100,000 can be planned"),
]


@pytest.mark.parametrize(("points", "repetitions", "fault"), SIZES)
def test_sizes_out_of_bounds(points: int, repetitions: int, fault: str):
    with pytest.raises(InvalidParameter, match=re.escape(fault)):
        checked_plan(plan(points=[dict[str, str]()] * points, repetitions=repetitions))


def test_unknown_scenario_and_unit():
    with pytest.raises(UsageError, match="did you mean ir_grasp"):
        checked_plan(plan(scenario="ir_gasp"))
    with pytest.raises(UsageError, match="ir_grasp has no unit 'sceen': did you mean scene"):
        unit_fmus(plan(units={"sceen": "x.fmu"}))


def test_values_of_units_are_checked_together_as_each_point_has_them():
    in_the_arm, beside = "0,0,-0.3", "0.3,0,-0.3"
    points = [{"hand.room": "0.12", "hand.p_WO_0": in_the_arm}, {"hand.room": "0", "hand.p_WO_0": beside}]
    good = plan(scenario="helix_handover", points=points)
    check_units(good, unit_fmus(good))
    wrong = plan(scenario="helix_handover", points=[*points, {"hand.room": "0", "hand.p_WO_0": in_the_arm}])
    with pytest.raises(InvalidParameter) as refused:
        check_units(wrong, unit_fmus(wrong))
    assert all(f.startswith("at hand.room=0, hand.p_WO_0=0,0,-0.3: hand.p_WO_0: ") for f in refused.value.faults)
