import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.plants.partner_runs import AWAY, P_WO, STILL, beside, flat, inputs, take, taken, walk

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.tendon_arm_fast import TendonArmFast
from handover.plants.helix.arm.tendon_parameters import Params as ArmParams
from handover.plants.helix.arm.tendon_ports import Inputs as ArmInputs
from handover.plants.helix.hand.handover_partner import HandoverPartner
from handover.plants.helix.hand.partner_parameters import Holder, Inputs, InvalidPartnerParameters, Params


def test_starts_at_its_place_in_the_hand():
    y = HandoverPartner(Params(p_WO_0=np.array([0.1, 0.1, -0.6]))).outputs(0.0, Inputs())
    np.testing.assert_array_equal(y.p_WO, [0.1, 0.1, -0.6])
    np.testing.assert_allclose(y.p_WH, [0.1, 0.1, -0.64])
    np.testing.assert_array_equal(y.f_G, np.zeros(3))
    assert y.holder is Holder.HAND


@pytest.mark.parametrize(("dt", "steps"), [pytest.param(0.005, 8000, marks=pytest.mark.slow), (0.05, 3000)])
def test_tremor_and_drift_are_as_large_as_declared_whatever_the_step(dt: float, steps: int):
    def rms(**changes: Any) -> float:
        partner = HandoverPartner(replace(STILL, seed=4, **changes))
        path = np.array([y.p_WO for y in walk(partner, Inputs(), steps, dt)]) - [0.18, 0.0, -0.6]
        return float(np.sqrt(np.mean(np.sum(path[200:] ** 2, axis=1, dtype=np.float64))))

    assert rms(tremor_rms=0.001) == pytest.approx(0.001, rel=0.08)
    assert rms(drift_rms=0.003, drift_time=0.5) == pytest.approx(0.003, rel=0.15)


@pytest.mark.slow
def test_tremor_lies_in_its_band():
    partner = HandoverPartner(Params(drift_rms=0.0, tremor_frequency=8.0, tremor_bandwidth=2.0))
    x = np.array([y.p_WO[0] for y in walk(partner, Inputs(), 8192, 0.01)]) - 0.18
    power, f = np.abs(np.fft.rfft(x)) ** 2, np.fft.rfftfreq(len(x), 0.01)
    below = np.cumsum(power) / np.sum(power)
    assert f[np.searchsorted(below, 0.5)] == pytest.approx(8.0, abs=0.4)
    assert f[np.searchsorted(below, 0.15)] > 5.0
    assert f[np.searchsorted(below, 0.9)] < 10.5


@pytest.mark.slow
def test_correlation_over_a_time_is_the_same_in_one_step_or_many():
    def correlation(dt: float) -> float:
        partner = HandoverPartner(Params(drift_rms=0.0, seed=1))
        path = np.array([y.p_WO for y in walk(partner, Inputs(), round(150.0 / dt), dt)]) - [0.18, 0.0, -0.6]
        lag = round(0.06 / dt)
        return float(np.sum(path[lag:] * path[:-lag]) / np.sum(path**2))

    assert correlation(0.06) == pytest.approx(correlation(0.02), abs=0.05)
    assert correlation(0.06) < -0.5  # half a period


def test_seeds_differ_and_equal_seeds_do_not():
    a, b, c = (HandoverPartner(Params(seed=s)) for s in (1, 1, 2))
    y_a, y_b, y_c = (flat(walk(x, Inputs(), 20)[-1]) for x in (a, b, c))
    np.testing.assert_array_equal(y_a, y_b)
    assert np.abs(y_a - y_c).max() > 1e-5


def test_palm_keeps_its_distance_from_the_offered_ball():
    for y in walk(HandoverPartner(Params()), Inputs(), 30):
        np.testing.assert_allclose(y.p_WH - y.p_WO, [0.0, 0.0, -0.04], atol=1e-12)


