"""The controller's own beam: against a cantilever's formula, its own inverse, and what was put in."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from handover.controllers.vsl.beam import HINGES, Beam, BentCommand, BentTip, Stiffness, Weights
from handover.controllers.vsl.fit import domain_of, fit_beam
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.cosim.blocks.ports import Floats

ARM = VslKinematics(0.15, 0.225, 0.225, Elbow.UP)
STIFF = Stiffness(1e9, 1e-5, 1e9)
SOFT = Stiffness(0.6, 1e-5, 120.0)


def inputs(n: int, seed: int = 0) -> Floats:
    """Return inputs of `BentTip`: angles, pressures, and currents of joints 2 and 3."""
    rng = np.random.default_rng(seed)
    low = [-0.5, 0.3, -1.6, 3e4, 3e4, 0.5, 0.05]
    return rng.uniform(low, [0.5, 0.9, -0.9, 2e5, 2e5, 0.9, 0.2], (n, 7))


def tips(beam: Beam, x: Floats) -> BentTip:
    domain = domain_of(x)
    return BentTip(domain.mean, domain.scale, domain.hull, beam)


def commands(beam: Beam, x: Floats, droop: float) -> BentCommand:
    domain = domain_of(x)
    return BentCommand(domain.mean, domain.scale, domain.hull, beam, droop)


def test_without_bending_the_tip_is_the_rigid_one():
    x = inputs(20)
    tip, torques = Beam(ARM, STIFF, Weights()).bent((x[:, 1], x[:, 2]), (x[:, 3], x[:, 4]), (x[:, 5], x[:, 6]))
    rigid = np.array([ARM.forward(np.array([0.0, *q])) for q in x[:, 1:3]])
    np.testing.assert_allclose(np.transpose(tip), rigid[:, [0, 2]] - [0.0, 0.15], atol=1e-8)
    assert np.all(torques[0] > torques[1])


def test_a_load_bends_a_level_beam_as_a_chain_of_springs():
    """Of little bending: each spring turns by compliance times lever of the load, and lowers the tip by that lever."""
    EI, load = 500.0, 0.1 * 9.81
    weightless = Weights(link=1e-12, elbow=1e-12, gripper=1e-12)
    current = (load * 0.45 / weightless.kt, load * 0.225 / weightless.kt)
    tip, torques = Beam(ARM, Stiffness(EI, 1e-12, 1e12), weightless).bent((0.0, 0.0), (1e5, 1e5), current)
    h = (0.225 - 2.0 * weightless.cap) / HINGES
    springs = [link * 0.225 + weightless.cap + (k + 0.5) * h for link in range(2) for k in range(HINGES)]
    sag = sum(h / EI * load * (0.45 - s) ** 2 for s in springs)
    assert -tip[1] == pytest.approx(sag, rel=1e-3)
    assert torques == pytest.approx((load * 0.45, load * 0.225), rel=1e-6)
    flexible = [(0.03, 0.195), (0.255, 0.42)]  # Euler-Bernoulli: the integral of F (L - s)^2 / EI over what bends
    cantilever = sum(load / EI * ((0.45 - a) ** 3 - (0.45 - b) ** 3) / 3.0 for a, b in flexible)
    assert sag == pytest.approx(cantilever, rel=0.01)


@given(st.integers(0, 10_000))
def test_the_commanded_angles_bring_the_bent_tip_where_it_is_wanted(seed: int):
    x = inputs(1, seed)[0]
    beam, (q_2, q_3, p_2, p_3, i_2, i_3) = Beam(ARM, SOFT, Weights()), x[1:].tolist()
    wanted = ARM.forward(np.array([0.0, q_2, q_3]))
    q, torques = beam.commanded((float(wanted[0]), float(wanted[2]) - 0.15), (q_2, q_3), (p_2, p_3), (i_2, i_3))
    tip, again = beam.bent(q, (p_2, p_3), (i_2, i_3))
    assert tip == pytest.approx((wanted[0], wanted[2] - 0.15), abs=2e-5)
    assert torques == pytest.approx(again, abs=1e-3)


def test_one_point_and_many_are_computed_alike_and_the_stiffnesses_are_found_again():
    x, beam = inputs(200), Beam(ARM, SOFT, Weights())
    for bent in (tips(beam, x), commands(beam, x, 1 / 260)):
        assert bent.predict(x).shape == (200, 3)
        np.testing.assert_allclose([bent.predict(row) for row in x[:30]], bent.predict(x)[:30], atol=1e-14)
    assert fit_beam(ARM, x, tips(beam, x).predict(x)).stiffness == pytest.approx(SOFT, rel=1e-6)


def test_droop_is_commanded_besides():
    x, beam = inputs(5), Beam(ARM, STIFF, Weights())
    torques = beam.bent((x[:, 1], x[:, 2]), (x[:, 3], x[:, 4]), (x[:, 5], x[:, 6]))[1]
    more = commands(beam, x, 0.004).predict(x) - commands(beam, x, 0.0).predict(x)
    np.testing.assert_allclose(more, np.transpose([np.zeros(5), *(0.004 * np.array(torques))]), atol=1e-9)


def test_an_upright_arm_does_not_bend_whatever_its_currents_say():
    tip, torques = Beam(ARM, SOFT, Weights()).bent((math.pi / 2.0, 0.0), (1e5, 1e5), (0.1, 0.1))
    assert tip == pytest.approx((0.0, 0.45), abs=1e-9)
    assert torques == pytest.approx((0.0, 0.0), abs=1e-9)
