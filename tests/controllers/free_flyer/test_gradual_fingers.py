"""Fingers that follow pull and push: when they open, close again, and release what they hold."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pytest
from support.controllers.decision_world import ARM, EMPTY, HOLDING, OPEN, P, T, World, world
from support.restored_states import assert_continues
from support.wording import Wording

from handover.controllers.free_flyer.handover_state_machine import (
    HandoverStateMachine,
    HandoverTask,
    Inputs,
    InvalidHandoverParameters,
    Outputs,
    Params,
)
from handover.controllers.free_flyer.velocity_monitor import PullMonitor
from handover.cosim.blocks.ports import Floats


class Fingers:
    """A gripper that follows the closure at 0.6 rad/s and holds something 0.79 rad thick, until it is 0.2 rad wider."""

    def __init__(self) -> None:
        self.angle, self.held = HOLDING, True

    def move(self, closure: float) -> float:
        target = OPEN + closure * (EMPTY - OPEN)
        self.angle += min(max(target - self.angle, -0.6 * T), 0.6 * T)
        self.held &= self.angle <= HOLDING + 0.2
        if self.held:
            self.angle = max(self.angle, HOLDING)
        return self.angle


def offered(speeds: Floats, **params: Any) -> tuple[list[Outputs], Fingers]:
    """What a robot does that gives, while its gripper's speed, from the check on, is this at each step."""
    w = world(HandoverTask.ROBOT_TO_HUMAN, gradual=True, filter_time=0.0, **params)
    fingers, ys, y = Fingers(), list[Outputs](), w.until(P.CHECK_VELOCITY)
    for v in speeds:
        u = Inputs(p_WB_meas=w.p_WG - ARM, v_WB_meas=np.array([v, 0.0, 0.0]), gripper_angle=fingers.move(y.closure))
        y = w.machine.step(w.t, T, u)
        ys.append(y)
    return ys, fingers


def rising(rate: float, up_to: float, seconds: float) -> Floats:
    return np.asarray(np.minimum(rate * T * np.arange(round(seconds / T)), up_to), dtype=np.float64)


def test_gradual_fingers_open_with_the_pull_and_release_what_they_have_opened_for():
    ys, fingers = offered(rising(0.3, 0.12, 1.5))
    share = np.clip((np.array([y.speed_G for y in ys]) / 0.059 - 0.5) / 0.5, 0.0, 1.0)
    waiting = [k for k, y in enumerate(ys) if y.phase is P.CHECK_VELOCITY]
    np.testing.assert_allclose([ys[k].closure for k in waiting], 1.0 - share[waiting], atol=1e-12)
    assert any(0.0 < ys[k].closure < 1.0 for k in waiting)
    assert (ys[-1].phase, fingers.held) == (P.RELEASE_OBJECT, False)
    assert len(waiting) * T > 0.25 / 0.6  # a pull shorter than the fingers take is none
    w = world(HandoverTask.ROBOT_TO_HUMAN, gradual=True)
    w.until(P.CHECK_VELOCITY)
    w.angle_closed = EMPTY  # which is taken for a release
    w.run(2 * T)
    assert w.phases()[-1] is P.RELEASE_OBJECT


def test_gradual_fingers_close_again_where_the_pull_ends_although_the_robot_coasts():
    """Above the threshold all the time: 0.2 s of acceleration, then thrust brakes it."""
    knock = np.asarray(np.concatenate([rising(0.6, 0.12, 0.2), 0.12 - 0.06 * T * np.arange(60)]), dtype=np.float64)
    assert np.min(knock[-60:]) > 0.059
    ys, fingers = offered(knock)
    assert min(y.closure for y in ys) < 1.0
    assert (ys[-1].closure, ys[-1].phase, fingers.held) == (1.0, P.CHECK_VELOCITY, True)


def test_gradual_fingers_close_with_the_push_and_the_threshold_decides():
    w = world(HandoverTask.HUMAN_TO_ROBOT, gradual=True, filter_time=0.0)
    w.until(P.CHECK_VELOCITY)
    np.testing.assert_allclose(closures(w, (0.0, 0.0126, 0.0168, 0.0147, 0.0)), [0.0, 0.2, 0.6, 0.6, 0.0], atol=1e-9)
    closures(w, [0.022])
    assert w.phases()[-1] is P.CLOSE_GRIPPER


def closures(w: World, speeds: Sequence[float]) -> list[float]:
    found: list[float] = []
    for v in speeds:
        w.v_WB = np.array([v, 0.0, 0.0])
        found.append(w.step().closure)
    return found


def test_gradual_restored_state_continues_as_it_was():
    w = world(HandoverTask.ROBOT_TO_HUMAN, gradual=True)
    w.until(P.CHECK_VELOCITY)
    begin = len(w.us)
    w.us += [
        Inputs(p_WB_meas=w.p_WG - ARM, v_WB_meas=np.array([v, 0.0, 0.0]), gripper_angle=HOLDING)
        for v in rising(0.3, 0.12, 1.0)
    ]
    make = partial(HandoverStateMachine, Params(task=HandoverTask.ROBOT_TO_HUMAN, gradual=True))
    assert_continues(make, w.us.__getitem__, range(begin, begin + 42, 6), 20)


def test_a_pull_begins_with_more_than_thrust_gives_and_ends_with_the_braking():
    monitor = PullMonitor(0.15, 0.03, 0.0, T)
    assert not monitor.measure(0.10, 0.03)
    steps = [(0.2, True), (0.0, True), (-0.02, True), (-0.04, False), (0.1, False), (0.2, True)]
    speed = 0.10
    for rate, pulled in steps:
        speed += rate * T
        assert monitor.measure(speed, 0.03) is pulled, rate
    assert not monitor.measure(0.02, 0.03)


def test_a_speed_from_before_the_lights_end_does_not_move_the_fingers():
    """Between the part of the threshold and the threshold, until the gripper has once been slower than that part."""
    w = world(HandoverTask.HUMAN_TO_ROBOT, gradual=True, filter_time=0.0)
    w.until(P.SIGNAL)
    w.v_WB = np.array([0.0168, 0.0, 0.0])
    w.until(P.CHECK_VELOCITY)
    np.testing.assert_allclose(closures(w, [0.0168, 0.0168, 0.0, 0.0168]), [0.0, 0.0, 0.0, 0.6], atol=1e-9)


def test_a_share_that_rest_exceeds_is_refused_for_gradual_fingers_alone(wording: Wording):
    Params(gradual_share=0.4).check()
    for share, count in ((0.1, 2), (0.4, 1)):
        with pytest.raises(InvalidHandoverParameters) as refused:
            Params(gradual=True, gradual_share=share).check()
        assert len(refused.value.faults) == count
        wording.check(refused.value)
