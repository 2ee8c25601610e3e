"""The unit of hand and object as such: its start, its steps' last digits, its state."""

from dataclasses import replace

import numpy as np
import pytest
from support.plants.hand_scene import CALM, DT, GIVING, IDLE, Scene
from support.restored_states import assert_continues, assert_outputs_change_nothing

from handover.plants.free_flyer.hand.hand_and_object import (
    Activity,
    HandAndObject,
    Inputs,
    Motion,
    Params,
)


def test_a_time_that_whole_steps_fill_ends_at_the_same_step_whatever_their_last_digits():
    """Grasping takes 25 steps; hosts that take differences of times give steps that add up to a little less."""
    courses: list[list[Activity]] = []
    for dt in (DT, DT - 1e-16, DT + 1e-16):
        scene = Scene(CALM)
        for _ in range(260):
            scene.go(dt, dt, closure=1.0, light=True)
        courses.append([y.activity for y in scene.seen])
    assert courses[0].count(Activity.GRASP) == 25
    assert courses[0] == courses[1] == courses[2]


def test_a_free_object_stays_where_it_is_and_a_held_one_is_where_the_hand_is_on_it():
    y = Scene(IDLE, np.array([1.0, 0.0, 0.0])).go(1.6)
    np.testing.assert_array_equal([y.p_WO, y.f_G], np.zeros((2, 3)))
    np.testing.assert_allclose(Scene(GIVING).y.p_WO, [-0.40, 0.03, -0.05])  # 0.07 m along y from the hand
    assert_outputs_change_nothing(lambda: HandAndObject(Params()), Inputs())


@pytest.mark.parametrize("params", [replace(CALM, seed=3), replace(GIVING, seed=4, tremor_rms=0.001)])
def test_goes_on_bit_for_bit_after_a_state_is_restored(params: Params):

    def inputs(i: int) -> Inputs:
        taking = params.motion is Motion.TAKE
        closed = (100 < i < 400) if taking else i > 300
        return Inputs(closure=float(closed), light=130 < i < 160, v_WG=np.array([0.0, 0.0, 0.001]))

    assert_continues(lambda: HandAndObject(params), inputs, [0, *range(35, 420, 70)], 140)
