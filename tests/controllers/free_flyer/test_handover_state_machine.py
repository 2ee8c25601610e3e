"""The sequences of figures 3.2 and 3.3, with a robot that reaches its goal immediately unless a person moves it."""

from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.controllers.decision_world import EMPTY, END, HOLDING, RECEIVE, TO_HUMAN, P, T, World, first, tug, world
from support.restored_states import assert_outputs_change_nothing, assert_passed_on
from support.wording import Wording

from handover.controllers.free_flyer.handover_state_machine import (
    HandoverStateMachine,
    HandoverTask,
    Inputs,
    InvalidHandoverParameters,
    Params,
)
from handover.controllers.free_flyer.ports import Behaviour
from handover.controllers.free_flyer.published_rate import (
    AdmittanceController67,
    HandoverStateMachine67,
    ImpedanceController67,
    PoseController67,
)
from handover.controllers.free_flyer.velocity_monitor import VelocityMonitor
from handover.cosim.blocks.description import describe

VELOCITIES = {"release_velocity": 0.1, "receive_velocity": 0.06}


def test_robot_to_human_goes_through_figure_3_2():
    w = world(HandoverTask.ROBOT_TO_HUMAN, tug(0.2))
    ys = w.run(20.0)
    assert w.phases() == TO_HUMAN + END
    closed = {P.GRASP_OBJECT, P.MOVE_TO_HANDOVER, P.ACTIVATE_IMPEDANCE, P.SIGNAL, P.CHECK_VELOCITY}
    yielding = {P.ACTIVATE_IMPEDANCE, P.SIGNAL, P.CHECK_VELOCITY, P.RELEASE_OBJECT}
    for y in ys:
        assert y.closure == (1.0 if y.phase in closed else 0.0)
        assert y.impedance == (y.phase in yielding)
        assert y.pose is not y.impedance
        assert y.light == (y.phase is P.SIGNAL)
        assert y.failed_receptions == 0
    np.testing.assert_allclose(first(ys, P.GRASP_OBJECT).p_WG_goal, [-0.10, -0.64, 0.0])
    np.testing.assert_array_equal(first(ys, P.CHECK_VELOCITY).p_WG_goal, [0.0, -0.07, 0.0])
    np.testing.assert_array_equal(ys[-1].p_WG_goal, Params().p_WG_retreat)


def test_human_to_robot_goes_through_figure_3_3():
    w = world(HandoverTask.HUMAN_TO_ROBOT, tug(0.05))
    ys = w.run(15.0)
    approach = [P.OPEN_GRIPPER, P.MOVE_TO_HANDOVER, P.ACTIVATE_IMPEDANCE, P.SIGNAL]
    assert w.phases() == approach + RECEIVE + END
    assert ys[-1].closure == 1.0
    assert ys[-1].failed_receptions == 0


def test_failed_reception_opens_and_signals_again():
    def person(w: World) -> None:
        pull(w)
        w.angle_closed = HOLDING if w.y and w.y.failed_receptions == 2 else EMPTY

    pull = tug(0.05)
    w = world(HandoverTask.HUMAN_TO_ROBOT, person)
    ys = w.run(25.0)
    again = [P.OPEN_GRIPPER, P.SIGNAL]
    approach = [P.OPEN_GRIPPER, P.MOVE_TO_HANDOVER, P.ACTIVATE_IMPEDANCE, P.SIGNAL]
    assert w.phases() == approach + RECEIVE + again + RECEIVE + again + RECEIVE + END
    assert ys[-1].failed_receptions == 2
    light = np.array([y.light for y in ys])
    assert np.sum(light[1:] & ~light[:-1]) == 3  # a person reacts to its beginning
    assert all(y.impedance for y in ys if y.phase is P.OPEN_GRIPPER and y.failed_receptions)