@pytest.mark.parametrize(
    ("aside", "holder"),
    [
        ((0.0, 0.0, 0.0), Holder.GRIPPER),
        ((0.01, 0.0, 0.0), Holder.GRIPPER),
        ((0.0, -0.015, 0.0), Holder.GRIPPER),
        ((0.0, 0.0, 0.015), Holder.GRIPPER),
        ((0.07, 0.0, 0.0), Holder.HAND),
        ((0.0, 0.0, 0.06), Holder.HAND),
    ],
)
def test_a_gripper_that_closes_around_the_ball_takes_it_and_one_beside_it_does_not(
    aside: tuple[float, float, float], holder: Holder
):
    assert take(HandoverPartner(STILL), P_WO + np.array(aside))[-1].holder is holder


def test_the_person_lets_go_after_a_while_of_feeling_a_closed_gripper():
    y = walk(HandoverPartner(STILL), inputs(grip=0.94), 150)[-1]
    assert y.holder is Holder.HAND  # it does not look closed
    times = [i * 0.02 for i, y in enumerate(take(HandoverPartner(STILL), P_WO)) if y.holder is Holder.HAND]
    assert 0.95 + STILL.reaction_time < times[-1] < 0.95 + STILL.reaction_time + STILL.release_time + 0.6


def test_neither_ball_nor_hand_jump_at_the_handover():
    ys = take(HandoverPartner(Params(seed=3)), P_WO)
    for name in ("p_WO", "p_WH"):
        path = np.array([getattr(y, name) for y in ys])
        assert np.abs(np.diff(path, axis=0)).max() < 0.006  # withdrawing alone moves the hand by 5.6 mm in a step


def test_hand_withdraws_smoothly_outwards_and_down():
    path = np.array([y.p_WH for y in take(HandoverPartner(STILL), P_WO)])
    gone = path[-1] - path[0]
    np.testing.assert_allclose(gone, 0.15 * np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0), atol=1e-3)
    speed: Floats = np.linalg.norm(np.diff(path, axis=0), axis=1) / 0.02
    assert speed.max() == pytest.approx(0.15 * 1.875, rel=0.02)  # of a minimum-jerk course in 1 s


def test_a_hand_that_is_pressed_too_hard_is_drawn_back():
    def pressed(force_max: float) -> tuple[list[float], list[float]]:
        partner = HandoverPartner(replace(STILL, force_max=force_max))
        heights = np.append(np.arange(0.02, -0.04, -1e-3), np.full(80, -0.04))
        ys = [partner.step(i * 0.02, 0.02, inputs(beside(0.0, 0.0, h), 0.0)) for i, h in enumerate(heights)]
        return [float(np.linalg.norm(y.f_H)) for y in ys], [float(y.p_WH[0] - P_WO[0]) for y in ys]

    forces, aside = pressed(2.0)
    first = next(i for i, f in enumerate(forces) if f > 2.0)
    assert abs(aside[first]) < 2e-3
    assert aside[-1] > 0.1
    forces, aside = pressed(1000.0)
    assert forces[-1] > 2.0
    assert abs(aside[-1]) < 5e-3


def test_a_ball_that_is_held_resists_a_push_more_than_one_that_lies_there():
    def resistance(hold_force: float) -> float:
        partner = HandoverPartner(replace(STILL, hold_force=hold_force))
        inwards = [0.062 - 5e-4 * min(i, 28) for i in range(60)]  # a finger pushes against the ball's upper half
        ys = [partner.step(i * 0.02, 0.02, inputs(beside(x, 0.0, 0.012), 0.0)) for i, x in enumerate(inwards)]
        return float(np.linalg.norm(ys[-1].f_G))

    assert resistance(0.0) < 0.6
    assert resistance(3.0) > 2.5 * resistance(0.0)


