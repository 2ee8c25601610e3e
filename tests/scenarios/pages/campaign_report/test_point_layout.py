"""Where points are placed along an axis."""

import numpy as np
import pytest
from support.campaigns import results_of

from handover.scenarios.pages.campaign_report.point_layout import PointLayout, layout_of


def layout(scenario: str, *points: dict[str, str]) -> PointLayout:
    return layout_of(results_of(scenario, points))


def test_a_number_is_an_axis_with_its_unit():
    along = layout("ir_grasp", {"forward": "0.02"}, {"forward": "0.055"}, {"forward": "0.03"})
    assert along.title == "forward (mm)"
    assert along.places == pytest.approx([20.0, 55.0, 30.0])
    assert along.room == pytest.approx(8.0)
    assert not along.listed
    assert layout("ir_grasp", {"turn_most": "0"}, {"turn_most": "3.14159265"}).title == "turn most (°)"
    places = along.beside(0, 100)
    assert np.all(np.abs(places - along.places[0]) < along.room / 2)
    assert len(set(places.tolist())) == 100


def test_numbers_that_are_far_apart_and_near_have_a_logarithmic_axis():
    along = layout("flyer_impedance", *({"force": f} for f in ("0.1", "1", "10")))
    assert along.places == pytest.approx([-1.0, 0.0, 1.0])
    assert [name for _, name in along.ticks or ()] == ["0.1", "1", "10"]


def test_of_two_parameters_the_number_is_the_axis_and_the_name_a_colour():
    points = [{"strategy": s, "forward": f} for s in ("reflex", "blind") for f in ("0.02", "0.04")]
    along = layout("ir_grasp", *points)
    assert along.title == "forward (mm)"
    assert along.group_names == ["reflex", "blind"]
    assert along.groups == [0, 0, 1, 1]
    assert np.all(np.diff(along.places[[0, 2, 1, 3]]) >= along.room)


def test_a_switch_is_reported_by_its_name():
    along = layout("ir_grasp", {"perturbed": "true"}, {"perturbed": "false"})
    assert [name for _, name in along.ticks or ()] == ["perturbed", "not perturbed"]


THREE = [
    *({"strategy": s, "thing": "cylinder", "perturbed": p} for s in ("reflex", "blind") for p in ("true", "false")),
    {"strategy": "blind", "thing": "baby_cup_a", "perturbed": "true"},
]
SOME = [{"strategy": "reflex"}, *({"strategy": "forward", "forward": f} for f in ("0.035", "0.055"))]
LONG = [{"thing": f"a_thing_with_a_long_name_{k}"} for k in range(6)]


@pytest.mark.parametrize("points", [THREE, SOME, LONG], ids=["three parameters", "some points only", "long names"])
def test_points_that_differ_in_more_or_need_room_are_a_list_from_top_to_bottom(points: list[dict[str, str]]):
    along = layout("ir_grasp", *points)
    assert along.listed
    assert np.all(np.diff(along.places) < 0)
    assert len({name for _, name in along.ticks or ()}) == len(points)


def test_a_parameter_that_goes_with_another_is_not_reported_twice():
    points = [{"alpha": a, "control_period": p} for a, p in (("0.1", "1.38"), ("0.2", "1.51"), ("0.4", "1.45"))]
    assert layout("helix_handover", *points).title == "alpha"
