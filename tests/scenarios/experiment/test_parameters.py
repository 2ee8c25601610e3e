from typing import Any

import pytest
from support.wording import Wording

from handover.scenarios.experiment.parameters import InvalidParameter, parse_parameters
from handover.scenarios.free_flyer.handover.handovers import RobotToHuman
from handover.scenarios.helix.disturbances import Cover
from handover.scenarios.helix.helix_handover import HelixHandover
from handover.scenarios.helix.parameters import HandPlace
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp


def test_values_are_parsed_by_their_declared_kind_and_what_is_not_given_has_its_default():
    p = parse_parameters(HelixHandover, ["alpha=0.1", "place=back_left", "cover=right"])
    assert (p.alpha, p.place, p.cover) == (0.1, HandPlace.BACK_LEFT, Cover.RIGHT)
    assert parse_parameters(HelixHandover, []) == HelixHandover.parameters_type()


@pytest.mark.parametrize(
    ("scenario", "given"),
    [
        (HelixHandover, ["alfa=0.1"]),
        (HelixHandover, ["alpha=fast", "alpha=0.1"]),
        (HelixHandover, ["alpha=", "radius=-1", "nothing=3", "place=behind"]),
        (HelixHandover, ["alpha=nan"]),
        (HelixHandover, ["alpha=1e999"]),
        (HelixHandover, ["alpha=0.1,0.2"]),
        (HelixHandover, ["alpha"]),
        (RobotToHuman, ["stuck_nozzle=13"]),
        (RobotToHuman, ["stuck_nozzle=1.5"]),
        (IrGrasp, ["shift=0.1"]),
    ],
)
def test_bad_parameters_are_refused_with_valid_values(scenario: type[Any], given: list[str], wording: Wording):
    with pytest.raises(InvalidParameter) as caught:
        parse_parameters(scenario, given)
    assert len(caught.value.faults) == len(given)
    wording.check(caught.value)
