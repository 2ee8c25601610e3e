"""The open gripper's way to a ball: no course leads its fingers through ball or hand, and each ends at its goal."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from handover.controllers.helix.servo.arm_paths import next_place
from handover.cosim.blocks.ports import Floats

P_WO = np.array([0.1, -0.05, -0.6])
ABOVE = np.array([0.0, 0.0, 0.05])
FINGERS, BALL = 0.05, 0.025
TIPS = 0.008
"""How far before the gripper's middle its fingers end."""


def course(start: Floats, goal: Floats, excess: float = 0.0, steps: int = 400) -> Floats:
    """Return a course of a gripper that goes 3 mm at a time to where it is to go next, seen from the ball."""
    p, places = P_WO + start, list[Floats]()
    for _ in range(steps):
        way = next_place(p, P_WO, goal, standoff=0.1, over=ABOVE[2], excess=excess) - p
        p = p + way * min(1.0, 0.003 / max(float(np.linalg.norm(way)), 1e-12))
        places.append(p - P_WO)
    return np.array(places)


@settings(max_examples=30)
@given(st.floats(-np.pi, np.pi), st.floats(FINGERS + BALL, 0.3), st.floats(-0.3, 0.2), st.booleans())
def test_the_gripper_comes_from_above_wherever_it_starts(angle: float, beside: float, height: float, down: bool):
    goal = P_WO if down else P_WO + ABOVE
    places = course(np.array([beside * np.cos(angle), beside * np.sin(angle), height]), goal)
    np.testing.assert_allclose(places[-1], goal - P_WO, atol=1e-6)
    aside = np.hypot(places[:, 0], places[:, 1])
    nearest_tip = np.hypot(aside - FINGERS, places[:, 2] - TIPS)  # were a finger just on the ball's side
    assert np.all(nearest_tip > BALL)


def test_the_gripper_does_not_turn_back_once_it_is_over_the_ball():
    places = course(np.array([0.15, 0.02, -0.1]), P_WO)
    aside = np.hypot(places[:, 0], places[:, 1])
    highest = int(np.argmax(aside < 0.08))
    assert np.all(np.diff(aside[highest:]) <= 1e-12)


@pytest.mark.parametrize(("excess", "height"), [(-0.3, 0.0), (0.1, 0.02), (1.0, 0.05)])
def test_a_tilted_gripper_stays_above_but_for_a_standoff_of_nothing(excess: float, height: float):
    np.testing.assert_allclose(course(np.array([0.15, 0.0, 0.1]), P_WO, excess)[-1], [0.0, 0.0, height], atol=1e-6)
    at_once = next_place(P_WO - ABOVE, P_WO, P_WO, standoff=0.0, over=0.05, excess=excess)
    np.testing.assert_array_equal(at_once, P_WO)