def test_after_a_failure_it_waits_until_the_gripper_is_calm():
    rings = [0.0]

    def person(w: World) -> None:
        pull(w)
        if w.y and w.y.phase is P.OPEN_GRIPPER and w.y.failed_receptions and rings[0] < 6.0:
            rings[0] += T
            w.v_WB = np.array([0.0, 0.05, 0.0])

    pull = tug(0.05)
    w = world(HandoverTask.HUMAN_TO_ROBOT, person)
    w.angle_closed = EMPTY
    ys = w.run(14.0)
    opening = sum(y.phase is P.OPEN_GRIPPER and y.failed_receptions == 1 for y in ys) * T
    assert opening > 6.0 + 0.5


def test_collaborative_gives_waits_there_and_receives():
    w = world(HandoverTask.COLLABORATIVE, tug(0.2), pause=4.0)
    ys = w.run(35.0)
    assert w.phases() == [*TO_HUMAN, P.ACTIVATE_IMPEDANCE, P.SIGNAL, *RECEIVE, *END]
    released = next(i for i, y in enumerate(ys) if y.phase is P.RELEASE_OBJECT)
    end = next(i for i, y in enumerate(ys) if y.phase is P.DEACTIVATE_IMPEDANCE)
    assert all(y.impedance and y.p_WG_goal[0] == 0.0 for y in ys[released:end])
    waits = sum(y.phase is P.ACTIVATE_IMPEDANCE for y in ys[released:])
    assert waits * T == pytest.approx(4.0, abs=0.05)
    assert ys[-1].closure == 1.0


def test_hold_yields_at_the_handover_pose_from_the_start_for_good():
    w = world(HandoverTask.HOLD, lambda w: setattr(w, "v_WB", np.array([0.3, 0.0, 0.0])), patience=1.0)
    for y in [w.machine.outputs(0.0, Inputs()), *w.run(5.0)]:
        assert y.phase is P.ACTIVATE_IMPEDANCE
        assert (y.impedance, y.pose, y.light) == (True, False, False)
        np.testing.assert_array_equal(y.p_WG_goal, [0.0, -0.07, 0.0])


@pytest.mark.parametrize(
    ("task", "given", "threshold"),
    [
        (HandoverTask.ROBOT_TO_HUMAN, {"behaviour": Behaviour.RIGID}, 0.059),
        (HandoverTask.ROBOT_TO_HUMAN, {"behaviour": Behaviour.COMPLIANT}, 0.08),
        (HandoverTask.HUMAN_TO_ROBOT, {"behaviour": Behaviour.RIGID}, 0.021),
        (HandoverTask.HUMAN_TO_ROBOT, {"behaviour": Behaviour.COMPLIANT}, 0.037),
        (HandoverTask.HUMAN_TO_ROBOT, {"behaviour": Behaviour.CUSTOM, **VELOCITIES}, 0.06),
        (HandoverTask.ROBOT_TO_HUMAN, {"behaviour": Behaviour.CUSTOM, **VELOCITIES}, 0.1),
    ],
)
def test_published_velocities_decide_or_those_given(task: HandoverTask, given: dict[str, Any], threshold: float):
    """Just below the threshold nothing happens, just above it does."""
    for factor, moves in ((0.99, False), (1.01, True)):
        w = world(task, tug(factor * threshold), **given)
        w.run(12.0)
        assert (w.phases()[-1] is not P.CHECK_VELOCITY) is moves


def test_gripper_velocity_has_the_share_of_the_turning():
    """v + w x R p, eq. (3.10): turned by 90 degrees about z the arm lies along -y, and w_x moves it along -z."""
    q = Rotation.from_euler("z", 90, degrees=True).as_quat(scalar_first=True)
    machine = HandoverStateMachine(Params())
    u = Inputs(q_WB_meas=q, v_WB_meas=np.array([0.0, 0.0, 0.1]), w_WB_meas=np.array([0.5, 0.0, 0.0]))
    assert machine.step(0.0, T, u).speed_G == pytest.approx(abs(0.1 - 0.5 * 0.30))


