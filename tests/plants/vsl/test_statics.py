"""The rest of the chain against straight beams, the elastica, its own potential energy, and a refined self."""

import math
from dataclasses import replace

import numpy as np
import pytest
from support.plants.beams import ONE_LINK, elastica, rest, tip
from support.wording import Wording

from handover.plants.vsl.chain import Pose, VslChain
from handover.plants.vsl.parameters import Link, Params
from handover.plants.vsl.statics import NoEquilibrium, VslStatics


def cantilever(params: Params, p: float, force: float) -> float:
    """Deflection P L^3 / (3 EI) + P L / GA."""
    L, EI = params.L_3, params.EI_0 + params.EI_p * p
    GA = params.shear_0 + p * math.pi * params.R_link**2
    return force * L**3 / (3.0 * EI) + force * L / GA


@pytest.mark.parametrize("p", [0.0, 1.5e5])
def test_a_link_with_a_small_load_bends_like_a_cantilever(p: float):
    wanted = cantilever(ONE_LINK, p, 1e-4 * 9.81)
    assert -tip(ONE_LINK, (0.0, 0.0), p, 1e-4, 200).imag == pytest.approx(wanted, rel=1e-4)
    alone = replace(ONE_LINK, links=1, link_2=Link.VSL)
    assert -tip(alone, (0.0,), p, 1e-4, 200).imag == pytest.approx(wanted, rel=1e-4)
    capped, force = replace(ONE_LINK, cap=0.05, shear_0=1e12), 1e-4 * 9.81  # rigid caps do not bend
    bent = force * ((0.225 - 0.05) ** 3 - 0.05**3) / (3.0 * (0.55 + 1.05e-5 * p))
    assert -tip(capped, (0.0, 0.0), p, 1e-4, 200).imag == pytest.approx(bent, rel=1e-4)


def test_the_error_of_the_hinges_falls_with_their_square():
    wanted = cantilever(ONE_LINK, 1e5, 1e-4 * 9.81)
    bending = wanted - 1e-4 * 9.81 * ONE_LINK.L_3 / (60.0 + 1e5 * math.pi * 0.022**2)
    for hinges in (2, 6, 12):
        off = -tip(ONE_LINK, (0.0, 0.0), 1e5, 1e-4, hinges).imag - wanted
        assert off / bending == pytest.approx(-1.0 / (4.0 * hinges**2), rel=1e-3)


def test_the_weight_of_a_link_bends_it_like_an_even_load():
    params = replace(ONE_LINK, link_mass=1e-3, shear_0=1e9)
    wanted = 1e-3 * 9.81 * 0.225**3 / (8.0 * 1.6)
    assert -tip(params, (0.0, 0.0), 1e5, 0.0, 200).imag == pytest.approx(wanted, rel=1e-4)


def test_joints_give_to_torque_and_only_droop_is_reported():
    params = replace(ONE_LINK, link_3=Link.RIGID, joint_stiffness=140.0, servo_stiffness=260.0)
    _, pose = rest(params, (0.0, 0.0), 0.0, 0.01)
    tau_2, tau_3 = 0.01 * 9.81 * 0.45, 0.01 * 9.81 * 0.225
    np.testing.assert_allclose(pose.torque, [tau_2, tau_3], rtol=1e-4)
    np.testing.assert_allclose(pose.droop, np.array(pose.torque) / 260.0, rtol=1e-12)
    assert pose.angles[0] == pytest.approx(-tau_2 * (1.0 / 140.0 + 1.0 / 260.0), rel=1e-4)


def energy(params: Params, chain: VslChain, pose: Pose, theta: tuple[float, ...], p: float, load: float) -> float:
    """Potential energy of springs and masses; a body's mass is at its middle."""
    hinge, shear = chain.springs((p,) * params.links)
    ends = chain.ends(pose)
    twist = np.diff(pose.angles, prepend=0.0)
    twist[chain.joints] -= theta
    compliance = np.array(hinge)
    compliance[chain.joints] += 1.0 / params.servo_stiffness
    flexible = np.array(shear) > 0.0
    springs = np.sum(twist**2 / compliance) + np.sum(pose.shears[flexible] ** 2 / np.array(shear)[flexible])
    own = params.link_mass * np.array(chain.lengths) / 0.225
    height = own @ ends.imag[:-1] / 2.0 + own @ ends.imag[1:] / 2.0
    height += (params.gripper_mass + load) * ends[-1].imag + sum(
        params.servo_mass * ends[elbow].imag for elbow in chain.joints[1:]
    )
    return float(springs / 2.0 + 9.81 * height)


