"""The law against its closed form, and a rigid body in the loop against python-control's linear prediction."""

import math
from dataclasses import replace
from typing import Any

import control as untyped_control
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.controllers.pushed_body import INERTIA, MASS, T, cross_matrix, pushed, rotation_vector
from support.restored_states import assert_outputs_change_nothing
from support.wording import Wording

from handover.controllers.free_flyer.body import InvalidControllerParameters
from handover.controllers.free_flyer.impedance_controller import ImpedanceController, Inputs, Params
from handover.controllers.free_flyer.ports import Behaviour, InvalidOrientation, unit_quaternion
from handover.cosim.blocks.geometry import rotation_of
from handover.cosim.blocks.ports import Floats

control: Any = untyped_control
NO_LAG = Params(lag=0.0)
GAINS = {
    Behaviour.RIGID: (7.0 * MASS, 15.0, 70.0 * INERTIA, 5.0),
    Behaviour.COMPLIANT: (0.7 * MASS, 5.0, 7.0 * INERTIA, 1.0),
}


def law(p: Params, u: Inputs) -> tuple[Floats, Floats]:
    """Eq. (3.25) for gains that are multiples of unity in translation, with matrices."""
    k, b, k_R, b_R = GAINS[p.behaviour]
    R, R_D = rotation_of(u.q_WB_meas), rotation_of(u.q_WG_goal)
    r = R @ p.p_BG
    lever = cross_matrix(r)
    f_W = k * (u.p_WG_goal - u.p_WB_meas - r) - b * (u.v_WB_meas - lever @ u.w_WB_meas)
    tau_W = R_D @ (-k_R @ rotation_vector(np.transpose(R_D) @ R) - b_R * np.transpose(R_D) @ u.w_WB_meas)
    J_T = np.block([[np.eye(3), np.zeros((3, 3))], [lever, np.eye(3)]])
    wrench = J_T @ np.concatenate([f_W, tau_W])
    return np.transpose(R) @ wrench[:3], np.transpose(R) @ wrench[3:]


def anywhere(seed: int) -> Inputs:
    rng = np.random.default_rng(seed)
    q, q_goal = Rotation.random(2, rng=rng).as_quat(scalar_first=True)
    p, v, w, goal = rng.normal(size=(4, 3))
    return Inputs(p_WB_meas=p, q_WB_meas=q, v_WB_meas=v, w_WB_meas=w, p_WG_goal=goal, q_WG_goal=q_goal, active=True)


@pytest.mark.parametrize("behaviour", [Behaviour.RIGID, Behaviour.COMPLIANT])
def test_command_is_eq_3_25(behaviour: Behaviour):
    p, u = Params(behaviour=behaviour, p_BG=np.array([-0.25, 0.06, -0.1])), anywhere(0)
    f, tau = law(p, u)
    for q in (u.q_WB_meas, -u.q_WB_meas):
        y = ImpedanceController(p).step(0.0, T, replace(u, q_WB_meas=q))
        np.testing.assert_allclose(y.f_cmd, f, atol=1e-9)
        np.testing.assert_allclose(y.tau_cmd, tau, atol=1e-9)
    p_WG = u.p_WB_meas + rotation_of(u.q_WB_meas) @ p.p_BG
    turned = Rotation.from_matrix(rotation_of(u.q_WB_meas).T @ rotation_of(u.q_WG_goal)).magnitude()
    off = ImpedanceController(p).step(0.0, T, replace(u, active=False))
    assert not np.any([off.f_cmd, off.tau_cmd])
    for at in (y, off):
        assert (at.error_p, at.error_R) == pytest.approx((np.linalg.norm(u.p_WG_goal - p_WG), turned))
    assert_outputs_change_nothing(lambda: ImpedanceController(p), u, same=True)


def test_turning_world_goal_and_robot_together_changes_nothing():
    """Also with gains that differ by axis: they are in the goal's axes, so the stability found holds for any goal."""
    custom = Params(
        behaviour=Behaviour.CUSTOM,
        stiffness_translation=np.diag([20.0, 40.0, 60.0]),
        damping_translation=np.diag([10.0, 15.0, 20.0]),
    )
    controller, u, turn = ImpedanceController(custom), anywhere(6), Rotation.from_rotvec([0.4, -1.0, 2.0])
    q, q_goal = (
        (turn * Rotation.from_quat(x, scalar_first=True)).as_quat(scalar_first=True) for x in (u.q_WB_meas, u.q_WG_goal)
    )
    p, v, w, goal = (turn.apply(x) for x in (u.p_WB_meas, u.v_WB_meas, u.w_WB_meas, u.p_WG_goal))
    turned = Inputs(p_WB_meas=p, q_WB_meas=q, v_WB_meas=v, w_WB_meas=w, p_WG_goal=goal, q_WG_goal=q_goal, active=True)
    a, b = controller.step(0.0, T, u), controller.step(0.0, T, turned)
    np.testing.assert_allclose(a.f_cmd, b.f_cmd, atol=1e-9)
    np.testing.assert_allclose(a.tau_cmd, b.tau_cmd, atol=1e-9)