def test_impedance_begins_only_near_the_place_and_at_rest_and_the_signal_waits_for_its_transient():
    """Within the gate but off by more than the tolerance the spring still swings: no light yet."""

    def drift(w: World) -> None:
        w.follows = False
        w.p_WG = np.array([0.06 if w.t < 5.0 else 0.03 if w.t < 12.0 else 0.0, -0.07, 0.0])
        w.v_WB = np.array([0.02 if w.t < 8.0 else 0.0, 0.0, 0.0])

    w = world(HandoverTask.HUMAN_TO_ROBOT, drift)
    w.run(14.0)
    begun, lit = (next(i for i, y in enumerate(w.ys) if getattr(y, name)) * T for name in ("impedance", "light"))
    assert begun == pytest.approx(8.0 + 0.5, abs=0.3)
    assert lit == pytest.approx(12.5, abs=0.1)


def test_without_the_gate_a_moving_robot_yields_signals_and_takes_its_own_motion_for_a_pull():
    def fly_past(w: World) -> None:
        w.follows = False
        away = max(0.0, 0.3 - 0.07 * w.t)
        w.p_WG = np.array([away, -0.07, 0.0])
        w.v_WB = np.array([-0.07 if away else 0.0, 0.0, 0.0])

    gated = world(HandoverTask.HUMAN_TO_ROBOT, fly_past, gate_error=0.2)
    gated.run(12.0)
    assert gated.phases()[-1] is P.CHECK_VELOCITY
    w = world(HandoverTask.HUMAN_TO_ROBOT, fly_past, gate_error=0.2, gated=False)
    w.run(6.0)
    began = next(i for i, y in enumerate(w.ys) if y.impedance) * T
    assert began == pytest.approx(0.1 / 0.07, abs=0.05)
    assert w.phases()[2:5] == [P.ACTIVATE_IMPEDANCE, P.SIGNAL, P.CHECK_VELOCITY]
    assert P.CLOSE_GRIPPER in w.phases()


def test_times_are_kept_at_the_published_rate():
    for block in (HandoverStateMachine67, ImpedanceController67, AdmittanceController67, PoseController67):
        assert describe(block).period == 1 / Fraction("67.5")
    machine, steps = HandoverStateMachine67(Params(task=HandoverTask.HUMAN_TO_ROBOT, gripper_time=2.0)), 0
    while machine.step(steps * 2 / 135, 2 / 135, Inputs()).phase is P.OPEN_GRIPPER:
        steps += 1
    assert steps * 2 / 135 == pytest.approx(2.0, abs=0.02)


def test_threshold_counts_only_after_the_gripper_was_slower_and_the_low_pass_has_its_time_constant():
    monitor, seen = VelocityMonitor(0.0, T), list[bool]()
    for v in (0.1, 0.1, 0.01, 0.1):
        monitor.measure((v, 0.0, 0.0))
        seen.append(monitor.exceeds(0.05))
    assert seen == [False, False, False, True]
    monitor.disarm()
    assert not monitor.exceeds(0.05)
    smooth = VelocityMonitor(0.08, T)
    smooth.measure((0.0, 0.0, 0.0))
    for n in range(1, 20):
        smooth.measure((0.0, 0.3, 0.4))
        assert smooth.speed == pytest.approx(0.5 * (1.0 - np.exp(-n * T / 0.08)))


def test_motion_since_before_the_second_light_is_no_answer_to_it():
    def act(w: World) -> None:
        pull(w)
        if w.y and w.y.failed_receptions:
            moves = w.y.phase in (P.SIGNAL, P.CHECK_VELOCITY)
            w.v_WB = np.array([0.0, 0.05 if moves else 0.0, 0.0])

    pull = tug(0.05)
    w = world(HandoverTask.HUMAN_TO_ROBOT, act, filter_time=0.0)
    w.angle_closed = EMPTY
    w.run(12.0)
    assert w.phases()[-3:] == [P.OPEN_GRIPPER, P.SIGNAL, P.CHECK_VELOCITY]


def test_patience_ends_and_the_robot_holds_what_it_has():
    """Until then noise of the estimate trips nothing."""
    w = world(HandoverTask.ROBOT_TO_HUMAN, patience=60.0)
    w.rng = np.random.default_rng(3)
    y = w.run(75.0)[-1]
    assert w.phases() == [*TO_HUMAN[:-1], P.GIVEN_UP]
    assert (y.impedance, y.pose, y.light, y.closure) == (False, True, False, 1.0)
    np.testing.assert_allclose(y.p_WG_goal, w.p_WG, atol=0.005)
    assert sum(x.phase is P.CHECK_VELOCITY for x in w.ys) * T == pytest.approx(60.0, abs=0.05)


