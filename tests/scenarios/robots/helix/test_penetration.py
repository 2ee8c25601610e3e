"""Starts in which ball or palm are in the hanging arm are refused, with depth and the way out."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from handover.cosim.system.system import PlacedUnit, System
from handover.fmus.build import cached
from handover.scenarios.experiment.parameters import InvalidParameter
from handover.scenarios.robots.helix.helix_handover import HelixHandover, start_faults
from handover.scenarios.robots.helix.helix_reflex_grasp import HelixReflexGrasp
from handover.scenarios.robots.helix.helix_use_case import HelixUseCase
from handover.scenarios.runs.execution.unit_values import built_system

SCENARIOS = (HelixHandover, HelixUseCase, HelixReflexGrasp)
DOWN_TO_WRIST, DOWN_TO_GRIPPER = 0.60, 0.70
"""Of the arm by default, m."""


@cache
def wired(scenario: type[HelixHandover], **values: str) -> System:
    fmus = {name: cached(unit, 3) for name, unit in scenario.units.items()}
    given = {f"hand.{name}": value for name, value in values.items()}
    return built_system(scenario(), scenario.parameters_type(), 0, fmus, given)


def faults(x: float, z: float, **others: float) -> list[str]:
    units = wired(HelixHandover).units
    start = {**units["hand"].start, "room": 0.0, "p_WO_0": np.array([x, 0.0, z]), **others}
    hand: PlacedUnit = replace(units["hand"], start=start)
    return start_faults({**units, "hand": hand})


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_defaults_start_free_and_a_ball_in_the_arm_is_refused(scenario: type[HelixHandover]):
    wired(scenario)
    with pytest.raises(InvalidParameter) as refused:
        wired(scenario, room="0", p_WO_0="0,0,-0.3")
    assert all(fault.startswith("hand.p_WO_0: ") for fault in refused.value.faults)


def test_the_depth_is_that_of_a_ball_beside_the_axis_of_a_cylinder():
    (fault, *_) = faults(0.05, -0.3)  # its radius and the arm's are 0.060 m
    assert "0.010 m inside the arm; move it by (+0.011, +0.000, +0.000) m" in fault
    assert not any("the ball" in fault for fault in faults(0.0601, -0.3))


def test_a_ball_may_start_where_nothing_of_the_gripper_is():
    """Between the open fingers and below them, not in the palm; a hand that waits beside the arm is free anywhere."""
    assert not faults(0.0, -DOWN_TO_GRIPPER)
    assert faults(0.0, -DOWN_TO_WRIST - 0.06)
    assert not faults(0.0, -DOWN_TO_GRIPPER - 0.1)
    assert all(not faults(0.0, z, room=0.12) for z in np.linspace(-0.9, -0.1, 17))
