"""A floating base with an arm: conservation, MuJoCo, the rigid body that it is with its joints locked, and stops."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from support.plants.arm_scene import limits, mujoco_course, tumbling
from support.restored_states import assert_continues
from support.restored_states import flat as entries

from handover.cosim.blocks.plain_rotation import ZERO
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.rigid_body import Wrenches
from handover.plants.free_flyer.robot.free_flyer import FreeFlyer, Inputs, InvalidFlyerParameters, Params
from handover.plants.free_flyer.robot.stopping_joints import JointLimits, Motion, StoppingJoints

NOTHING: Wrenches = (ZERO, ZERO, ZERO, ZERO)
PUSH: Wrenches = ((0.5, 0.2, -0.3), (0.02, 0.01, -0.02), (3.0, -2.0, 4.0), (0.1, 0.2, -0.1))
TORQUES = (0.05, -0.04, 0.03)
IDLE = (0.0, 0.0, 0.0)


def flat(motion: Motion) -> Floats:
    return np.concatenate([np.ravel(x) for x in astuple(motion)])


def walk(robot: StoppingJoints, steps: int, wrench: Wrenches, tau_J: tuple[float, ...], h: float = 0.004) -> Floats:
    for _ in range(steps):
        robot.advance(h, wrench, tau_J)
    return flat(robot.motion())


def test_momenta_and_energy_stay_while_the_arm_whirls():
    robot = tumbling(limits(3))
    walk(robot, 100, NOTHING, (0.04, -0.03, 0.02))
    before, energy, (_, _, v, L, _, pi) = robot.motion(), robot.energy, robot.state
    assert min(abs(rate) for rate in before.v_J) > 0.1
    walk(robot, 400, NOTHING, IDLE)
    assert np.max(np.abs(np.subtract(robot.motion().q_J, before.q_J))) > 1.0
    assert (robot.state[2], robot.state[3]) == (v, L)
    assert robot.state[5] != pi
    assert robot.energy == pytest.approx(energy, rel=1e-10)


def test_agrees_with_mujoco_on_the_same_wrenches_and_torques():
    robot, q_J = tumbling(limits(3)), (0.3, -0.4, 0.8)
    start = robot.motion()
    velocities = np.concatenate([start.v_WB, start.w_WB, start.v_J])
    end, path = mujoco_course(q_J, (np.array(start.p_WB), velocities), PUSH, TORQUES, 125, 0.004)
    for p_WG in path:
        robot.advance(0.004, PUSH, TORQUES)
        np.testing.assert_allclose(robot.motion().p_WG, p_WG, rtol=0.0, atol=5e-5)
    np.testing.assert_allclose(robot.motion().q_J, end[7:], atol=1e-6)
    assert np.linalg.norm(np.subtract(robot.motion().q_J, q_J)) > 0.3


def test_error_falls_with_the_fourth_power_of_the_step():
    exact = walk(tumbling(limits(3)), 200, PUSH, TORQUES, h=0.002)
    wide, narrow = (
        float(np.max(np.abs(walk(tumbling(limits(3)), round(0.4 / h), PUSH, TORQUES, h) - exact)))
        for h in (0.016, 0.008)
    )
    assert 10.0 < wide / narrow < 30.0


def test_with_locked_joints_it_moves_as_one_whose_joints_have_no_range():
    """The one is a rigid body of base and links; the other's joints are held by constraints."""
    robot, q_J = tumbling(limits(3)), (0.3, -0.4, 0.8)
    robot.lock()
    held = tumbling(JointLimits(q_J, q_J, (0.0,) * 3, (0.0,) * 3))
    (_, _, _, L, *_), (_, _, _, other, *_) = robot.state, held.state
    np.testing.assert_allclose(L, other, atol=1e-12)
    np.testing.assert_allclose(walk(robot, 60, PUSH, TORQUES), walk(held, 60, PUSH, TORQUES), atol=1e-8)
    assert robot.motion().q_J == q_J


def test_a_joint_stops_at_its_limit_loses_energy_there_and_stays_until_it_is_pulled_back():
    robot = tumbling(limits(3, reach=0.9))
    (_, _, v, L, _, _), hit = robot.state, False
    walk(robot, 60, NOTHING, (0.1, -0.08, 0.02))
    energy = robot.energy
    for _ in range(200):
        robot.advance(0.004, NOTHING, IDLE)
        assert robot.energy <= energy * (1.0 + 1e-10)
        assert np.max(np.abs(robot.motion().q_J)) <= 0.9
        hit = hit or robot.energy < energy - 0.01
        energy = robot.energy
    assert hit
    walk(robot, 200, NOTHING, (0.5, 0.5, 0.5))
    assert (robot.motion().q_J, robot.motion().v_J) == ((0.9, 0.9, 0.9), IDLE)
    walk(robot, 20, NOTHING, (-0.1, -0.1, -0.1))
    assert max(robot.motion().q_J) < 0.9
    assert (robot.state[2], robot.state[3]) == (v, L)  # torques between links change no momentum