@pytest.mark.parametrize("behaviour", [Behaviour.RIGID, Behaviour.COMPLIANT])
@pytest.mark.parametrize(("axis", "delay"), [*((axis, 0) for axis in range(6)), (2, 1)])
def test_small_pushes_move_the_gripper_as_linear_theory_says(behaviour: Behaviour, axis: int, delay: int):
    controller = ImpedanceController(replace(NO_LAG, behaviour=behaviour, delay=delay * T))
    wrench = np.zeros((round(3.0 / T), 6))
    wrench[: round(0.5 / T), axis] = 0.05 if axis < 3 else 0.01
    real, predicted = pushed(controller, wrench, delay), controller.loop.response(wrench)[:, :6]
    assert np.max(np.abs(real - predicted)) < 0.01 * np.max(np.abs(predicted[:, axis]))


@pytest.mark.parametrize("behaviour", [Behaviour.RIGID, Behaviour.COMPLIANT])
def test_step_along_the_arm_is_that_of_mass_spring_and_damper(behaviour: Behaviour):
    """Along x nothing turns, so 1 / (m s^2 + k_B s + k_D) is the whole loop but for its sampling."""
    k, b, _, _ = GAINS[behaviour]
    wrench = np.tile([0.05, 0.0, 0.0, 0.0, 0.0, 0.0], (round(8.0 / T), 1))
    real = pushed(ImpedanceController(replace(NO_LAG, behaviour=behaviour)), wrench)[:, 0]
    wanted = 0.05 * control.step_response(control.tf([1.0], [MASS, b, k]), T * np.arange(len(wrench))).outputs
    assert np.max(np.abs(real - wanted)) < 0.03 * np.max(wanted)


def test_published_behaviours_have_their_damping():
    rigid, compliant = (
        ImpedanceController(replace(NO_LAG, behaviour=b)).outputs(0.0, Inputs())
        for b in (Behaviour.RIGID, Behaviour.COMPLIANT)
    )
    assert rigid.pole_radius < 1.0
    assert rigid.damping_ratio == pytest.approx(15.0 / (2.0 * math.sqrt(7.0) * MASS), rel=0.05)
    assert rigid.pole_frequency == pytest.approx(math.sqrt(7.0), rel=0.02)
    assert compliant.damping_ratio == pytest.approx(5.0 / (2.0 * math.sqrt(0.7) * MASS), rel=0.25)  # the lever couples
    assert compliant.damping_ratio == pytest.approx(0.3, abs=0.05)


def test_refused_delay_does_swing_up_and_the_allowed_one_calms_down():
    """The nonlinear body agrees with the verdict."""
    controller = ImpedanceController(NO_LAG)  # the law is the same for any delay
    push = np.zeros((round(3.0 / T), 6))
    push[:6, 2] = 0.001
    bad, good = (pushed(controller, push, delay=d) for d in (2, 1))
    assert np.max(np.abs(bad[-20:, 4])) > 10.0 * np.max(np.abs(good[:, 4]))
    assert np.max(np.abs(good[-20:])) < 0.3 * np.max(np.abs(good))


def test_cure_named_for_the_gains_is_stable():
    with pytest.raises(InvalidControllerParameters) as caught:
        ImpedanceController(Params(delay=0.032))
    factor = float(str(caught.value).split("at most about ")[2].split(" times")[0])
    k, b, k_R, b_R = (factor * gain * np.eye(3) for gain in GAINS[Behaviour.RIGID])
    stiffness = {"stiffness_translation": k, "stiffness_rotation": k_R}
    damping = {"damping_translation": b, "damping_rotation": b_R}
    ImpedanceController(Params(delay=0.032, behaviour=Behaviour.CUSTOM, **stiffness, **damping))


SKEW = np.array([[20.0, 5.0, 0.0], [0.0, 20.0, 0.0], [0.0, 0.0, 20.0]])
UNUSABLE: list[tuple[dict[str, Any], int]] = [
    ({"stiffness_translation": SKEW, "damping_rotation": np.diag([1.0, 1.0, 0.0]), "I_B": np.diag([0.1, 0.1, 0.3])}, 3),
    ({"mass": np.inf, "I_B": -np.eye(3)}, 2),
    ({"delay": -0.01, "lag": np.nan}, 2),
    ({"delay": 0.032, "lag": 0.0}, 1),
]


def test_what_cannot_be_is_refused_all_at_once(wording: Wording):
    for changes, faults in UNUSABLE:
        behaviour = Behaviour.CUSTOM if "damping_rotation" in changes else Behaviour.RIGID
        with pytest.raises(InvalidControllerParameters) as refused:
            ImpedanceController(Params(**changes, behaviour=behaviour))
        assert len(refused.value.faults) == faults
        wording.check(refused.value)
    ImpedanceController(replace(NO_LAG, delay=0.026))
    with pytest.raises(InvalidControllerParameters):
        ImpedanceController(replace(NO_LAG, delay=0.027))
    ImpedanceController(replace(NO_LAG, delay=0.032, behaviour=Behaviour.COMPLIANT))


@pytest.mark.parametrize("q", [np.zeros(4), np.array([np.nan, 0.0, 0.0, 1.0])])
def test_orientation_that_is_none_is_refused(q: Floats):
    with pytest.raises(InvalidOrientation, match="q_WB_meas"):
        ImpedanceController(Params()).step(0.0, T, Inputs(q_WB_meas=q))
    assert unit_quaternion(np.array([0.0, 0.0, -2.0, 0.0]), "block", "q") == (0.0, 0.0, -1.0, 0.0)
