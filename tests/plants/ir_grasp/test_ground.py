"""A ground that moves carries the object by friction, and by no more than that."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handover.plants.ir_grasp.ground import MovingGround, bump
from handover.plants.ir_grasp.parameters import InvalidSceneParameters, Params
from handover.plants.ir_grasp.scene import GraspScene, Inputs, Outputs

STEP = 0.015
AWAY = Params(p_WH_0=np.array([-0.4, 0.0]))
BESIDE = Inputs(p_WH_cmd=np.array([-0.4, 0.0]))


def course(p: Params, seconds: float, u: Inputs = BESIDE) -> list[Outputs]:
    scene = GraspScene(p)
    return [scene.step(k * STEP, STEP, u) for k in range(round(seconds / STEP))]


def test_the_object_goes_along_with_the_ground_from_and_until_when_it_moves():
    p = replace(AWAY, carry_velocity=np.array([0.004, 0.02]), carry_from=0.6, carry_until=2.4)
    ys = course(p, 3.0)
    t = STEP * np.arange(1, len(ys) + 1)
    way = np.clip(t - 0.6, 0.0, 1.8)[:, None] * p.carry_velocity
    np.testing.assert_allclose([y.p_ground for y in ys], way, atol=1e-12)
    slip = np.hypot(0.004, 0.02) ** 2 / (2.0 * 0.3 * 9.81)  # as friction brings it to speed
    np.testing.assert_allclose([y.p_WO for y in ys], way, atol=slip + 3e-5)
    assert all(y.yaw_O == 0.0 for y in ys)


def test_a_bump_takes_the_object_its_way_at_its_time():
    ys = course(replace(AWAY, nudge=np.array([0.006, -0.008]), nudge_time=0.3), 0.9)
    np.testing.assert_array_equal(ys[19].p_WO, [0.0, 0.0])
    np.testing.assert_allclose(ys[-1].p_ground, [0.006, -0.008], atol=1e-12)
    np.testing.assert_allclose(ys[-1].p_WO, [0.006, -0.008], atol=2e-4)
    assert np.linalg.norm(ys[24].p_WO) == pytest.approx(0.1 * 0.075, abs=0.1**2 / (2.0 * 0.3 * 9.81) + 1e-4)


def test_fingers_that_hold_the_object_let_the_ground_slide_on_below():
    p = replace(AWAY, p_WH_0=np.array([-0.11, 0.0]), sigma_0=0.1)
    p = replace(p, carry_velocity=np.array([0.02, -0.03]), carry_from=1.5, carry_until=4.5)
    ys = course(p, 4.5, Inputs(p_WH_cmd=np.array([-0.11, 0.0]), sigma_cmd=0.9))
    assert min(y.touching for y in ys[100:]) >= 2
    np.testing.assert_allclose(ys[-1].p_ground, [0.06, -0.09])
    assert np.linalg.norm(ys[-1].p_WO - ys[99].p_WO) < 0.02
    np.testing.assert_allclose(ys[-1].p_WO, ys[-30].p_WO, atol=1e-3)


def test_spans_add_up_and_count_whole_steps():
    ground = MovingGround(((0.0, 0.01, (1.0, 0.0)), bump((0.0, 0.5), 0.005, 100.0)), 1e-3)
    assert [ground.velocity(k) for k in (0, 5, 9, 10)] == [(1.0, 0.0), (1.0, 100.0), (1.0, 100.0), (0, 0)]
    assert ground.way(20) == pytest.approx((0.01, 0.5))
    assert not MovingGround((bump((0.0, 0.0), 1.0, 0.1), (2.0, 2.0, (1.0, 1.0))), 1e-3).ever_moves


def test_a_carry_that_ends_before_it_begins_is_refused():
    changes: dict[str, Any] = {"carry_from": 1.0, "carry_until": 1.0}
    with pytest.raises(InvalidSceneParameters):
        GraspScene(replace(AWAY, carry_velocity=np.array([0.01, 0.0]), **changes))
    GraspScene(replace(AWAY, **changes))
