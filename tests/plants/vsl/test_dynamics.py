"""Motion of the chain: conserved energy, refined self, measured frequencies, rest as by statics."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.vsl.chain import Pose, VslChain
from handover.plants.vsl.dynamics import NoConvergence, StartsInFace, VslDynamics
from handover.plants.vsl.parameters import Link, Motion, Params
from handover.plants.vsl.statics import VslStatics

OUTSTRETCHED = (0.47588225, -0.95176450)
"""Stiff arm at (0.4, 0, 0.15) m, elbow up."""
RAISED = (0.84106867, -1.68213734)
"""Stiff arm at (0.3, 0, 0.15) m, elbow up."""
P = (1e5, 1e5)
LOOSE = Params(motion=Motion.DYNAMIC)
UNDAMPED = replace(LOOSE, damping_time=0.0, high_frequency_damping=1.0, servo_stiffness=1e12, joint_stiffness=3.0)


def swinging(params: Params, theta: tuple[float, float] = RAISED, load: float = 0.0, hinges: int = 2) -> VslDynamics:
    dynamics = VslDynamics(VslChain(params, hinges), params)
    dynamics.settle(theta, P, load)
    return dynamics


def tip(chain: VslChain, mechanics: VslDynamics | VslStatics) -> complex:
    return complex(chain.ends(mechanics.pose)[-1])


def settled(params: Params, theta: tuple[float, float], p: tuple[float, float], load: float, hinges: int = 2) -> Any:
    """Return the chain's rest by statics."""
    statics = VslStatics(VslChain(params, hinges), 9.81, 1.0 / params.servo_stiffness)
    statics.settle(theta, p, load)
    return statics


def test_starts_at_rest_and_stays_there():
    dynamics = swinging(LOOSE, load=0.05)
    angles, torque, droop = np.array(dynamics.pose.angles), dynamics.pose.torque, dynamics.pose.droop
    for _ in range(50):
        dynamics.advance(0.02, (RAISED, RAISED), P, 0.05, 0.0)
    np.testing.assert_allclose(dynamics.pose.angles, angles, atol=1e-9)
    np.testing.assert_allclose(dynamics.pose.torque, torque, atol=1e-7)
    np.testing.assert_allclose(dynamics.pose.droop, droop, atol=1e-9)


@pytest.mark.parametrize("hinges", [2, 6])
def test_comes_to_the_rest_of_statics_with_as_many_hinges(hinges: int):
    dynamics = swinging(replace(LOOSE, damping_time=0.05), hinges=hinges)
    dynamics.advance(0.3, (RAISED, OUTSTRETCHED), P, 0.05, 0.0)
    for _ in range(100):
        dynamics.advance(0.02, (OUTSTRETCHED, OUTSTRETCHED), P, 0.05, 0.0)
    chain, statics = VslChain(LOOSE, hinges), settled(LOOSE, OUTSTRETCHED, P, 0.05, hinges)
    assert abs(tip(chain, dynamics) - tip(chain, statics)) < 1e-6
    np.testing.assert_allclose(dynamics.pose.shears, statics.pose.shears, atol=1e-6)
    np.testing.assert_allclose(dynamics.pose.droop, statics.pose.droop, atol=1e-6)


def energies(chain: VslChain, poses: tuple[Pose, Pose, Pose], h: float) -> tuple[float, float]:
    """Kinetic and potential energy at the second of three poses, h apart, by differences of the bodies."""
    before, now, after = poses
    own = UNDAMPED.link_mass * np.array(chain.lengths) / 0.225
    speed = (chain.ends(after) - chain.ends(before)) / (2.0 * h)
    turn = (after.angles - before.angles) / (2.0 * h)
    kinetic = own @ np.abs((speed[1:] + speed[:-1]) / 2.0) ** 2 + UNDAMPED.servo_mass * abs(speed[chain.joints[1]]) ** 2
    kinetic += UNDAMPED.gripper_mass * abs(speed[-1]) ** 2 + (own * np.square(chain.lengths) / 12.0) @ turn**2
    hinge, shear = chain.springs(P)
    twist = np.diff(now.angles, prepend=0.0)
    twist[[0, chain.joints[1]]] -= RAISED
    springs = np.sum(twist**2 / np.array(hinge)) + np.sum(now.shears**2 / np.array(shear))
    ends = chain.ends(now)
    height = own @ (ends[1:] + ends[:-1]).imag / 2.0 + UNDAMPED.servo_mass * ends[chain.joints[1]].imag
    return float(kinetic) / 2.0, float(springs) / 2.0 + 9.81 * float(height + UNDAMPED.gripper_mass * ends[-1].imag)