@pytest.mark.parametrize(
    "params",
    [
        Params(link_2=Link.RIGID),
        Params(links=1),
        Params(links=3, link_4=Link.RIGID),
        Params(links=3, link_3=Link.RIGID, EI_factor=np.array([1.3, 1.0, 0.8]), joint_factor=np.array([0.5, 2.0])),
    ],
)
@pytest.mark.parametrize("theta", [(0.9, -1.4), (3.0, 0.5)])
def test_the_rest_has_the_least_potential_energy(params: Params, theta: tuple[float, ...]):
    theta = theta[: params.links]
    chain, pose = rest(params, theta, 0.7e5, 0.08)
    least = energy(params, chain, pose, theta, 0.7e5, 0.08)
    rng = np.random.default_rng(1)
    flexible = np.array(chain.shearing) > 0.0
    for _ in range(25):
        change, shift = 1e-3 * rng.standard_normal(len(chain)), 1e-4 * rng.standard_normal(len(chain)) * flexible
        sides: list[float] = []
        for s in (-1.0, 1.0):
            moved = pose._replace(angles=pose.angles + s * change, shears=pose.shears + s * shift)
            sides.append(energy(params, chain, moved, theta, 0.7e5, 0.08))
        assert min(sides) > least
        slope, curvature = (sides[1] - sides[0]) / 2.0, (sides[0] + sides[1]) / 2.0 - least
        assert abs(slope) < 1e-3 * curvature


@pytest.mark.parametrize(("hinges", "off"), [(2, 4e-4), (6, 5e-5)])
def test_few_hinges_agree_with_many(hinges: int, off: float):
    fine = tip(Params(), (0.9, -0.95), 0.5e5, 0.1, 60)
    assert off / 2.0 < abs(tip(Params(), (0.9, -0.95), 0.5e5, 0.1, hinges) - fine) < off


def test_finds_a_rest_in_the_whole_workspace_and_the_same_from_anywhere():
    params = Params()
    chain = VslChain(params, 6)
    near, far = (VslStatics(chain, 9.81, 1.0 / 260.0) for _ in range(2))
    near.settle((0.8, -1.6), (1e5, 1e5), 0.0)
    rng = np.random.default_rng(0)
    for _ in range(150):
        theta = (float(rng.uniform(-math.pi, math.pi)), float(rng.uniform(-math.pi, math.pi)))
        p, load = (float(rng.uniform(0.0, 3e5)), float(rng.uniform(0.0, 3e5))), float(rng.uniform(0.0, 0.1))
        near.advance(0.02, ((0.0, 0.0), theta), p, load, 0.0)
        far.settle(theta, p, load)
        np.testing.assert_allclose(near.pose.angles, far.pose.angles, atol=1e-10)


def test_an_arm_that_buckles_is_refused_and_one_that_hangs_or_lies_level_does_not(wording: Wording):
    weak, upright = Params(EI_0=0.1, EI_p=0.0), (math.pi / 2.0, 0.0)
    assert rest(weak, upright, 0.0, 0.0)[1].angles[-1] == pytest.approx(math.pi / 2.0)
    with pytest.raises(NoEquilibrium) as refused:
        rest(weak, upright, 0.0, 0.5)
    wording.check(refused.value)
    for theta in ((0.0, 0.0), (-math.pi / 2.0, 0.0), (-0.3, -0.4)):
        rest(weak, theta, 0.0, 0.5)


@pytest.mark.parametrize("lean", [0.0, 1e-3])
def test_what_buckles_an_upright_arm_buckles_one_that_leans_a_little(lean: float):
    params, theta = Params(EI_0=0.2, EI_p=0.0), (math.pi / 2.0 - lean, 0.0)
    chain = VslChain(params, 6)
    statics = VslStatics(chain, params.gravity, 1.0 / params.servo_stiffness)
    statics.settle(theta, (0.0, 0.0), 0.0)
    assert abs(statics.pose.angles[-1] - math.pi / 2.0) <= 4.0 * lean + 1e-12
    with pytest.raises(NoEquilibrium):
        statics.settle(theta, (0.0, 0.0), 0.5)
    with pytest.raises(NoEquilibrium):
        statics.advance(0.02, (theta, theta), (0.0, 0.0), 0.5, 0.0)


def test_buckles_at_eulers_load():
    low, high, params = 0.0, 100.0, replace(ONE_LINK, shear_0=1e9)
    for _ in range(24):
        middle = (low + high) / 2.0
        try:
            rest(params, (math.pi / 2.0, 0.0), 0.0, middle, 40)
            low = middle
        except NoEquilibrium:
            high = middle
    assert low * 9.81 == pytest.approx(math.pi**2 * 0.55 / (4.0 * 0.225**2), rel=1e-3)


@pytest.mark.parametrize("load", [0.1, 2.0])
def test_many_hinges_bend_far_as_the_elastica_and_six_almost(load: float):
    along, across = elastica(load * 9.81, ONE_LINK.EI_0, 0.225)
    params = replace(ONE_LINK, shear_0=1e12)
    fine, six, three = (abs(tip(params, (0.0, 0.0), 0.0, load, n) - (0.225 + along - 1j * across)) for n in (100, 6, 3))
    assert fine < 2e-4 * across
    assert six < 0.01 * across
    assert 2.5 * six < three < 5.0 * six
