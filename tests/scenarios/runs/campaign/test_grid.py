"""`name=values` texts of a sweep: what they mean, and the errors for invalid ones."""

from itertools import product

import pytest
from support.wording import Wording

from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.free_flyer.handover.handovers import RobotToHuman
from handover.scenarios.robots.helix.helix_handover import HelixHandover
from handover.scenarios.robots.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.robots.vsl.path_experiments import VslHybrid
from handover.scenarios.runs.campaign.grid import parse_grid, set_parameters


def faults(*given: str) -> list[str]:
    with pytest.raises(InvalidParameter) as caught:
        parse_grid(HelixHandover, given)
    return list(caught.value.faults)


def values(text: str) -> list[str]:
    return [next(iter(point.values())) for point in parse_grid(HelixHandover, [text])]


def test_all_combinations_the_last_parameter_varying_fastest():
    points = parse_grid(IrGrasp, ["strategy=reflex,blind", "perturbed=true,False"])
    assert [(*point.values(),) for point in points] == [*product(("reflex", "blind"), ("true", "false"))]
    assert [*points[0]] == ["strategy", "perturbed"]
    assert parse_grid(HelixHandover, []) == [{}]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("alpha=0.1,.20,4e-1", ["0.1", "0.2", "0.4"]),
        ("alpha=0.1:0.4:4", ["0.1", "0.2", "0.3", "0.4"]),
        ("alpha=1:0.5:2", ["1", "0.5"]),
        ("height=-1:-0.5:3", ["-1", "-0.75", "-0.5"]),
        ("place=Front,back_left", ["front", "back_left"]),
    ],
)
def test_values_have_one_text_whatever_was_written(text: str, wanted: list[str]):
    assert values(text) == wanted


def test_a_range_of_whole_numbers():
    assert parse_grid(VslHybrid, ["points=10:30:3"]) == [{"points": "10"}, {"points": "20"}, {"points": "30"}]
    with pytest.raises(InvalidParameter, match=r"points: 12\.5 is not a whole number"):
        parse_grid(VslHybrid, ["points=10:15:3"])


def test_arrays_stand_between_semicolons():
    points = parse_grid(RobotToHuman, ["p_WG_handover=0,-0.07,0;0.1,0,0"])
    assert points == [{"p_WG_handover": "0,-0.07,0"}, {"p_WG_handover": "0.1,0,0"}]


@pytest.mark.parametrize(
    "text",
    [
        "alpha",
        "alpah=1",
        "alpha=",
        "alpha=0.1,,0.2",
        "alpha=1:2",
        "alpha=a:b:3",
        "alpha=0:inf:3",
        "alpha=0:1:0",
        "alpha=0:1:2.5",
        "alpha=0.1:1:200000",
        "alpha=1:1:3",
        "alpha=0.1,2",
        "alpha=0.1,nan",
        "alpha=0.1,0.10",
        "place=front,rihgt",
        "place=lfet",
    ],
)
def test_what_means_nothing_is_reported_in_a_line(text: str, wording: Wording):
    (value,) = faults(text)
    wording.check(value)


def test_all_faults_are_reported_together_and_a_grid_too_large_is_refused_before_it_is_made():
    assert len(faults("alpha=9", "alpha=0.1", "beta=1", "radius=0:1")) == 4
    large = faults("alpha=0.1:0.9:400", "radius=0:1:400")
    assert large[-1] == "the grid has 160,000 points; at most 100,000 runs can be planned"


def test_a_parameter_cannot_be_varied_and_set():
    points = parse_grid(HelixHandover, ["alpha=0.1,0.2"])
    assert set_parameters(HelixHandover, ["patience=1"], points) == {"patience": "1"}
    with pytest.raises(InvalidParameter) as caught:
        set_parameters(HelixHandover, ["alpha=0.3", "patience=1", "patience=2", "alhpa=1", "x"], points)
    assert list(caught.value.faults) == [
        "patience is given twice",
        "helix_handover has no parameter 'alhpa'; did you mean alpha?",
        "'x' is not of the form name=value",
        "alpha is varied and set by -p; give one of them",
    ]