def test_the_person_waits_beside_the_arm_until_the_gripper_has_made_room():
    place, hanging = np.array([0.03, 0.04, -0.65]), np.array([0.0, 0.0, -0.7])
    partner = HandoverPartner(replace(STILL, p_WO_0=place))
    outside = [0.072, 0.096, -0.65]
    np.testing.assert_allclose(partner.outputs(0.0, Inputs()).p_WO, outside)
    np.testing.assert_allclose(walk(partner, inputs(hanging, 0.0), 50)[-1].p_WO, outside)
    above = walk(partner, inputs(place + np.array([0.0, 0.0, 0.2]), 0.0), 40)
    np.testing.assert_allclose(above[-1].p_WO, place, atol=1e-9)
    moved = np.diff([y.p_WO for y in above], axis=0)
    assert np.linalg.norm(moved, axis=1).max() < 0.1 * 0.02 + 1e-9
    below = walk(partner, inputs(hanging + np.array([0.2, 0.0, 0.0]), 0.0), 5)
    np.testing.assert_allclose(below[-1].p_WO, place, atol=1e-9)


def test_on_the_arms_axis_the_person_waits_away_from_the_cameras():
    partner = HandoverPartner(replace(STILL, p_WO_0=np.array([0.0, 0.0, -0.6])))
    np.testing.assert_allclose(partner.outputs(0.0, Inputs()).p_WO, [0.12, 0.0, -0.6])


def test_the_person_who_helps_brings_the_ball_into_a_closing_gripper():
    aside = np.array([0.025, 0.01, 0.02])
    still = take(HandoverPartner(STILL), P_WO + aside)[-1]
    helped = take(HandoverPartner(replace(STILL, help_speed=0.1)), P_WO + aside)[-1]
    assert helped.holder is Holder.GRIPPER
    assert np.linalg.norm(helped.p_WO - P_WO - aside) < 0.004
    assert np.linalg.norm(still.p_WO - P_WO - aside) > 0.01
    far = take(HandoverPartner(replace(STILL, help_speed=0.1)), beside(0.2, 0.0, 0.0))[-1]
    np.testing.assert_array_equal(far.p_WO, P_WO)


def test_ball_falls_with_its_velocity_from_an_opened_gripper_and_rests_on_the_floor():
    partner = taken()
    for i in range(25):  # it is carried at 0.1 m/s
        p_WG = beside(0.002 * i, 0.0, 0.0)
        partner.step(3.0 + i * 0.02, 0.02, inputs(p_WG))
    opened = [partner.step(3.5 + i * 0.02, 0.02, inputs(beside(0.048 + 0.002 * i, 0.0, 0.0), 0.0)) for i in range(20)]
    free = next(i for i, y in enumerate(opened) if y.holder is Holder.FREE)
    assert free <= 4
    path = np.array([y.p_WO for y in opened[free : free + 12]])
    speed = np.diff(path, axis=0) / 0.02
    np.testing.assert_allclose(np.diff(speed[:, 2]) / 0.02, -9.81, rtol=1e-6)
    np.testing.assert_allclose(speed[:, 0], 0.1, atol=0.05)
    np.testing.assert_array_equal(opened[-1].f_G, np.zeros(3))
    rest = walk(partner, inputs(P_WO + AWAY, 0.0), 60)[-1]
    assert rest.p_WO[2] == -1.2
    assert walk(partner, inputs(rest.p_WO), 1)[-1].holder is Holder.FREE


def test_no_guidance_unless_asked_for():
    assert not np.any(HandoverPartner(Params()).step(0.0, 0.02, Inputs()).f_G)


def test_guidance_draws_the_gripper_over_the_ball_with_a_bounded_force():
    spring = {
        "guide_stiffness": 10.0,
        "guide_damping": 0.0,
        "guide_force_max": 1.0,
        "guide_speed": 1000.0,
    }
    partner = HandoverPartner(replace(STILL, guide_height=0.01, **spring))
    near, far = np.array([0.18, 0.0, -0.525]), np.array([0.0, 0.0, -0.7])
    p_WO = np.array([0.18, 0.0, -0.59])  # and 1 cm above it
    np.testing.assert_allclose(partner.step(0.0, 0.02, inputs(near, 0.0)).f_G, 10.0 * (p_WO - near), atol=1e-9)
    pull = partner.step(0.02, 0.02, inputs(far, 0.0)).f_G
    up = p_WO + np.array([-0.1, 0.0, 0.08]) - far  # it is low and beside the ball
    np.testing.assert_allclose(pull, up / np.linalg.norm(up), atol=1e-9)


