from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.plants.arm_scene import Q_WB, SKEWED, mujoco_course, skewed_arm
from support.restored_states import assert_continues, assert_outputs_change_nothing, flat
from support.wording import Wording

from handover.cosim.blocks.plain_rotation import quaternion, quaternion_multiply, row_major, vector
from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.rigid_body import TurnsTooFast, momentum_rates
from handover.plants.free_flyer.robot.free_flyer import FreeFlyer, Inputs, InvalidFlyerParameters, Outputs, Params

DEFAULT = Params()
TUMBLING = replace(DEFAULT, I_B=SKEWED, v_WB_0=np.array([0.1, -0.2, 0.05]), w_WB_0=np.array([0.5, -0.3, 0.8]))


def matrix(q: Floats) -> Floats:
    return Rotation.from_quat(q, scalar_first=True).as_matrix()


def spin(I_B: Floats, q: Floats, w: Floats) -> Floats:
    """Return the angular momentum in the world, about the centre of mass."""
    R = matrix(q)
    return np.asarray(R @ (I_B @ (np.transpose(R) @ w)), dtype=np.float64)


def walk(robot: FreeFlyer, u: Inputs, steps: int, dt: float = 0.016) -> Outputs:
    y = robot.outputs(0.0, u)
    for i in range(steps):
        y = robot.step(i * dt, dt, u)
    return y


def moved(p: Params, u: Inputs, seconds: float, dt: float = 0.016) -> Outputs:
    return walk(FreeFlyer(p), u, round(seconds / dt), dt)


def wrench(seed: int = 0) -> Inputs:
    rng = np.random.default_rng(seed)
    f_B, tau_B, f_G, tau_G = rng.uniform(-1.0, 1.0, (4, 3)) * [[0.5], [0.02], [0.5], [0.05]]
    return Inputs(f_B=f_B, tau_B=tau_B, f_G=f_G, tau_G=tau_G)


def test_starts_where_it_was_put():
    q = Rotation.from_euler("z", 0.5 * np.pi).as_quat(scalar_first=True)
    y = FreeFlyer(replace(DEFAULT, q_WB_0=q, w_WB_0=np.array([0.0, 0.0, 2.0]))).outputs(0.0, Inputs())
    np.testing.assert_allclose(y.p_WG, [0.30, -0.37, 0.0], atol=1e-15)
    np.testing.assert_allclose(y.v_WG, [0.6, 0.0, 0.0], atol=1e-15)  # w x R p_BG
    np.testing.assert_array_equal(y.q_WG, y.q_WB)


def test_momenta_and_energy_stay_over_ten_seconds_of_tumbling():
    p = TUMBLING
    assert np.min(np.abs(np.linalg.eigvalsh(SKEWED) - 0.15)) > 1e-3  # no principal axis is the rotation's
    robot, w, v = FreeFlyer(p), p.w_WB_0, p.v_WB_0
    y = robot.outputs(0.0, Inputs())
    L, energy = SKEWED @ w, 0.5 * (p.mass * v @ v + w @ SKEWED @ w)
    for i in range(625):
        y = robot.step(0.016 * i, 0.016, Inputs())
        if i % 125 == 124:
            L_now = spin(SKEWED, y.q_WB, y.w_WB)
            energy_now = 0.5 * (p.mass * y.v_WB @ y.v_WB + y.w_WB @ L_now)
            np.testing.assert_allclose(L_now, L, rtol=0.0, atol=1e-9 * float(np.linalg.norm(L)))
            np.testing.assert_allclose(p.mass * y.v_WB, p.mass * v, rtol=1e-12)
            assert energy_now == pytest.approx(energy, rel=1e-9)
            assert np.linalg.norm(y.q_WB) == pytest.approx(1.0, abs=1e-14)
    np.testing.assert_allclose(y.p_WB, p.p_WB_0 + 10.0 * v, rtol=1e-9)


def test_rates_are_newtons_and_eulers_laws():
    rng = np.random.default_rng(4)
    m, e, L, (f_B, tau_B, f_G, tau_G) = 9.584, rng.normal(size=3), rng.normal(size=3), rng.normal(size=(4, 3))
    q = Rotation.random(rng=rng).as_quat(scalar_first=True)
    I_inverse, R = np.linalg.inv(SKEWED), matrix(q)
    wrench = vector(f_B), vector(tau_B), vector(f_G), vector(tau_G)
    a, dL, dq = momentum_rates(1.0 / m, row_major(I_inverse), vector(e), quaternion(q), vector(L), wrench)
    np.testing.assert_allclose(a, (R @ f_B + f_G) / m, rtol=1e-12)
    np.testing.assert_allclose(dL, R @ tau_B + np.cross(R @ e, f_G) + tau_G, rtol=1e-12)
    half_w = vector(0.5 * I_inverse @ np.transpose(R) @ L)
    np.testing.assert_allclose(dq, quaternion_multiply(quaternion(q), (0.0, *half_w)), rtol=1e-12)


