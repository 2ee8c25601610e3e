"""Eq. (4.4) against motions whose answer is known in closed form."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.ports import Floats
from handover.scenarios.robots.free_flyer.parameters import Behaviour, Body
from handover.scenarios.robots.free_flyer.push.impedance_evaluation import Errors, Motion, errors_of

MASS, INERTIA, ARM = 9.584, np.array([0.1534, 0.1427, 0.1623]), np.array([-0.30, 0.0, 0.0])
GOAL = np.array([0.0, -0.07, 0.0])
BODY = Body(MASS, np.diag(INERTIA), ARM)
TIMES: Floats = np.arange(6, dtype=np.float64) * 0.016
NOTHING = np.zeros((6, 3))


def moving(p_WB: Floats, v_WB: Floats, phi: Floats, w_WB: Floats, f_G: Floats = NOTHING) -> Motion:
    """Return a motion of the base as one of the gripper."""
    R_WB = Rotation.from_rotvec(phi)
    r = R_WB.apply(ARM)
    q_WB = R_WB.as_quat(scalar_first=True)
    return Motion(TIMES, p_WB + r, v_WB + np.cross(w_WB, r), q_WB, w_WB, f_G, NOTHING)


HELD = np.tile(GOAL - ARM, (6, 1))


def test_at_rest_away_from_the_goal_the_spring_alone_calls_for_the_pushs_balance():
    push = np.tile([2.0, 0.0, 0.0], (6, 1))
    errors = errors_of(moving(HELD, NOTHING, NOTHING, NOTHING, push), GOAL, Behaviour.RIGID, BODY)
    assert errors.p == pytest.approx(np.zeros((5, 3)), abs=1e-12)
    assert errors.p_model == pytest.approx(np.tile([-2.0 / (7.0 * MASS), 0.0, 0.0], (5, 1)))


def test_steady_translation_is_braked_by_the_damper():
    v = np.array([0.0, 0.1, 0.0])
    way = TIMES[:, np.newaxis] * v
    errors = errors_of(moving(HELD + way, np.tile(v, (6, 1)), NOTHING, NOTHING), GOAL, Behaviour.COMPLIANT, BODY)
    assert errors.p_model == pytest.approx(np.tile([0.0, 5.0 * 0.1 / (0.7 * MASS), 0.0], (5, 1)))
    assert errors.p == pytest.approx(-way[:5], abs=1e-12)


def test_acceleration_of_the_base_turns_the_gripper_by_its_lever():
    a = np.array([0.0, 0.0, 0.5])
    v = TIMES[:, np.newaxis] * a
    errors = errors_of(moving(HELD, v, NOTHING, NOTHING), GOAL, Behaviour.RIGID, BODY)
    torque = -np.cross(ARM, MASS * a)
    assert errors.R_model == pytest.approx(np.tile(torque / (70.0 * INERTIA), (5, 1)))


def test_a_spin_about_a_principal_axis_needs_no_torque_but_the_force_that_leads_the_centre_of_mass():
    w = np.array([0.0, 0.0, 0.4])
    phi = TIMES[:, np.newaxis] * w
    errors = errors_of(moving(HELD, NOTHING, phi, np.tile(w, (6, 1))), GOAL, Behaviour.RIGID, BODY)
    assert np.allclose(errors.R, -phi[:5])
    assert errors.R_model == pytest.approx(np.tile([0.0, 0.0, 5.0 * 0.4 / (70.0 * INERTIA[2])], (5, 1)))


def test_disagreement_is_the_greatest_along_any_axis():
    held = HELD + np.array([0.03, 0.0, -0.04])
    errors = errors_of(moving(held, NOTHING, NOTHING, NOTHING), GOAL, Behaviour.RIGID, BODY)
    assert errors.disagreement == pytest.approx((0.04, 0.0), abs=1e-12)


def test_thrust_that_turns_with_the_robot_is_reported_as_at_the_beginning_of_the_step():
    w, f_B = np.array([0.0, 0.0, 3.0]), np.array([2.0, 0.0, 0.0])
    phi = TIMES[:, np.newaxis] * w
    angle = phi[:, 2]  # integral of the thrust's direction, held for a step and turned with it
    v = 2.0 / MASS / 3.0 * np.column_stack([np.sin(angle), 1.0 - np.cos(angle), np.zeros(6)])
    errors = errors_of(moving(np.tile(GOAL - ARM, (6, 1)), v, phi, np.tile(w, (6, 1))), GOAL, Behaviour.COMPLIANT, BODY)
    R_WB = Rotation.from_rotvec(phi[:5])
    v_WG = v[:5] + np.cross(w, R_WB.apply(ARM))
    assert errors.p_model == pytest.approx((R_WB.apply(f_B) + 5.0 * v_WG) / (0.7 * MASS), rel=1e-3, abs=1e-5)


def turned(actual: list[float], model: list[float]) -> Errors:
    about_x = [np.column_stack([angles, np.zeros((len(angles), 2))]) for angles in (actual, model)]
    n = len(actual)
    return Errors(t=TIMES[:n], p=np.zeros((n, 3)), p_model=np.zeros((n, 3)), R=about_x[0], R_model=about_x[1])


def test_orientations_beyond_half_a_turn_are_compared_by_the_turn_between_them_and_leave_a_gap():
    _, apart = turned([3.1], [-3.1]).disagreement
    assert apart == pytest.approx(2.0 * np.pi - 6.2)
    R, R_model = turned([2.9, 3.1, -3.0, -2.8], [2.9, -3.18, -3.0, -2.8]).without_jumps
    assert R[:, 0] == pytest.approx([2.9, 3.1, np.nan, -2.8], nan_ok=True)
    assert R_model[:, 0] == pytest.approx([2.9, 2.0 * np.pi - 3.18, np.nan, -2.8], nan_ok=True)


@pytest.mark.parametrize("late", [0, 3])
def test_thrust_held_for_a_period_of_many_steps_is_compared_with_its_sample(late: int):
    steps, periods = 8, 40
    h = 0.016 / steps
    v, p = [0.0], [0.1]
    command, acting = 0.0, [0.0] * late
    for k in range(steps * periods):
        if k % steps == 0:
            command = -7.0 * MASS * p[-1] - 15.0 * v[-1]
        acting.append(command)
        a = acting.pop(0) / MASS
        p.append(p[-1] + h * v[-1] + h * h * a / 2.0)
        v.append(v[-1] + h * a)
    rows = len(p)
    along_arm = np.zeros((2, rows, 3))
    along_arm[:, :, 0] = p, v
    q_WB = np.tile([1.0, 0.0, 0.0, 0.0], (rows, 1))
    nothing = np.zeros((rows, 3))
    t: Floats = np.arange(rows, dtype=np.float64) * h
    motion = Motion(t, GOAL + along_arm[0], along_arm[1], q_WB, nothing, nothing, nothing)
    errors = errors_of(motion, GOAL, Behaviour.RIGID, BODY)
    assert errors.p == pytest.approx(-along_arm[0][: rows - steps : steps][: len(errors.t)])
    assert errors.p_model == pytest.approx(errors.p, abs=1e-12)
