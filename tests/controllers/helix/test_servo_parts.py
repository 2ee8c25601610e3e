"""Parts of the visual servo by themselves: averaged commands, response, damped steps, reach."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import NonlinearConstraint, minimize

from handover.controllers.helix.servo.arm_motion import FirstOrderLag, Response, Shaper
from handover.controllers.helix.servo.arm_paths import Recovery
from handover.controllers.helix.servo.constant_curvature import forward_kinematics, linearise
from handover.controllers.helix.servo.jacobian_control import Damping, Limits, damped_step, nearest_distance
from handover.controllers.helix.servo.servo_parameters import Params
from handover.cosim.blocks.ports import Floats

P = Params()
LIMITS = Limits(P.L_sys_LB, P.L_sys_UB)
Q_CALIB = np.array([0, 0, 0.12, 0, 0, 0.24, 0, 0, 0.24])


def test_a_step_of_the_command_becomes_a_ramp_as_long_as_the_average():
    shaper, q = Shaper(1.0, np.zeros(9)), np.ones(9)
    given: list[float] = []
    for n in range(16):
        shaper.advance(0.1 * n, q)
        given.append(float(shaper.q[0]))
    np.testing.assert_allclose(given, [min(0.1 * n, 1.0) for n in range(16)], atol=1e-12)


@pytest.mark.parametrize(("duration", "least", "most"), [(1.0, 0.0, 0.02), (0.0, 0.9, 1.1)])
def test_an_averaged_command_excites_no_swing_of_that_period(duration: float, least: float, most: float):
    """x'' = w^2 (u - x) with a period of 1 s, and a step of u: without the average it swings by as much as the step."""
    shaper, w, x, v, dt, swing = Shaper(duration, np.zeros(9)), 2 * np.pi, 0.0, 0.0, 0.002, 0.0
    for n in range(1500):
        shaper.advance(n * dt, np.ones(9))
        v += dt * w**2 * (float(shaper.q[0]) - x)
        x += dt * v
        swing = max(swing, abs(x - 1.0) if n * dt > 1.5 else 0.0)
    assert least <= swing < most


def test_a_lag_lets_all_arrive_whatever_the_steps():
    lag, arrived = FirstOrderLag(2, 0.3), np.zeros(2)
    lag.add(np.array([1.0, -2.0]))
    for dt in (0.1, 0.05, 0.25, 0.2):
        arrived += lag.advance(dt)
    np.testing.assert_allclose(arrived, (1 - np.exp(-2.0)) * np.array([1.0, -2.0]), rtol=1e-12)
    np.testing.assert_allclose(arrived + lag.advance(np.inf), [1.0, -2.0], rtol=1e-12)
    assert not lag.pending.any()


@pytest.mark.parametrize("part", [1.0, 0.5, 0.3])
def test_the_part_of_the_motion_that_is_made_is_found(part: float):
    response, p, arm = Response(1.5, 0.3, 0.1), np.zeros(3), FirstOrderLag(3, 0.3)
    for n in range(30):
        motion = np.array([0.004, -0.002, 0.001])
        arm.add(part * motion)
        response.command(motion)
        p = p + arm.advance(0.5)
        if n % 4 < 3:  # else the ring is hidden
            response.observe(p, 0.5 * n)
    assert response.part == pytest.approx(part, abs=0.03)


def test_commands_are_gone_back_and_then_the_arm_hangs_and_sways():
    recovery = Recovery(Q_CALIB)
    commands = [Q_CALIB + 0.01 * n for n in range(6)]
    for q in commands:
        recovery.keep(q)
    back = [recovery.next(commands[-1]) for _ in range(3)]
    assert [q.tolist() for q in back] == [commands[n].tolist() for n in (4, 2, 0)]
    q, seen = back[-1], list[Floats]()
    for _ in range(40):
        q = recovery.next(q)
        seen.append(q)
    np.testing.assert_allclose(seen[3], Q_CALIB, atol=0.02)
    for axis in (6, 7):
        assert max(q[axis] for q in seen) > 0.2
        assert min(q[axis] for q in seen) < -0.2


def test_the_damped_step_is_the_minimum():
    rng = np.random.default_rng(1)
    for _ in range(20):
        q = Q_CALIB + rng.normal(0, 0.2, 9) * np.tile([1, 1, 0.1], 3)
        _, J = linearise(q, 0.1)
        e, dq_0 = rng.normal(0, 0.05, 6), rng.normal(0, 0.01, 9)
        K, damping = P.K_initialize, Damping(0.02, 0.1)
        J_z, z = np.concatenate([J[3:], J[3:] - J[:3]]), np.concatenate([e[3:], e[3:] - e[:3]])
        D = np.repeat([1.0, damping.tilt_weight], 3)
        A = np.concatenate([D[:, None] * J_z, damping.length * np.diag(np.sqrt(K))])
        b = np.concatenate([D * z, damping.length * np.sqrt(K) * dq_0])
        expected = np.linalg.lstsq(A, b, rcond=None)[0]
        np.testing.assert_allclose(damped_step(J, 1 / K, e, damping, dq_0), expected, atol=1e-9)


@pytest.mark.parametrize("p_BG", [(0.2, 0.0, 0.6), (-0.5, 0.1, 0.3), (0.0, 0.0, 0.2)])
def test_the_models_reach_is_that_of_a_general_optimiser(p_BG: tuple[float, float, float]):
    p = np.array(p_BG)
    starts = [Q_CALIB + np.tile([part * p[0], part * p[1], dl], 3) for part, dl in ((0.3, 0.0), (0.8, -0.02))]
    found = min(nearest_distance(p, q, P.K_initialize, LIMITS, 0.1) for q in starts)

    def distance(q: Floats) -> float:
        return float(np.linalg.norm(forward_kinematics(q, 0.1)[3:] - p))

    bounds = [b for k in range(3) for b in [(-2, 2), (-2, 2), (LIMITS.LB[2 * k + 1], LIMITS.UB[2 * k + 1])]]
    within = NonlinearConstraint(lambda q: LIMITS.UB[::2] ** 2 - q[0::3] ** 2 - q[1::3] ** 2, 0.0, np.inf)
    given: dict[str, Any] = {"method": "SLSQP", "bounds": bounds, "constraints": within, "options": {"maxiter": 500}}
    assert found < min(float(minimize(distance, q, **given).fun) for q in starts) + 0.005
