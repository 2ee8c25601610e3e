"""The controller's model of a robot with an arm: by differences, by the thesis's formulas, and beside the plant."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.controllers.free_flyer.arm_model import (
    ArmModel,
    Chain,
    OperationalSpace,
    coriolis_matrix,
    mass_matrix,
    operational_bias,
)
from handover.cosim.blocks.geometry import rotation_by
from handover.cosim.blocks.plain_rotation import ZERO, quaternion, vector
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.arm import Arm
from handover.plants.free_flyer.robot.articulated_body import ArticulatedBody
from handover.plants.free_flyer.robot.free_flyer import Params as FlyerParams
from handover.plants.free_flyer.robot.stopping_joints import JointLimits, Motion, StoppingJoints

I_B = np.array([[0.1534, 0.01, -0.02], [0.01, 0.1427, 0.005], [-0.02, 0.005, 0.1623]])
P_BG = np.array([-0.3, 0.02, 0.05])
AXES = np.array([[0.0, 1.0, 0.0], [0.0, 0.6, 0.8], [1.0, 0.0, 0.0]])
LINKS = np.array([[-0.1, 0.0, 0.02], [-0.05, 0.01, 0.0], [-0.05, 0.03, 0.02]])
CENTRES, MASSES = np.array([0.5, 0.4, 0.6]), np.array([0.4, 0.3, 0.2])
MOMENTS = np.array([[0.02, 0.025, 0.02], [0.013, 0.011, 0.006], [0.002, 0.002, 0.003]])
ROTORS = np.array([0.01, 0.0, 0.003])
SEEDS = range(2)


def model(n: int) -> ArmModel:
    return ArmModel(
        joints=n, mass=9.584, I_B=I_B, p_BG=P_BG, axes=AXES, links=LINKS, centres=CENTRES, masses=MASSES,
        inertias=MOMENTS, rotors=ROTORS,
    )  # fmt: skip


class At:
    """A random state of a robot with n joints, and what it is a time later at constant xi'."""

    def __init__(self, seed: int, n: int) -> None:
        rng = np.random.default_rng(seed)
        self.n, self.model = n, model(n)
        self.R = Rotation.random(rng=rng).as_matrix()
        self.p, self.v, self.w = rng.normal(size=(3, 3))
        self.q_J, self.v_J = rng.uniform(-1.5, 1.5, n), rng.normal(size=n)
        self.xi_dot = np.concatenate([self.v, self.w, self.v_J])

    def chain(self, t: float = 0.0) -> Chain:
        return Chain(self.model, rotation_by(t * self.w) @ self.R, self.w, self.q_J + t * self.v_J, self.v_J)

    def place(self, i: int, t: float) -> Floats:
        return self.p + t * self.v + self.chain(t).p[i]


@pytest.mark.parametrize("n", [0, 2, 3])
def test_jacobians_and_their_rates_are_derivatives(n: int):
    at, h = At(0, n), 1e-6
    for i in range(n + 2):
        moved = (at.place(i, h) - at.place(i, -h)) / (2.0 * h)
        link = min(i, n)
        R, after, before = (at.chain(t).R[link] for t in (0.0, h, -h))
        turned = (after - before) @ np.transpose(R) / (2.0 * h)
        twist = at.chain().jacobian(i) @ at.xi_dot
        np.testing.assert_allclose(twist[:3], moved, atol=1e-8)
        np.testing.assert_allclose(twist[3:], [turned[2, 1], turned[0, 2], turned[1, 0]], atol=1e-8)
        by_differences = (at.chain(h).jacobian(i) - at.chain(-h).jacobian(i)) / (2.0 * h)
        np.testing.assert_allclose(at.chain().jacobian_rate(i), by_differences, atol=1e-8)


def test_the_rate_of_B_less_twice_C_is_skew():
    at, h = At(0, 3), 1e-6
    rate = (mass_matrix(at.chain(h)) - mass_matrix(at.chain(-h))) / (2.0 * h)
    S = rate - 2.0 * coriolis_matrix(at.chain())
    np.testing.assert_allclose(S, -np.transpose(S), atol=1e-7)
    assert np.max(np.abs(S)) > 0.1


def robot_at(at: At) -> StoppingJoints:
    """Return the plant in a state, its joints at rest."""
    arm = Arm.of(at.n, P_BG, AXES, LINKS, CENTRES, MASSES, MOMENTS, ROTORS)
    free = JointLimits((-9.0,) * at.n, (9.0,) * at.n, (0.0,) * at.n, (0.0,) * at.n)
    q = quaternion(np.asarray(Rotation.from_matrix(at.R).as_quat(scalar_first=True)))
    start = (vector(at.p), q), (vector(at.v), vector(at.w))
    return StoppingJoints(ArticulatedBody(9.584, I_B, arm), free, tuple(at.q_J.tolist()), *start)


