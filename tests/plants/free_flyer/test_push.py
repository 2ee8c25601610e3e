import numpy as np
import pytest

from handover.plants.free_flyer.robot.push import Axis, Inputs, Params, Push

PULSE = Params(axis=Axis.Z, force=5.0, torque=-3.0, start=0.105, duration=0.05)


@pytest.mark.parametrize("dt", [0.001, 0.016, 0.03, 0.2])
def test_impulse_is_exact_wherever_the_edges_lie(dt: float):
    push = Push(PULSE)
    ys = [push.step(i * dt, dt, Inputs()) for i in range(round(0.4 / dt) + 1)]
    np.testing.assert_allclose(dt * np.sum([y.f_G for y in ys], axis=0), [0.0, 0.0, 0.25], rtol=1e-12)
    np.testing.assert_allclose(dt * np.sum([y.tau_G for y in ys], axis=0), [0.0, 0.0, -0.15], rtol=1e-12)


def test_is_the_share_of_the_step_that_it_covers():
    push = Push(PULSE)
    shares = [push.step(0.016 * i, 0.016, Inputs()).f_G[2] / 5.0 for i in range(11)]
    np.testing.assert_allclose(shares, [0, 0, 0, 0, 0, 0, 7 / 16, 1, 1, 11 / 16, 0], atol=1e-12)


@pytest.mark.parametrize("axis", Axis)
def test_acts_along_its_axis_alone_and_not_yet_at_the_start(axis: Axis):
    push = Push(Params(axis=axis, force=2.0, torque=1.0, start=0.0))
    np.testing.assert_array_equal(push.outputs(0.0, Inputs()).f_G, np.zeros(3))
    y = push.step(0.0, 0.016, Inputs())
    np.testing.assert_array_equal(y.f_G, 2.0 * np.eye(3)[axis])
    np.testing.assert_array_equal(y.tau_G, np.eye(3)[axis])
