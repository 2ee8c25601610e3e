from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_continues
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.free_flyer.robot.thrusters import (
    Inputs,
    InvalidThrusterParameters,
    Outputs,
    Params,
    Propulsion,
    Thrusters,
)

DT = 0.016


def command(x: float, y: float = 0.0, z: float = 0.0, torque: Floats | None = None) -> Inputs:
    return Inputs(f_pose=np.array([x, y, z]), tau_pose=np.zeros(3) if torque is None else torque)


def walk(thrusters: Thrusters, u: Inputs, steps: int, dt: float = DT) -> list[Outputs]:
    return [thrusters.step(i * dt, dt, u) for i in range(steps)]


@pytest.mark.parametrize("dt", [0.004, 0.016, 0.05])
def test_follows_with_the_lag_in_closed_form(dt: float):
    T, t = 0.05, dt * np.arange(1, 40)
    means = [y.f_B[0] for y in walk(Thrusters(Params(lag=T)), command(0.3), 39, dt)]
    area = 0.3 * (t - T * (1.0 - np.exp(-t / T)))  # integral of 0.3 (1 - e^(-t/T))
    np.testing.assert_allclose(means, np.diff(area, prepend=0.0) / dt, rtol=1e-12)


def test_each_axis_of_the_sum_of_both_commands_is_cut_at_its_own_limit_and_says_so():
    u = Inputs(
        f_pose=np.array([0.3, -2.0, 0.1]),
        f_impedance=np.array([0.3, 0.0, 0.1]),
        tau_pose=np.array([-1.0, 0.01, 1.0]),
        tau_impedance=np.array([0.0, 0.02, 0.0]),
    )
    y = walk(Thrusters(Params()), u, 100)[-1]
    np.testing.assert_allclose(y.f_B, [0.55, -0.39, 0.2], rtol=1e-12)
    np.testing.assert_allclose(y.tau_B, [-0.064, 0.03, 0.075], rtol=1e-12)
    assert y.saturated
    assert not Thrusters(Params()).step(0.0, DT, command(0.55, -0.39, 0.45)).saturated


def test_ideal_thrusters_give_what_is_commanded_at_once_and_keep_no_inputs():
    u, thrusters = command(7.0, torque=np.array([3.0, 0.0, 0.0])), Thrusters(Params(propulsion=Propulsion.IDEAL))
    for y in (thrusters.outputs(0.0, u), thrusters.step(0.0, DT, u)):
        np.testing.assert_array_equal([y.f_B, y.tau_B], [[7.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
        assert not y.saturated
    late = Thrusters(Params(propulsion=Propulsion.IDEAL, delay=DT))
    late.step(0.0, DT, u)
    u.f_pose[:] = 9.0
    np.testing.assert_array_equal(late.step(DT, DT, u).f_B, [7.0, 0.0, 0.0])


@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_a_delay_moves_the_answer_and_is_shared_where_it_lies_between_steps(lag: float):
    prompt = [y.f_B[0] for y in walk(Thrusters(Params(lag=lag)), command(0.2), 30)]
    late = [y.f_B[0] for y in walk(Thrusters(Params(lag=lag, delay=2 * DT)), command(0.2), 32)]
    np.testing.assert_array_equal(late[:2], [0.0, 0.0])
    np.testing.assert_allclose(late[2:], prompt, rtol=1e-12)
    between = [y.f_B[0] for y in walk(Thrusters(Params(lag=0.0, delay=1.25 * DT)), command(0.4), 4)]
    np.testing.assert_allclose(between, [0.0, 0.3, 0.4, 0.4], rtol=1e-12)


@pytest.mark.parametrize("changes", [{"delay": 0.025}, {"delay": 0.1, "lag": 0.3}, {"propulsion": Propulsion.IDEAL}])
def test_the_whole_impulse_arrives(changes: dict[str, Any]):
    u, unit = command(0.3, -0.2, 0.1, np.array([0.02, -0.01, 0.03])), Thrusters(Params(**changes))
    ys = walk(unit, u, 12) + walk(unit, Inputs(), 400)
    total = DT * np.sum([[*y.f_B, *y.tau_B] for y in ys], axis=0)
    np.testing.assert_allclose(total, np.array([0.3, -0.2, 0.1, 0.02, -0.01, 0.03]) * 12 * DT, rtol=1e-6)


def test_goes_on_bit_for_bit_after_a_state_is_restored():
    there, back = command(0.3), command(-0.4, 0.1)
    assert_continues(lambda: Thrusters(Params(delay=0.025)), lambda n: there if n < 5 else back, [3, 5], 8)


@pytest.mark.parametrize("propulsion", [Propulsion.LIMITED, Propulsion.NOZZLES])
def test_limits_that_leave_no_thrust_along_an_axis_are_refused_together(propulsion: Propulsion, wording: Wording):
    nothing: dict[str, Any] = {"f_max": np.array([0.5, 0.0, 0.0]), "tau_max": np.array([0.0, 0.1, 0.1])}
    with pytest.raises(InvalidThrusterParameters) as refused:
        Thrusters(Params(propulsion=propulsion, **nothing))
    wording.check(refused.value)
    assert Thrusters(Params(propulsion=Propulsion.IDEAL, **nothing))
