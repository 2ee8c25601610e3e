"""Accelerometers against closed forms, noise that others do not depend on, and what converters resolve."""

import math
from dataclasses import replace

import numpy as np
import pytest

from handover.plants.vsl.arm import Inputs, Outputs, VslArm
from handover.plants.vsl.parameters import Link, Motion, Params

EXACT = Params(servo_noise=0.0, current_noise=0.0, tracker_noise=0.0, pressure_noise=0.0, imu_noise=0.0)
PRINTED = replace(
    EXACT, link_2=Link.RIGID, link_3=Link.RIGID, EI_rigid=1e9, joint_stiffness=1e9, servo_stiffness=1e9, gear_friction=0
)
COUNT = 2.0 * math.pi / 4096.0


def walk(params: Params, u: Inputs, steps: int = 5) -> list[Outputs]:
    arm = VslArm(params)
    return [arm.step(0.02 * i, 0.02, u) for i in range(steps)]


@pytest.mark.parametrize("q", [(0.3, 0.7, -1.2), (0.0, 1.4, 0.9)])
def test_at_rest_an_accelerometer_tells_how_its_link_is_inclined(q: tuple[float, float, float]):
    y = VslArm(replace(PRINTED, q_0=np.array(q))).outputs(0.0, Inputs())
    np.testing.assert_allclose(y.tilt_meas, [q[1], q[1] + q[2]], atol=1e-6)


def test_it_is_at_the_end_of_a_link_that_bends_also_of_a_third():
    y = VslArm(replace(EXACT, shear_0=1e9, q_0=np.array([0.0, 0.9, -1.3]))).outputs(0.0, Inputs(load=0.1))
    along = y.shape[-1] - y.shape[-2]
    assert y.tilt_meas[1] == pytest.approx(math.atan2(along[2], along[0]), abs=1e-6)
    assert y.tilt_meas[1] < -0.45
    for motion in Motion:
        arm = VslArm(replace(EXACT, motion=motion, links=3, q_0=np.array([0.0, 0.6, -0.2])))
        y = arm.outputs(0.0, Inputs(load=0.05))
        assert y.tilt_meas[0] > y.tilt_meas[1] > y.tilt_meas_4 + 0.01


def test_an_arm_that_turns_flings_outwards_what_an_accelerometer_feels():
    """f = g upwards - w^2 r outwards, of a link that is level: tilt = atan2(-w^2 r, g)."""
    start, w = np.zeros(3), 2.0
    u = Inputs(q_cmd=np.array([3.0, 0.0, 0.0]), qd_cmd=np.array([w, 0.0, 0.0]))
    y = walk(replace(PRINTED, motion=Motion.DYNAMIC, q_0=start), u, 20)[-1]
    wanted = [math.atan2(-(w**2) * r, 9.81) for r in (0.225, 0.45)]
    np.testing.assert_allclose(y.tilt_meas, wanted, rtol=1e-3)
    still = walk(replace(PRINTED, q_0=start), u, 20)[-1]
    np.testing.assert_allclose(still.tilt_meas, 0.0, atol=1e-6)


def test_an_arm_that_swings_feels_its_own_acceleration():
    """The second difference of the tip's way, with gravity, in the frame of the last body."""
    params = replace(EXACT, motion=Motion.DYNAMIC, damping_time=0.0, substep=1e-4, shear_0=1e9, leak_time=1e9)
    arm, h = VslArm(params), 1e-3
    y = [arm.step(h * i, h, Inputs(q_cmd=params.q_0, load=0.2 if i else 0.0)) for i in range(80)]
    seen: list[tuple[float, float]] = []
    for before, now, after in zip(y[20:], y[21:], y[22:], strict=False):
        a = (after.p_WG - 2.0 * now.p_WG + before.p_WG) / h**2 + np.array([0.0, 0.0, 9.81])
        along = (now.shape[-1] - now.shape[-2]) / np.linalg.norm(now.shape[-1] - now.shape[-2])
        across = np.array([-along[2], 0.0, along[0]])
        seen.append((float(now.tilt_meas[1]), math.atan2(float(a @ along), float(a @ across))))
    tilts, wanted = np.transpose(seen)
    assert np.ptp(wanted) > 0.05
    np.testing.assert_allclose(tilts, wanted, atol=4e-3)


def test_its_noise_is_as_declared_and_changes_nothing_else():
    quiet, noisy = (walk(replace(Params(), imu_noise=n, leak_time=1e9, seed=2), Inputs(), 600) for n in (0.0, 0.1))
    tilts = np.array([y.tilt_meas for y in noisy])
    np.testing.assert_allclose(np.std(tilts, axis=0), 0.1 / 9.81, rtol=0.08)
    np.testing.assert_allclose(np.mean(tilts, axis=0), quiet[-1].tilt_meas, atol=1.4e-3)
    for name in ("q_meas", "i_meas", "p_meas", "p_WG_meas"):
        np.testing.assert_array_equal(getattr(quiet[-1], name), getattr(noisy[-1], name))
    assert np.std([y.tilt_meas[0] for y in noisy]) != np.std([y.tilt_meas[1] for y in noisy])


def test_a_stepper_motor_stands_at_whole_steps_and_counts_them():
    step = math.radians(1.8)
    y = walk(replace(Params(), base_step=step, seed=1), Inputs(q_cmd=np.array([0.1, 0.8, -1.6])), 60)
    assert y[-1].q_meas[0] == 3 * step
    assert math.atan2(y[-1].p_WG[1], y[-1].p_WG[0]) == pytest.approx(3 * step, abs=1e-12)
    assert {x.q_meas[0] for x in y} <= {k * step for k in range(4)}
    assert {x.i_meas[0] for x in y} == {0.0}


def test_encoders_show_and_take_whole_counts():
    params = replace(EXACT, encoder_step=COUNT, servo_stiffness=1e9)
    y = walk(params, Inputs(q_cmd=np.array([0.0, 0.9, -1.5]), qd_cmd=np.full(3, 0.2)), 60)
    counts = np.array([x.q_meas for x in y]) / COUNT
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-9)
    assert len(np.unique(counts[:, 1])) > 5
    assert y[-1].q_meas[1] == round(0.9 / COUNT) * COUNT


def test_pressures_are_commanded_and_read_quantized():
    params = replace(EXACT, transducer_step=50.0, regulator_step=1e4, leak_time=1e9, valve_tolerance=1.0)
    y = walk(params, Inputs(p_cmd=np.array([1.26e5, 1.74e5])), 250)
    np.testing.assert_allclose(np.array([x.p_meas for x in y]) % 50.0, 0.0, atol=1e-9)
    np.testing.assert_allclose(y[-1].p_meas, [1.3e5, 1.7e5], atol=50.0)
