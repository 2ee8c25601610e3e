"""Arms of one and three links, and arms whose links, gears and joints differ from the usual ones."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.plants.beams import ONE_LINK, tip
from support.restored_states import assert_continues

from handover.plants.vsl.arm import Inputs, Outputs, VslArm
from handover.plants.vsl.parameters import Link, Motion, Params

NOISES: dict[str, Any] = dict.fromkeys(
    ("servo_noise", "current_noise", "tracker_noise", "pressure_noise", "imu_noise"), 0.0
)
EXACT = Params(gear_friction=0.0, **NOISES)


def walk(params: Params, u: Inputs, steps: int) -> Outputs:
    """Where the arm is after some steps of 20 ms."""
    arm = VslArm(params)
    return [arm.step(0.02 * i, 0.02, u) for i in range(steps)][-1]


def test_a_third_link_continues_the_second_without_a_joint():
    """Two links of 0.225 m without caps, one screwed to the other, are one of 0.45 m, of as many hinges a metre."""
    three = replace(ONE_LINK, links=3, link_mass=0.14)
    two = replace(three, links=2, L_3=0.45, mass_factor=np.array([1.0, 2.0, 1.0]))
    for theta in ((0.3, -0.8), (1.2, 0.4)):
        for load in (0.0, 0.1):
            assert tip(three, theta, 1e5, load, 5) == pytest.approx(tip(two, theta, 1e5, load, 10), abs=1e-9)


@pytest.mark.parametrize("motion", list(Motion))
def test_a_third_link_has_a_pressure_of_its_own_unless_it_is_rigid(motion: Motion):
    def height(p_4: float, **changes: Any) -> float:
        q = np.array([0.0, 0.9, -0.9])
        params = replace(EXACT, motion=motion, links=3, p_4_0=p_4, q_0=q, **changes)
        y = walk(params, Inputs(q_cmd=q, p_cmd_4=p_4), 3)
        assert y.p_meas_4 == pytest.approx(p_4, rel=1e-3)
        return float(y.p_WG[2])

    assert height(0.5e5) < height(1e5) - 5e-4
    assert height(0.5e5, link_4=Link.RIGID) == height(1e5, link_4=Link.RIGID) > height(1e5)


@pytest.mark.parametrize("links", [1, 2, 3])
def test_stiff_links_obey_the_kinematics(links: int):
    rigid: dict[str, Any] = dict.fromkeys(("link_2", "link_3", "link_4"), Link.RIGID)
    rigid |= {"joint_stiffness": 1e11, "servo_stiffness": 1e11, "EI_rigid": 1e9}
    stiff = replace(EXACT, links=links, L_3=0.2, L_4=0.17, q_0=np.array([0.4, 0.7, -1.1]), **rigid)
    y = VslArm(stiff).outputs(0.0, Inputs(load=0.1))
    forearm = (0.0, 0.2, 0.37)[links - 1]
    r = 0.225 * math.cos(0.7) + forearm * math.cos(-0.4)
    z = 0.15 + 0.225 * math.sin(0.7) + forearm * math.sin(-0.4)
    np.testing.assert_allclose(y.p_WG, [r * math.cos(0.4), r * math.sin(0.4), z], atol=1e-7)
    np.testing.assert_allclose(y.shape[[0, 1, -1]], np.vstack([np.zeros(3), [0.0, 0.0, 0.15], y.p_WG]), atol=1e-15)
    spaces = np.linalg.norm(np.diff(y.shape[1:], axis=0), axis=1)
    wanted = np.full(23, 0.225 / 23) if links == 1 else np.repeat([0.225 / 12, forearm / 11], [12, 11])
    np.testing.assert_allclose(spaces, wanted, rtol=1e-6)


def test_an_arm_of_one_link_reads_nothing_of_the_joint_that_it_has_not():
    arm = VslArm(Params(links=1))
    y = arm.step(0.0, 0.02, Inputs(q_cmd=np.array([0.1, 0.8, -1.0])))
    assert [y.q_meas[2], y.i_meas[2], y.p_meas[1], y.tilt_meas[1], y.p_meas_4, y.tilt_meas_4] == [0.0] * 6
    assert np.all(np.abs([y.q_meas[0], y.i_meas[1], y.p_meas[0], y.tilt_meas[0]]) > 0.0)
    np.testing.assert_array_equal(y.shape[0], 0.0)


@pytest.mark.parametrize(("motion", "links"), [(Motion.DYNAMIC, 1), (Motion.DYNAMIC, 3), (Motion.QUASI_STATIC, 3)])
def test_continues_bit_for_bit_from_a_state(motion: Motion, links: int):
    u = Inputs(q_cmd=np.array([0.3, 0.5, -0.4]), p_cmd_4=2e5, load=0.05)
    assert_continues(lambda: VslArm(Params(motion=motion, links=links)), lambda _: u, [5], 5, 0.02)


def test_factors_scale_stiffness_mass_and_friction_of_one_link_or_joint():
    theta, whole = (0.9, -1.1), Params()
    pairs = (
        (replace(whole, EI_factor=np.full(3, 1.2)), replace(whole, EI_0=1.2 * 0.55, EI_p=1.2 * 1.05e-5)),
        (replace(whole, mass_factor=np.full(3, 1.5)), replace(whole, link_mass=1.5 * 0.14)),
        (replace(whole, joint_factor=np.full(2, 0.5)), replace(whole, joint_stiffness=70.0)),
    )
    for scaled, same in pairs:
        assert tip(scaled, theta, 1e5, 0.05) == pytest.approx(tip(same, theta, 1e5, 0.05), abs=1e-12)
        assert abs(tip(scaled, theta, 1e5, 0.05) - tip(whole, theta, 1e5, 0.05)) > 5e-4
    only_2, only_3 = (tip(replace(whole, EI_factor=np.array(f)), theta, 1e5, 0.0) for f in ([2, 1, 1], [1.0, 2, 1]))
    assert tip(whole, theta, 1e5, 0.0).imag < min(only_2.imag, only_3.imag)
    assert abs(only_2 - only_3) > 1e-4


def test_gears_have_friction_of_their_own():
    params = replace(EXACT, gravity=0.0, gear_friction=0.06, friction_factor=np.array([0.0, 1.0, 2.0]), kt=1.0)
    y = walk(params, Inputs(q_cmd=np.array([0.1, 1.0, -1.5])), 20)
    np.testing.assert_allclose(y.i_meas, [0.0, 0.06, 0.12], atol=1e-12)
