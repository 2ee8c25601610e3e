from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.hand.hand_and_object import (
    HandAndObject,
    Inputs,
    InvalidHandParameters,
    Motion,
    Params,
    StartHolder,
)


def begun(p_WG: Floats, **changes: Any) -> None:
    HandAndObject(Params(p_WO_0=np.zeros(3), **changes)).step(0.0, 0.016, Inputs(p_WG=p_WG))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"motion": Motion.GIVE}, "needs the object in the hand"),
        ({"object_with": StartHolder.HAND}, "needs the object elsewhere"),
        ({"p_WH_0": np.array([-0.10, -0.60, 0.02])}, "the hand starts 0.0[0-9]+ m inside the object"),
        ({"object_size": np.array([0.3, 0.1, 0.1])}, "the second side must be the longest"),
        ({"p_OH": np.array([0.0, 0.2, 0.0])}, "p_OH .* must lie inside the object"),
        ({"p_OH": np.array([0.0, -0.05, 0.0])}, "0.02 m apart"),
        ({"aperture": 0.01}, "does not fit into the gripper"),
        ({"angle_empty": 1.3}, "angle_empty 1.3 rad must be less"),
        ({"release_angle": 1.0}, "never comes free"),
        ({"angle_0": 0.5}, "angle_0 0.5 rad must lie between angle_empty 0.6 rad and angle_open 1.2 rad"),
        ({"pull_direction": np.zeros(3)}, "pull_direction"),
        ({"q_WO_0": np.array([1.0, 1.0, 0.0, 0.0])}, "q_WO_0 .* norm is 1.41421"),
        ({"q_WH_0": np.zeros(4)}, "q_WH_0 .* norm is 0"),
        ({"tremor_bandwidth": 20.0}, "tremor_bandwidth 20 Hz"),
    ],
)
def test_contradictions_are_refused(changes: dict[str, Any], text: str):
    with pytest.raises(InvalidHandParameters, match=text):
        HandAndObject(replace(Params(), **changes))


def test_all_faults_are_reported_together():
    with pytest.raises(InvalidHandParameters) as caught:
        HandAndObject(Params(motion=Motion.GIVE, aperture=0.01, pull_direction=np.zeros(3)))
    assert len(caught.value.faults) >= 3


def test_a_robot_that_starts_in_the_hand_is_refused():
    with pytest.raises(InvalidHandParameters, match="hand starts in the gripper"):
        begun(np.array([-0.40, 0.13, -0.05]))
    with pytest.raises(InvalidHandParameters, match="object starts in the gripper's palm"):
        begun(np.array([-0.03, -0.07, 0.0]))
    with pytest.raises(InvalidHandParameters, match=r"between fingers .* angle_0 0\.6 rad; open them to 0\.785 rad"):
        begun(np.array([0.0, -0.07, 0.0]), angle_0=0.60)
    begun(np.array([0.0, -0.07, 0.0]), angle_0=0.80)
