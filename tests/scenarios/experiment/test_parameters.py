import pytest

from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.free_flyer.handover.handovers import RobotToHuman
from handover.scenarios.helix.disturbances import Cover
from handover.scenarios.helix.helix_handover import HelixHandover
from handover.scenarios.helix.parameters import HandPlace
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp


def test_values_are_parsed_by_their_declared_kind():
    p = parse_parameters(HelixHandover, ["alpha=0.1", "place=back_left", "cover=right"])
    assert (p.alpha, p.place, p.cover) == (0.1, HandPlace.BACK_LEFT, Cover.RIGHT)


def test_what_is_not_given_has_its_default():
    assert parse_parameters(HelixHandover, []) == HelixHandover.parameters_type()


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ("alfa=0.1", "did you mean alpha"),
        ("alpha=1.5", "from 0.01 to 1"),
        ("alpha=fast", "is not a number, from 0.01 to 1"),
        ("alpha=", "is not a number"),
        ("alpha=nan", "not finite"),
        ("alpha=1e999", "not finite"),
        ("alpha=0.1,0.2", "is not a number"),
        ("place=behind", "none of front"),
        ("alpha", "not of the form name=value"),
    ],
)
def test_a_bad_parameter_is_refused_with_valid_values(given: str, text: str):
    with pytest.raises(InvalidParameter) as caught:
        parse_parameters(HelixHandover, [given])
    assert text in str(caught.value)


def test_all_faults_are_reported_together():
    with pytest.raises(InvalidParameter) as caught:
        parse_parameters(HelixHandover, ["alpha=2", "radius=-1", "nothing=3", "alpha=0.1"])
    assert len(caught.value.faults) == 4


@pytest.mark.parametrize(
    ("text", "fault"),
    [("13", "stuck_nozzle: 13 is out of range: from 0 to 12"), ("1.5", "stuck_nozzle: 1.5 is not a whole number")],
)
def test_a_fault_quotes_a_whole_number_as_it_was_given(text: str, fault: str):
    with pytest.raises(InvalidParameter, match=fault):
        parse_parameters(RobotToHuman, [f"stuck_nozzle={text}"])


def test_too_few_numbers_of_an_array_are_counted():
    with pytest.raises(InvalidParameter, match=r"from -0.2 to 0.2 m: it takes 2 numbers, 1 is given"):
        parse_parameters(IrGrasp, ["shift=0.1"])
