from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.wording import Wording

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
    "changes",
    [
        {"motion": Motion.GIVE},
        {"object_with": StartHolder.HAND},
        {"p_WH_0": np.array([-0.10, -0.60, 0.02])},
        {"object_size": np.array([0.3, 0.1, 0.1])},
        {"p_OH": np.array([0.0, 0.2, 0.0])},
        {"p_OH": np.array([0.0, -0.05, 0.0])},
        {"aperture": 0.01},
        {"angle_empty": 1.3},
        {"release_angle": 1.0},
        {"angle_0": 0.5},
        {"pull_direction": np.zeros(3)},
        {"q_WO_0": np.array([1.0, 1.0, 0.0, 0.0])},
        {"q_WH_0": np.zeros(4)},
        {"tremor_bandwidth": 20.0},
        {"motion": Motion.GIVE, "aperture": 0.01, "pull_direction": np.zeros(3)},
    ],
)
def test_contradictions_are_refused_all_at_once(changes: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidHandParameters) as refused:
        HandAndObject(replace(Params(), **changes))
    assert len(refused.value.faults) >= len(changes)
    wording.check(refused.value)


def test_a_robot_that_starts_in_the_hand_is_refused(wording: Wording):
    for p_WG, changes in (
        ([-0.40, 0.13, -0.05], {}),
        ([-0.03, -0.07, 0.0], {}),
        ([0.0, -0.07, 0.0], {"angle_0": 0.60}),
    ):
        with pytest.raises(InvalidHandParameters) as refused:
            begun(np.array(p_WG), **changes)
        wording.check(refused.value)
    begun(np.array([0.0, -0.07, 0.0]), angle_0=0.80)