def test_guidance_is_damped_by_the_velocity_between_steps():
    spring = {
        "guide_stiffness": 10.0,
        "guide_damping": 2.0,
        "guide_height": 0.0,
        "guide_speed": 1000.0,
    }
    partner = HandoverPartner(replace(STILL, **spring))
    first, second = np.array([0.165, 0.01, -0.53]), np.array([0.168, 0.01, -0.53])
    partner.step(0.0, 0.01, inputs(first, 0.0))
    f_G = partner.step(0.01, 0.02, inputs(second, 0.0)).f_G
    np.testing.assert_allclose(f_G, 10.0 * (P_WO - second) - 2.0 * np.array([0.3, 0.0, 0.0]), atol=1e-6)


def test_guidance_leads_with_its_speed():
    partner = HandoverPartner(replace(STILL, guide_stiffness=10.0, guide_speed=0.2, guide_damping=0.0))
    ys = walk(partner, inputs(np.array([0.0, 0.0, -0.7]), 0.0), 11)
    forces = [float(np.linalg.norm(y.f_G)) for y in ys]
    np.testing.assert_allclose(forces, 10.0 * 0.2 * 0.02 * np.arange(1, 12), atol=1e-6)


def test_guidance_leads_over_the_ball_before_it_leads_down():
    guided = replace(STILL, guide_stiffness=10.0, guide_height=0.02, guide_speed=1e3)
    aside = walk(HandoverPartner(guided), inputs(beside(-0.05, 0.0, 0.05), 0.0), 1)[0].f_G
    np.testing.assert_allclose(aside, [0.5, 0.0, 10.0 * (0.02 + 0.02 - 0.05)], atol=1e-6)
    low = walk(HandoverPartner(guided), inputs(beside(-0.05, 0.0, 0.0), 0.0), 1)[0].f_G
    np.testing.assert_allclose(low, [-0.5, 0.0, 10.0 * (0.02 + 0.02)], atol=1e-6)


@pytest.mark.parametrize("stiffness", [10.0, pytest.param(50.0, marks=pytest.mark.slow)])
def test_a_guided_arm_comes_nearer_and_to_rest(stiffness: float):
    low = np.array([0.12, 0.0, -0.85])
    above = replace(STILL, p_WO_0=low, guide_stiffness=stiffness, guide_height=0.15)  # clear of the ball
    arm, partner = TendonArmFast(ArmParams()), HandoverPartner(above)
    arm_y, y = arm.outputs(0.0, ArmInputs()), partner.outputs(0.0, Inputs())
    distance: list[float] = []
    for i in range(600):
        u = Inputs(p_WG=arm_y.p_WG, q_WG=arm_y.q_WG)
        arm_y = arm.step(i * 0.01, 0.01, ArmInputs(f_G=y.f_G))
        y = partner.step(i * 0.01, 0.01, u)
        distance.append(float(np.linalg.norm(y.p_WO + np.array([0.0, 0.0, 0.15]) - arm_y.p_WG)))
    assert distance[-1] < 0.75 * distance[0]
    assert np.ptp(distance[-100:]) < 0.01


@pytest.mark.parametrize("dt", [pytest.param(0.005, marks=pytest.mark.slow), 0.01])
def test_an_arm_that_leans_on_the_held_ball_stays_calm(dt: float):
    under_palm = replace(STILL, p_WO_0=np.array([0.01, 0.0, -0.68]), room=0.0)
    arm, partner, pull = TendonArmFast(ArmParams()), HandoverPartner(under_palm), np.array([0.2, 0.0, 0.0])
    arm_y, y = arm.outputs(0.0, ArmInputs()), partner.outputs(0.0, Inputs())
    forces: list[Floats] = []
    for i in range(round(6.0 / dt)):
        u = Inputs(p_WG=arm_y.p_WG, q_WG=arm_y.q_WG)
        arm_y = arm.step(i * dt, dt, ArmInputs(f_G=y.f_G + pull))
        y = partner.step(i * dt, dt, u)
        forces.append(y.f_H)
    assert y.holder is Holder.HAND
    settled = np.array(forces)[-round(1.0 / dt) :]
    assert np.linalg.norm(settled.mean(axis=0)) > 0.5  # it does lean on it
    assert np.ptp(settled, axis=0).max() < 0.15


