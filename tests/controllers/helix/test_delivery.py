"""Carrying and dropping: when the arm sets off, where to, when it opens, and that nothing changes without it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_passed_on

from handover.controllers.helix.servo.task import Delivery, Phase, Verdict
from handover.controllers.helix.servo.visual_servo import Inputs, Outputs, Params, VisualServo

P_WG_DROP = np.array([0.0, -0.16, -0.64])
DELIVERS = Params(delivers=True, p_WG_drop=P_WG_DROP, shaping_time=0.0)
BALL = np.array([0.02, 0.0, -0.68])
ABOVE = BALL + np.array([0.0, 0.0, 0.05])


def measured(p_WG: Any, sees_ring: bool = True) -> Inputs:
    """Return measurements of a gripper that hangs straight down at a place."""
    p = np.asarray(p_WG, dtype=np.float64)
    near = 1e-8 * np.eye(3)
    up = np.array([0.0, 0.0, 0.1])
    return Inputs(
        p_WO_meas=BALL, p_WR_meas=p + up, p_WG_meas=p, cov_O=near, cov_R=near, cov_G=near, seen_O=True, seen_R=sees_ring
    )


class Course:
    """A servo that is shown where the gripper is, control period by control period."""

    def __init__(self, params: Params) -> None:
        self.servo, self.given = VisualServo(params), list[Inputs]()

    def show(self, p_WG: Any, steps: int = 1, sees_ring: bool = True) -> Outputs:
        y = self.servo.outputs(0.0, measured(p_WG))
        for _ in range(steps):
            y = self.servo.step(0.5 * len(self.given), 0.5, measured(p_WG, sees_ring))
            self.given.append(measured(p_WG, sees_ring))
        return y

    def until(self, phase: Phase, p_WG: Any) -> list[Outputs]:
        """Show a gripper at a place until the servo is in a phase; return all that it gave until then."""
        shown = [self.show(p_WG)]
        while shown[-1].phase is not phase:
            assert len(shown) < 60, shown[-1].phase
            shown.append(self.show(p_WG))
        return shown

    def take(self) -> list[Outputs]:
        """Show a gripper that comes to the ball, closes and is about to carry it."""
        self.until(Phase.DESCEND, ABOVE)
        return self.until(Phase.CARRY, BALL)


def test_it_carries_the_ball_a_while_after_the_gripper_has_closed_and_opens_over_the_place():
    course = Course(DELIVERS)
    phases = [y.phase for y in course.take()]
    assert phases.count(Phase.HOLD) == round(DELIVERS.carry_after / 0.5)
    before, after = course.show(BALL), course.show(BALL, 2)
    assert before.closure == 1.0
    assert before.error == pytest.approx(np.linalg.norm(P_WG_DROP - BALL), abs=1e-3)
    assert after.q_sys[[1, 4, 7]].sum() > before.q_sys[[1, 4, 7]].sum()  # y of B points to -y of W
    y = course.show(P_WG_DROP + np.array([2.0 * DELIVERS.threshold_drop, 0.0, 0.0]), 30)
    assert (y.phase, y.closure) == (Phase.CARRY, 1.0)
    near = P_WG_DROP + np.array([0.8 * DELIVERS.threshold_drop, 0.0, 0.0])
    shown = [course.show(near) for _ in range(12)]
    opened = [y.phase for y in shown].index(Phase.DROP)
    assert opened > 0
    assert [y.closure for y in shown] == [1.0] * opened + [0.0] * (12 - opened)
    assert all(np.array_equal(y.q_sys, shown[opened].q_sys) for y in shown[opened:])
    assert_passed_on(lambda: VisualServo(DELIVERS), course.given, 3, 0.5)


@pytest.mark.parametrize("sees_ring", [True, False])
def test_a_carrying_arm_that_makes_no_progress_or_is_not_seen_gives_up_and_keeps_the_ball(sees_ring: bool):
    course = Course(replace(DELIVERS, patience=8))
    course.take()
    y = course.show(BALL, 60, sees_ring)
    assert (y.phase, y.closure) == (Phase.GIVEN_UP, 1.0)
    assert (y.verdict is Verdict.LOST_RING) == (not sees_ring)
    assert y.verdict is not Verdict.NONE
    assert not sees_ring or y.error == pytest.approx(np.linalg.norm(P_WG_DROP - BALL), abs=1e-3)


def test_without_delivery_the_gripper_keeps_the_ball():
    course = Course(replace(DELIVERS, delivers=False))
    course.until(Phase.DESCEND, ABOVE)
    course.until(Phase.HOLD, BALL)
    assert course.show(BALL, 40).phase is Phase.HOLD


@pytest.mark.parametrize("judge_apart", [True, False])
def test_a_tilt_keeps_it_closed_only_where_tilts_are_judged_apart(judge_apart: bool):
    params = replace(DELIVERS, judge_apart=judge_apart, settle_steps=1)
    delivery = Delivery(params)
    assert delivery.following(Phase.HOLD, params.closing_time + params.carry_after, 0.0, 0.0) is Phase.CARRY
    tilted = delivery.following(Phase.CARRY, 100.0, 0.0, 2.0 * params.threshold_tilt)
    assert tilted is (Phase.CARRY if judge_apart else Phase.DROP)
