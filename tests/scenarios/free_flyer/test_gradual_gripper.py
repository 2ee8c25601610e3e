"""What a gripper that follows the hand makes of a knock against the robot, and of its grip while it opens."""

from pathlib import Path

import numpy as np
import pytest
from flyer_offer import offer
from flyer_runs import metric, run

from handover.controllers.free_flyer.handover_state_machine import HandoverPhase
from handover.controllers.free_flyer.impedance_controller import Behaviour
from handover.scenarios.free_flyer.handover.handovers import HumanToRobot, RobotToHuman


def test_a_knock_that_drops_the_object_is_survived_by_gradual_fingers():
    knock = np.array([0.0, 0.0, 1.0]), 0.15, Behaviour.RIGID
    at_once, gradual = offer(*knock), offer(*knock, gradual=True)
    assert at_once.dropped
    assert not gradual.dropped
    assert gradual.fastest > 0.059  # felt as a pull by the threshold
    assert 0.0 < gradual.widest < 0.2
    assert gradual.ended is HandoverPhase.CHECK_VELOCITY


def test_a_long_knock_is_taken_for_a_pull_by_either():
    knock = np.array([0.0, 0.0, 1.0]), 0.5, Behaviour.RIGID
    assert offer(*knock).dropped
    assert offer(*knock, gradual=True).dropped


@pytest.mark.parametrize("scenario", [RobotToHuman, HumanToRobot])
@pytest.mark.parametrize("behaviour", ["rigid", "compliant"])
def test_a_person_hands_over_with_a_gradual_gripper(
    tmp_path: Path, scenario: type[RobotToHuman | HumanToRobot], behaviour: str
):
    ended = run(scenario, tmp_path / "r", f"behaviour={behaviour}", "gradual=true")
    assert ended.outcome.success, ended.outcome.reason
    assert metric(ended, "transfer_time") < 5.0