def test_guidance_ends_with_the_handover():
    partner = taken(guide_stiffness=10.0)
    y = partner.step(3.0, 0.02, inputs())
    np.testing.assert_allclose(y.f_G, [0.0, 0.0, -0.1962], atol=0.005)


@pytest.mark.parametrize("steps", [1, 5, 40, 80])
def test_continues_bit_for_bit_from_a_state_here_and_in_another_partner(steps: int):
    def course(partner: HandoverPartner, first: int, last: int) -> list[Floats]:
        grips = np.select([np.arange(120) < 10, np.arange(120) < 90], [0.0, 1.0], 0.0)
        return [flat(partner.step(i * 0.02, 0.02, inputs(grip=float(grips[i])))) for i in range(first, last)]

    partner, other = (HandoverPartner(Params(seed=9, guide_stiffness=5.0)) for _ in range(2))
    course(partner, 0, steps)
    state = partner.get_state()
    wanted = course(partner, steps, 120)
    other.set_state(state)
    partner.set_state(state)
    np.testing.assert_array_equal(course(other, steps, 120), wanted)
    np.testing.assert_array_equal(course(partner, steps, 120), wanted)


def test_inputs_are_not_kept():
    partner = HandoverPartner(STILL)
    u = inputs(np.array(P_WO))
    y = partner.step(0.0, 0.02, u)
    u.p_WG[:] = 9.0
    np.testing.assert_array_equal(partner.outputs(0.02, u).p_WO, y.p_WO)


def test_contradicting_parameters_are_refused_all_at_once():
    with pytest.raises(InvalidPartnerParameters) as caught:
        HandoverPartner(Params(tremor_bandwidth=16.0, cup_radius=0.03, ball_radius=0.04, force_max=0.1, floor=-0.5))
    assert len(caught.value.faults) == 4
    assert "cup_radius 0.03 m must exceed ball_radius 0.04 m" in str(caught.value)
    assert "force_max 0.1 N must exceed the ball's weight, 0.1962 N" in str(caught.value)


def test_parameters_out_of_range_are_refused_all_at_once():
    with pytest.raises(InvalidPartnerParameters) as caught:
        HandoverPartner(Params(ball_mass=0.0, palm_friction=-0.5))
    assert len(caught.value.faults) == 2
    assert "ball_mass: 0.0 is out of range: from 0.001 to 1 kg" in str(caught.value)


def test_the_hand_moves_on_with_the_ball_smoothly():
    there = np.array([0.0, 0.18, -0.5])
    partner = HandoverPartner(Params(p_WO_1=there, move_from=1.0, move_for=2.0, tremor_rms=0.0, drift_rms=0.0))
    ys = [partner.step(0.02 * k, 0.02, inputs(P_WO + 1.0, 0.0)) for k in range(200)]
    path = np.array([y.p_WO for y in ys])
    here = Params().p_WO_0
    np.testing.assert_allclose(path[:50], np.tile(here, (50, 1)), atol=1e-12)
    np.testing.assert_allclose(path[150:], np.tile(there, (50, 1)), atol=1e-12)
    np.testing.assert_allclose(path[99], 0.5 * (here + there), atol=1e-9)  # at 2 s
    speed = [math.dist(a, b) / 0.02 for a, b in itertools.pairwise(path)]
    assert max(speed) == pytest.approx(1.875 * math.dist(there, here) / 2.0, rel=0.01)  # of minimum jerk
    np.testing.assert_allclose([y.p_WH - y.p_WO for y in ys], np.tile(Params().p_OH, (200, 1)), atol=1e-12)


def test_a_hand_that_moves_below_the_floor_is_refused():
    with pytest.raises(InvalidPartnerParameters, match=r"must lie below the offered ball, -1\.5 m"):
        HandoverPartner(Params(p_WO_1=np.array([0.0, 0.2, -1.5]), move_for=1.0))