def xi_dot(m: Motion) -> Floats:
    return np.array([*m.v_WB, *m.w_WB, *m.v_J])


@pytest.mark.parametrize("seed", SEEDS)
def test_it_predicts_how_the_plant_accelerates_and_its_energy(seed: int):
    at, rng, h = At(seed, 3), np.random.default_rng(seed), 2e-5
    robot = robot_at(at)
    f_B, tau_B, f_G, tau_G, tau_J = rng.normal(size=(5, 3)) * [[2.0], [0.1], [2.0], [0.1], [0.1]]
    loads = (vector(f_B), vector(tau_B), vector(f_G), vector(tau_G)), vector(tau_J)
    for _ in range(100):
        robot.advance(0.002, *loads)
    before = robot.motion()
    robot.advance(h, *loads)
    now, stored = robot.motion(), robot.energy
    robot.advance(h, *loads)
    after = robot.motion()
    R = Rotation.from_quat(now.q_WB, scalar_first=True).as_matrix()
    chain, moving = Chain(at.model, R, np.array(now.w_WB), np.array(now.q_J), np.array(now.v_J)), xi_dot(now)
    B, C, J, J_rate = mass_matrix(chain), coriolis_matrix(chain), chain.jacobian(-1), chain.jacobian_rate(-1)
    u, f_ext = np.concatenate([R @ f_B, R @ tau_B, tau_J]), np.concatenate([f_G, tau_G])
    acceleration = (xi_dot(after) - xi_dot(before)) / (2.0 * h)
    np.testing.assert_allclose(B @ acceleration + C @ moving, u + np.transpose(J) @ f_ext, atol=2e-5)
    assert np.linalg.norm(C @ moving) > 0.01
    space = OperationalSpace.of(J, B)
    x_2 = (np.subtract([*after.v_WG, *after.w_WG], [*before.v_WG, *before.w_WG])) / (2.0 * h)
    impedance = space.B_x @ x_2 + operational_bias(J, J_rate, B, C, moving)
    np.testing.assert_allclose(impedance, np.transpose(space.J_bar) @ u + f_ext, atol=2e-5)
    energy = 0.5 * moving @ B @ moving
    assert np.linalg.norm(now.v_J) > 0.05
    assert stored == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(J @ moving, [*now.v_WG, *now.w_WG], atol=1e-12)


def test_null_motions_leave_the_gripper_where_it_is_and_need_no_force_there():
    at = At(1, 3)
    chain = at.chain()
    J, B = chain.jacobian(-1), mass_matrix(chain)
    space = OperationalSpace.of(J, B)
    np.testing.assert_allclose(J @ space.Z, 0.0, atol=1e-12)
    np.testing.assert_allclose(J @ np.linalg.solve(B, B @ space.Z), 0.0, atol=1e-12)
    np.testing.assert_allclose(J @ space.J_bar, np.eye(6), atol=1e-10)
    np.testing.assert_allclose(np.transpose(space.J_bar) @ B @ space.Z, 0.0, atol=1e-10)


def test_the_whole_is_what_its_parts_make_up():
    at = At(2, 3)
    whole, robot = at.model.whole(at.q_J), robot_at(at)
    c = np.array(robot.body.posture(robot.state[4]).p_BC)
    robot.lock()
    energy = 0.5 * whole.mass * float(np.dot(robot.state[2], robot.state[2]))
    w = np.linalg.solve(at.R @ whole.I_B @ np.transpose(at.R), robot.state[3])
    assert whole.mass == pytest.approx(robot.body.mass)
    assert robot.energy == pytest.approx(energy + 0.5 * float(w @ np.array(robot.state[3])))
    np.testing.assert_allclose(whole.p_BG + c, Chain(at.model, np.eye(3), np.zeros(3), at.q_J).p[-1], atol=1e-12)
    assert robot.state[3] != ZERO


@pytest.mark.parametrize(
    ("moments", "possible"),
    [
        ((0.02, 0.025, 0.02), True),
        ((0.02, 0.04, 0.02), True),
        ((0.02, 0.0401, 0.02), False),
        ((0.0, 0.01, 0.01), False),
        ((0.02, np.nan, 0.02), False),
        ((0.02, 0.02, np.inf), False),
    ],
)
def test_plant_and_controller_refuse_the_same_inertias_of_a_link(moments: tuple[float, ...], possible: bool):
    inertias = np.array([[0.01] * 3, moments, [0.01] * 3])
    faults = replace(model(2), inertias=inertias).faults()
    assert [fault.startswith("I_L[2]") for fault in faults] == [True] * (not possible)
    assert bool(FlyerParams(joints=2, I_L=inertias).arm_faults()) is not possible