def test_dry_friction_holds_a_joint_up_to_its_torque_and_brings_it_to_a_standstill():
    robot = tumbling(limits(3, friction=0.2))
    walk(robot, 30, NOTHING, (0.1, -0.1, 0.1))
    assert robot.motion().q_J == (0.3, -0.4, 0.8)
    walk(robot, 50, NOTHING, (0.3, 0.0, 0.0))
    moved = robot.motion()
    assert moved.v_J[0] > 0.1
    energy = robot.energy
    for _ in range(100):
        robot.advance(0.004, NOTHING, IDLE)
        assert robot.energy <= energy * (1.0 + 1e-10)
        energy = robot.energy
    rest = robot.motion()
    assert rest.v_J == IDLE
    walk(robot, 20, NOTHING, IDLE)
    assert robot.motion().q_J == rest.q_J
    assert rest.q_J[0] > moved.q_J[0]


def test_a_blow_at_a_limit_moves_a_joint_that_dry_friction_holds():
    robot = tumbling(JointLimits((-9.0, -0.9, -9.0), (9.0, 0.9, 9.0), (0.3, 0.0, 0.0), (0.0,) * 3))
    while robot.motion().q_J[1] < 0.9:
        assert robot.motion().q_J[0] == 0.3
        robot.advance(0.004, NOTHING, (0.0, 0.08, 0.0))
    assert robot.motion().v_J[0] > 0.5


def test_a_joint_without_range_does_not_turn_and_the_others_do():
    robot = tumbling(JointLimits((-9.0, -0.4, -9.0), (9.0, -0.4, 9.0), (0.0,) * 3, (0.0,) * 3))
    walk(robot, 50, PUSH, TORQUES)
    q_J = robot.motion().q_J
    assert q_J[1] == -0.4
    assert min(abs(q_J[0] - 0.3), abs(q_J[2] - 0.8)) > 0.01


ARMED = Params(
    joints=3, lower_J=np.full(3, -0.2), upper_J=np.full(3, 0.2), q_J_0=np.full(3, 0.15), friction_J=np.full(3, 0.02)
)
HELD = Inputs(**dict(zip(("f_B", "tau_B", "f_G", "tau_G", "tau_J"), map(np.array, (*PUSH, TORQUES)), strict=True)))


def test_a_robot_with_an_arm_goes_on_bit_for_bit_after_a_state_is_restored():
    robot = FreeFlyer(ARMED)
    assert np.max(np.abs([robot.step(0.016 * i, 0.016, HELD).q_J for i in range(15)])) == 0.2
    assert_continues(lambda: FreeFlyer(ARMED), lambda _: HELD, [15], 5)


def test_with_no_tolerance_the_joints_are_fixed_and_with_some_they_go_no_farther():
    p = Params(joints=2, q_J_0=np.array([0.2, -0.3, 0.0]))
    for tolerance in (0.0, 0.05):
        robot = FreeFlyer(replace(p, tolerance_J=tolerance))
        y = [robot.step(0.016 * i, 0.016, HELD) for i in range(15)]
        strayed = np.max(np.abs([now.q_J[:2] - p.q_J_0[:2] for now in y]))
        assert strayed == pytest.approx(tolerance, abs=1e-12)


def test_torque_is_limited_and_joints_lock_when_they_are_to():
    p = Params(joints=2, torque_max_J=np.full(3, 0.05), lock_time=0.32)
    strong, weak = Inputs(tau_J=np.array([5.0, -5.0, 9.0])), Inputs(tau_J=np.array([0.05, -0.05, 0.0]))
    a, b = FreeFlyer(p), FreeFlyer(p)
    for i in range(20):
        np.testing.assert_array_equal(
            entries(a.step(0.016 * i, 0.016, strong)), entries(b.step(0.016 * i, 0.016, weak))
        )
    before = a.outputs(0.32, strong)
    assert np.min(np.abs(before.v_J[:2])) > 0.1
    after = a.step(0.32, 0.016, strong)
    np.testing.assert_array_equal(after.q_J, before.q_J)
    assert not np.any(after.v_J)


def test_without_joints_the_arm_counts_for_nothing():
    plain, other = FreeFlyer(Params()), FreeFlyer(Params(mass_L=np.full(3, 5.0), q_J_0=np.ones(3)))
    for i in range(5):
        a, b = (robot.step(0.016 * i, 0.016, HELD) for robot in (plain, other))
        np.testing.assert_array_equal(entries(a), entries(b))
        np.testing.assert_array_equal(a.q_WG, a.q_WB)
        assert not np.any(a.q_J)


def test_what_no_arm_is_is_refused_all_at_once():
    with pytest.raises(InvalidFlyerParameters) as caught:
        FreeFlyer(
            Params(
                joints=3,
                I_B=-np.eye(3),
                axis_J=np.diag([1.0, 0.0, 1.0]),
                mass_L=np.array([0.1, 0.1, -0.1]),
                I_L=np.array([[0.1, 0.1, -0.1], [0.1, 0.1, 0.5], [0.1, 0.1, 0.1]]),
                lower_J=np.array([0.5, 1.0, -1.0]),
                upper_J=np.array([-0.5, 2.0, 1.0]),
            )
        )
    text = caught.value.faults
    found = ("I_B must be", "axis_J[2]", "mass_L[3]", "I_L[1]", "I_L[2]", "lower_J[1] 0.5 rad", "q_J_0[2] 0 rad")
    assert len(text) == len(found)
    assert all(any(name in fault for fault in text) for name in found)
