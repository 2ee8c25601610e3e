"""Deliveries that the robot finds to have failed by its gripper's angle, and what it cannot know."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from support.controllers.decision_world import EMPTY, END, HOLDING, TO_HUMAN, P, T, World, tug, world
from support.restored_states import assert_passed_on
from support.wording import Wording

from handover.controllers.free_flyer.handover_state_machine import (
    HandoverPhase,
    HandoverStateMachine,
    HandoverTask,
    InvalidHandoverParameters,
    Params,
)

AGAIN = [P.MOVE_TO_HANDOVER, P.ACTIVATE_IMPEDANCE, P.SIGNAL, P.CHECK_VELOCITY, P.RELEASE_OBJECT, P.VERIFY_RELEASE]


def taken_at(delivery: int) -> Callable[[World], None]:
    """A person who bumps the robot at each signal, and takes the object only at this one, from 1 on."""
    bump = tug(0.2)

    def act(w: World) -> None:
        bump(w)
        looks = w.y is not None and w.y.phase is P.VERIFY_RELEASE
        w.angle_closed = EMPTY if looks and w.y is not None and w.y.failed_deliveries == delivery - 1 else HOLDING

    return act


def test_what_was_released_and_is_still_there_was_not_delivered_and_is_offered_again():
    w = world(HandoverTask.ROBOT_TO_HUMAN, taken_at(3), verify=True)
    y = w.run(40.0)[-1]
    assert w.phases() == [*TO_HUMAN, P.VERIFY_RELEASE, *AGAIN, *AGAIN, *END]
    assert (y.failed_deliveries, y.failed_receptions, y.closure) == (2, 0, 0.0)
    light = np.array([y.light for y in w.ys])
    assert np.sum(light[1:] & ~light[:-1]) == 3
    assert_passed_on(partial(HandoverStateMachine, Params(task=HandoverTask.ROBOT_TO_HUMAN, verify=True)), w.us, 6, T)
    kept = world(HandoverTask.ROBOT_TO_HUMAN, taken_at(9), verify=True, attempts=2)
    y = kept.run(40.0)[-1]
    assert kept.phases() == [*TO_HUMAN, P.VERIFY_RELEASE, *AGAIN, P.GIVEN_UP]
    assert (y.failed_deliveries, y.closure, y.pose) == (2, 1.0, True)


def test_while_it_looks_it_coasts_with_fingers_that_open_and_close():
    """An object that floats away is taken for delivered: the fingers close on nothing, as where the person has it."""
    w = world(HandoverTask.ROBOT_TO_HUMAN, taken_at(1), verify=True, verify_wait=0.32, gripper_time=0.8)
    assert w.run(25.0)[-1].failed_deliveries == 0
    assert w.phases() == [*TO_HUMAN, P.VERIFY_RELEASE, *END]
    released, looking = ([y for y in w.ys if y.phase is phase] for phase in (P.RELEASE_OBJECT, P.VERIFY_RELEASE))
    assert not any(y.impedance or y.pose for y in [*released, *looking])
    assert [y.closure for y in released] == [0.0] * len(released)
    assert len(looking) * T == pytest.approx(1.12, abs=1.5 * T)
    assert sum(y.closure == 0.0 for y in looking) * T == pytest.approx(0.32, abs=1.5 * T)
    assert all(y.impedance is not y.pose for y in w.ys if y.phase not in (P.RELEASE_OBJECT, P.VERIFY_RELEASE))


def test_collaboration_goes_on_once_the_object_was_taken():
    w = world(HandoverTask.COLLABORATIVE, taken_at(2), verify=True)
    w.run(60.0)
    given = [*TO_HUMAN, P.VERIFY_RELEASE, *AGAIN]
    back = [P.MOVE_TO_HANDOVER, P.ACTIVATE_IMPEDANCE, P.SIGNAL, P.CHECK_VELOCITY]
    assert w.phases()[: len(given) + 4] == [*given, *back]
    looked = max(i for i, y in enumerate(w.ys) if y.phase is P.VERIFY_RELEASE)
    assert w.ys[looked + 1].closure == 0.0  # open for what the person gives


@pytest.mark.parametrize(
    ("phase", "task"),
    [
        (P.MOVE_TO_HANDOVER, HandoverTask.ROBOT_TO_HUMAN),
        (P.ACTIVATE_IMPEDANCE, HandoverTask.COLLABORATIVE),
        (P.SIGNAL, HandoverTask.ROBOT_TO_HUMAN),
        (P.CHECK_VELOCITY, HandoverTask.COLLABORATIVE),
    ],
)
def test_an_object_that_is_gone_though_it_was_not_released_is_a_failed_delivery(
    phase: HandoverPhase, task: HandoverTask
):
    def snatch(w: World) -> None:
        if w.y is not None and w.y.phase is phase:
            w.angle_closed = EMPTY

    w = world(task, snatch)
    y = w.run(15.0)[-1]
    assert w.phases() == [*TO_HUMAN[: TO_HUMAN.index(phase) + 1], P.GIVEN_UP]
    assert y.failed_deliveries == 1


def test_a_robot_that_receives_or_holds_still_does_not_look_for_an_object():
    for task in (HandoverTask.HUMAN_TO_ROBOT, HandoverTask.HOLD):
        w = world(task, verify=True)
        w.angle_closed = EMPTY
        assert w.run(8.0)[-1].failed_deliveries == 0
        assert w.phases()[-1] in (P.CHECK_VELOCITY, P.ACTIVATE_IMPEDANCE)


def test_a_look_that_outlasts_the_patience_is_refused(wording: Wording):
    with pytest.raises(InvalidHandoverParameters) as refused:
        HandoverStateMachine(Params(task=HandoverTask.ROBOT_TO_HUMAN, verify=True, verify_wait=2.5, patience=3.0))
    wording.check(refused.value)