@pytest.mark.parametrize("joints", [0, 2])
def test_a_push_on_the_gripper_is_the_wrench_there_and_one_on_the_base_moves_its_joints(joints: int):
    q = Rotation.from_euler("xyz", [0.3, -0.5, 0.9]).as_quat(scalar_first=True)
    p = replace(DEFAULT, q_WB_0=q, joints=joints, q_J_0=np.array([0.4, -0.7, 0.0]))
    force, p_GQ = np.array([0.3, -0.2, 0.5]), np.array([0.02, -0.03, 0.05])
    R_WG = matrix(FreeFlyer(p).outputs(0.0, Inputs()).q_WG)
    wrench_there = Inputs(f_G=force, tau_G=np.cross(R_WG @ p_GQ, force))
    by_hand = moved(p, Inputs(f_Q=force, p_GQ=p_GQ), 0.016)
    np.testing.assert_allclose(flat(by_hand), flat(moved(p, wrench_there, 0.016)), rtol=0.0, atol=1e-12)
    on_base = moved(p, Inputs(f_P=force, p_BP=np.array([0.0, 0.1, 0.0])), 0.16)
    assert np.all(on_base.v_J[:joints] != 0.0)  # the arm stays behind
    assert np.dot(on_base.v_WB, force) > 0.0
    at_base = replace(p, joints=0)  # a push there is a force and its moment, held in B, not in W, for a step
    by_base = Inputs(f_B=matrix(q).T @ force, tau_B=np.cross([0.0, 0.1, 0.0], matrix(q).T @ force))
    pushed = moved(at_base, Inputs(f_P=force, p_BP=np.array([0.0, 0.1, 0.0])), 0.016)
    np.testing.assert_allclose(flat(pushed), flat(moved(at_base, by_base, 0.016)), rtol=0.0, atol=1e-6)


def test_error_falls_with_the_fourth_power_of_the_step():
    rate = replace(TUMBLING, w_WB_0=np.array([3.0, -2.0, 4.0]))
    exact = flat(moved(replace(rate, substep=0.0005, turn=1.0), wrench(), 1.6))
    wide, narrow = (
        float(np.max(np.abs(flat(moved(replace(rate, substep=h, turn=1.0), wrench(), 1.6)) - exact)))
        for h in (0.016, 0.008)
    )
    assert 10.0 < wide / narrow < 25.0
    assert narrow < 1e-6


def test_steps_of_the_master_do_not_matter_where_substeps_are_the_same():
    u = wrench()
    p = replace(TUMBLING, substep=0.008, turn=1.0)
    np.testing.assert_allclose(flat(moved(p, u, 0.8, 0.016)), flat(moved(p, u, 0.8, 0.008)), atol=1e-14)


def test_agrees_with_mujoco_on_the_same_wrench():
    u, p = wrench(3), replace(TUMBLING, p_BG=np.array(skewed_arm(0).root), q_WB_0=np.array(Q_WB))
    start = p.p_WB_0, np.concatenate([p.v_WB_0, p.w_WB_0])
    _, path = mujoco_course((), start, (u.f_B, u.tau_B, u.f_G, u.tau_G), (), 125, 0.016)
    robot = FreeFlyer(p)
    for i, p_WG in enumerate(path):
        np.testing.assert_allclose(robot.step(0.016 * i, 0.016, u).p_WG, p_WG, rtol=0.0, atol=5e-5)
    assert np.linalg.norm(path[-1] - p.p_WB_0) > 0.5


def test_sign_of_the_quaternion_never_jumps():
    robot, u = FreeFlyer(replace(DEFAULT, w_WB_0=np.array([0.0, 3.0, 0.0]))), Inputs()
    before = robot.outputs(0.0, u).q_WB
    for i in range(400):
        q = robot.step(0.016 * i, 0.016, u).q_WB
        assert q @ before > 0.99
        before = q
    assert before[0] < 0.0 or np.any(before < -0.5)


def test_goes_on_bit_for_bit_after_a_state_is_restored_and_asking_for_outputs_changes_nothing():
    assert_continues(lambda: FreeFlyer(TUMBLING), lambda _: wrench(), [0, 20], 20)
    assert_outputs_change_nothing(lambda: FreeFlyer(Params()), wrench())


@pytest.mark.parametrize(
    "changes",
    [
        {"I_B": np.diag([0.1, 0.1, -0.1])},
        {"I_B": np.diag([0.1, 0.1, 0.3])},
        {"I_B": np.array([[0.15, 0.01, 0.0], [0.0, 0.15, 0.0], [0.0, 0.0, 0.15]])},
        {"q_WB_0": np.array([1.0, 0.0, 0.2, 0.0])},
        {"mass": np.inf},
        {"I_B": np.full((3, 3), np.nan)},
        {"mass": -1.0, "I_B": np.diag([np.inf, 1.0, 1.0]), "q_WB_0": np.zeros(4)},
    ],
    ids=["negative", "no body", "skew", "norm", "infinite", "nan", "all"],
)
def test_what_no_body_has_is_refused_all_at_once(changes: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidFlyerParameters) as refused:
        FreeFlyer(replace(Params(), **changes))
    assert len(refused.value.faults) == len(changes)
    wording.check(refused.value)


def test_a_turn_that_cannot_be_followed_is_an_error():
    with pytest.raises(TurnsTooFast):
        moved(replace(DEFAULT, w_WB_0=np.array([0.0, 0.0, 400.0]), substep=0.016), Inputs(), 1.6)