def test_without_damping_energy_is_conserved_while_the_arm_swings_far():
    h = 5e-4
    chain = VslChain(UNDAMPED, 2)
    dynamics = VslDynamics(chain, replace(UNDAMPED, substep=h))
    dynamics.settle(RAISED, P, 0.5)
    poses: list[Pose] = []
    for _ in range(600):
        dynamics.advance(h, (RAISED, RAISED), P, 0.0, 0.0)
        poses.append(dynamics.pose)
    found = np.array([energies(chain, (poses[i - 1], poses[i], poses[i + 1]), h) for i in range(10, 599, 9)])
    assert np.ptp([pose.angles[-1] for pose in poses]) > 0.8
    assert np.ptp(found[:, 0]) > 0.2
    assert np.ptp(found.sum(axis=1)) < 2e-5


def test_first_modes_are_where_they_were_measured():
    soft, hard = (
        [swinging(LOOSE, theta).frequencies((p, p), 0.0)[0] for theta in (OUTSTRETCHED, RAISED)] for p in (0.5e5, 2e5)
    )
    np.testing.assert_allclose(soft, [3.22, 3.87], atol=0.02)
    np.testing.assert_allclose(hard, [4.78, 5.76], atol=0.02)
    rigid = replace(LOOSE, link_2=Link.RIGID, link_3=Link.RIGID)
    assert swinging(rigid, OUTSTRETCHED).frequencies(P, 0.0)[0] == pytest.approx(10.6, abs=0.05)


def test_twelve_hinges_have_the_first_mode_of_a_cantilever():
    """Euler-Bernoulli: w = 1.8751^2 sqrt(EI / (m L^3)); the error of a chain of n hinges falls with n^2."""
    stiff = replace(LOOSE, links=1, cap=0.0, shear_0=1e9, gravity=0.0, joint_stiffness=1e8, gripper_mass=1e-9)
    wanted = 1.8751041**2 * math.sqrt(0.55 / (0.14 * 0.225**3)) / (2.0 * math.pi)
    found: list[float] = []
    for hinges in (6, 12):
        dynamics = VslDynamics(VslChain(stiff, hinges), stiff)
        dynamics.settle((0.0,), (0.0,), 0.0)
        found.append(float(dynamics.frequencies((0.0,), 0.0)[0]))
    coarse, fine = (abs(f / wanted - 1.0) for f in found)
    assert fine < 0.002
    assert 3.0 < coarse / fine < 5.0


def ringing(params: Params, h: float = 0.002) -> Floats:
    """Height of the tip, every h, after a small load has been taken off."""
    chain = VslChain(params, 2)
    dynamics = VslDynamics(chain, params)
    dynamics.settle(OUTSTRETCHED, P, 0.001)
    heights: list[float] = []
    for _ in range(700):
        dynamics.advance(h, (OUTSTRETCHED, OUTSTRETCHED), P, 0.0, 0.0)
        heights.append(tip(chain, dynamics).imag)
    return np.array(heights)


def test_rings_down_at_the_first_mode_with_the_damping_that_it_has():
    params = replace(LOOSE, servo_stiffness=1e12)
    f = float(swinging(params, OUTSTRETCHED).frequencies(P, 0.0)[0])
    z = ringing(params) - tip(VslChain(params, 2), settled(params, OUTSTRETCHED, P, 0.0)).imag
    peaks = [i for i in range(150, len(z) - 1) if z[i - 1] < z[i] >= z[i + 1]]
    assert np.diff(peaks).mean() * 0.002 == pytest.approx(1.0 / f, rel=0.01)
    ratio = math.log(z[peaks[0]] / z[peaks[2]]) / (4.0 * math.pi)
    assert ratio == pytest.approx(math.pi * f * params.damping_time, rel=0.1)


def test_the_internal_step_costs_little():
    def course(h: float) -> Floats:
        params = replace(LOOSE, substep=h)
        chain, dynamics = VslChain(params, 2), swinging(params)
        ways = np.linspace(RAISED, OUTSTRETCHED, 11).tolist() + 10 * [OUTSTRETCHED]
        points: list[complex] = []
        for first, last in pairwise(ways):
            dynamics.advance(0.02, (tuple(first), tuple(last)), P, 0.05, 0.0)
            points.append(tip(chain, dynamics))
        return np.abs(np.array(points))

    assert np.abs(course(0.01) - course(1e-3)).max() < 1.5e-3
    assert np.abs(course(0.005) - course(1e-3)).max() < 5e-4