def test_what_is_not_there_is_noticed_and_too_many_failures_end_it():
    for task, before, failed in (
        (HandoverTask.ROBOT_TO_HUMAN, tug(0.0), 0),
        (HandoverTask.HUMAN_TO_ROBOT, tug(0.05), 2),
    ):
        w = world(task, before, attempts=2)
        w.angle_closed = EMPTY
        y = w.run(30.0)[-1]
        assert (y.phase, y.failed_receptions) == (P.GIVEN_UP, failed)
        assert failed or w.phases() == [P.OPEN_GRIPPER, P.MOVE_TO_OBJECT, P.GRASP_OBJECT, P.GIVEN_UP]


def test_object_is_approached_straight_ahead():
    """From the standoff on the gripper's own -x, turned with it."""
    q = Rotation.from_euler("z", 90, degrees=True).as_quat(scalar_first=True)
    p = Params(task=HandoverTask.ROBOT_TO_HUMAN, q_WG_object=q, approach=0.2)
    np.testing.assert_allclose(p.standoff() - p.object_goal(), [0.0, 0.2, 0.0], atol=1e-12)
    w = world(HandoverTask.ROBOT_TO_HUMAN, approach=0.2)
    goals = [y.p_WG_goal for y in w.run(6.0) if y.phase is P.MOVE_TO_OBJECT]
    np.testing.assert_allclose(goals[0], [0.1, -0.64, 0.0])
    np.testing.assert_allclose(goals[-1], [-0.1, -0.64, 0.0])


def test_what_cannot_work_is_refused_all_at_once(wording: Wording):
    impatient: dict[str, Any] = {"patience": 2.0, "signal_time": 3.0, "pause": 4.0}
    away = {"p_WG_handover": np.array([-0.5, 0.0, 0.0]), "p_WG_retreat": np.array([1.9, 0.0, 0.0])}
    unusable: tuple[tuple[dict[str, Any], int], ...] = (
        ({"task": HandoverTask.HUMAN_TO_ROBOT, **away, "behaviour": Behaviour.CUSTOM, "receive_velocity": 0.005}, 4),
        ({"task": HandoverTask.COLLABORATIVE, **impatient}, 2),
        ({"q_WG_handover": np.zeros(4)}, 1),
    )
    for given, faults in unusable:
        with pytest.raises(InvalidHandoverParameters) as caught:
            HandoverStateMachine(Params(**given))
        assert len(caught.value.faults) == faults
        wording.check(caught.value)
    HandoverStateMachine(Params(task=HandoverTask.HOLD, **impatient))


def test_restored_state_continues_bit_for_bit():
    w = world(HandoverTask.COLLABORATIVE, tug(0.2))
    w.rng = np.random.default_rng(1)
    w.run(20.0)
    assert P.CLOSE_GRIPPER in w.phases()
    make = partial(HandoverStateMachine, Params(task=HandoverTask.COLLABORATIVE))
    assert_passed_on(make, w.us, 6, T)
    u = Inputs(p_WB_meas=np.array([0.2, 0.1, 0.0]))
    assert_outputs_change_nothing(make, u, same=True)
    np.testing.assert_allclose(make().outputs(0.0, u).p_WG_goal, [-0.1, 0.1, 0.0])


def test_inputs_are_not_kept():
    machine = HandoverStateMachine(Params(task=HandoverTask.ROBOT_TO_HUMAN))
    u = Inputs(p_WB_meas=np.array([0.2, 0.1, 0.0]))
    y = machine.step(0.0, T, u)
    u.p_WB_meas[:] = 9.0
    y.p_WG_goal[:] = 9.0
    np.testing.assert_allclose(machine.step(T, T, u).p_WG_goal, [-0.1, 0.1, 0.0])