def test_stable_at_long_steps_after_a_jump_of_command_and_load():
    dynamics, p, chain = swinging(LOOSE), (2e5, 0.5e5), VslChain(LOOSE, 2)
    for _ in range(400):
        dynamics.advance(0.02, (OUTSTRETCHED, OUTSTRETCHED), p, 0.5, 0.0)
    assert abs(tip(chain, dynamics) - tip(chain, settled(LOOSE, OUTSTRETCHED, p, 0.5))) < 3e-4


def test_a_turn_about_the_base_pulls_the_arm_outwards():
    params = replace(
        LOOSE, gravity=0.0, link_2=Link.RIGID, link_3=Link.RIGID, EI_rigid=1e9, joint_stiffness=1e6, damping_time=1e-3
    )
    straight, spin = (0.7, 0.0), 3.0
    dynamics = swinging(params, straight, hinges=12)
    for _ in range(100):
        dynamics.advance(0.02, (straight, straight), P, 0.0, spin)
    L, m = 0.45, params.link_mass
    second_moment = 2.0 * m * L**2 / 3.0 + params.servo_mass * (L / 2.0) ** 2 + params.gripper_mass * L**2
    wanted = spin**2 * math.sin(0.7) * math.cos(0.7) * second_moment
    assert dynamics.pose.torque[0] == pytest.approx(wanted, rel=5e-3)


@pytest.mark.parametrize("droop_time", [1e-3, 1.0])
def test_droop_follows_the_torque_in_its_time(droop_time: float):
    params = replace(LOOSE, droop_time=droop_time, link_2=Link.RIGID, link_3=Link.RIGID)
    dynamics = swinging(params)
    before = dynamics.pose.droop[0]
    for _ in range(50):
        dynamics.advance(0.02, (RAISED, RAISED), P, 0.1, 0.0)
    followed = (dynamics.pose.droop[0] - before) / (dynamics.pose.torque[0] / 260.0 - before)
    assert followed == pytest.approx(1.0 - math.exp(-1.0 / droop_time), abs=0.02)


def test_no_solution_is_said():
    dynamics = swinging(LOOSE)
    with pytest.raises(NoConvergence):
        dynamics.advance(0.02, (RAISED, (math.nan, 0.0)), P, 0.0, 0.0)


def test_a_face_carries_what_statics_with_so_much_less_load_does_not():
    load, damped, chain = 0.1, replace(LOOSE, damping_time=0.05), VslChain(LOOSE, 2)
    height = tip(chain, swinging(damped, load=load)).imag + damped.L_1 + 0.005
    stopped = swinging(replace(damped, face=height))
    for _ in range(120):
        stopped.advance(0.02, (RAISED, RAISED), P, load, 0.0)
    assert 0.1 < stopped.force < load * 9.81
    statics = settled(damped, RAISED, P, load - stopped.force / 9.81)
    assert tip(chain, statics).imag == pytest.approx(tip(chain, stopped).imag, abs=1e-6)
    depth = height - damped.L_1 - tip(chain, stopped).imag
    assert stopped.force == pytest.approx(damped.face_stiffness * depth, rel=1e-6)


def test_a_tip_that_comes_down_faster_strikes_harder_and_leaves_the_face_again():
    below = LOOSE.L_1 + tip(VslChain(LOOSE, 2), swinging(LOOSE)).imag - 0.03
    peaks: list[float] = []
    for steps in (50, 5):
        dynamics, forces = swinging(replace(LOOSE, face=below)), list[float]()
        down = np.linspace(RAISED, (RAISED[0] - 0.2, RAISED[1]), steps + 1)
        for first, last in (*pairwise(down), *50 * [(RAISED, RAISED)]):
            dynamics.advance(0.02, (tuple(first), tuple(last)), P, 0.0, 0.0)
            forces.append(dynamics.force)
        assert (forces[0], forces[-1]) == (0.0, 0.0)
        peaks.append(max(forces))
    assert peaks[1] > 1.2 * peaks[0] > 0.0


def test_an_arm_that_would_start_below_the_face_is_refused_with_both_heights(wording: Wording):
    height = LOOSE.L_1 + tip(VslChain(LOOSE, 2), swinging(LOOSE)).imag
    with pytest.raises(StartsInFace) as e:
        swinging(replace(LOOSE, face=0.3))
    assert e.value.height == pytest.approx(height)
    wording.check(e.value)
    assert swinging(replace(LOOSE, face=height - 1e-6)).force == 0.0
