"""A person who holds out a ball: tremor, grip, withdrawal, guidance, and the bowl into which it may fall."""

import itertools
import math
from collections.abc import Generator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.plants.partner_runs import AWAY, P_WO, STILL, beside, inputs, take, taken, walk
from support.restored_states import assert_continues, flat
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.arm.tendon_arm_fast import TendonArmFast
from handover.plants.helix.arm.tendon_parameters import Params as ArmParams
from handover.plants.helix.arm.tendon_ports import Inputs as ArmInputs
from handover.plants.helix.arm.tendon_ports import Outputs as ArmOutputs
from handover.plants.helix.cameras.stereo_camera import Inputs as Seen
from handover.plants.helix.cameras.stereo_camera import Params as CameraParams
from handover.plants.helix.cameras.stereo_camera import StereoCamera
from handover.plants.helix.hand.bowl import Bowl
from handover.plants.helix.hand.handover_partner import HandoverPartner
from handover.plants.helix.hand.partner_parameters import Holder, Inputs, InvalidPartnerParameters, Outputs, Params


def test_starts_at_its_place_in_the_hand_and_seeds_differ():
    y = HandoverPartner(Params(p_WO_0=np.array([0.1, 0.1, -0.6]))).outputs(0.0, Inputs())
    np.testing.assert_allclose([y.p_WO, y.p_WH, y.f_G], [[0.1, 0.1, -0.6], [0.1, 0.1, -0.64], [0.0] * 3])
    assert y.holder is Holder.HAND
    a, b, c = (flat(walk(HandoverPartner(Params(seed=seed)), Inputs(), 20)[-1]) for seed in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert np.abs(a - c).max() > 1e-5


@pytest.mark.parametrize(("dt", "steps"), [(0.02, 3000), (0.05, 2000)])
def test_tremor_and_drift_are_as_large_as_declared_whatever_the_step(dt: float, steps: int):
    def rms(**changes: Any) -> float:
        partner = HandoverPartner(replace(STILL, seed=4, **changes))
        path = np.array([y.p_WO for y in walk(partner, Inputs(), steps, dt)]) - P_WO
        return float(np.sqrt(np.mean(np.sum(path[200:] ** 2, axis=1, dtype=np.float64))))

    assert rms(tremor_rms=0.001) == pytest.approx(0.001, rel=0.08)
    assert rms(drift_rms=0.003, drift_time=0.2) == pytest.approx(0.003, rel=0.15)


def test_tremor_lies_in_its_band():
    partner = HandoverPartner(Params(drift_rms=0.0, tremor_frequency=8.0, tremor_bandwidth=2.0))
    x = np.array([y.p_WO[0] for y in walk(partner, Inputs(), 8192, 0.01)]) - 0.18
    power, f = np.abs(np.fft.rfft(x)) ** 2, np.fft.rfftfreq(len(x), 0.01)
    below = np.cumsum(power) / np.sum(power)
    assert f[np.searchsorted(below, 0.5)] == pytest.approx(8.0, abs=0.4)
    assert f[np.searchsorted(below, 0.15)] > 5.0
    assert f[np.searchsorted(below, 0.9)] < 10.5


@pytest.mark.parametrize(
    ("aside", "holder"),
    [
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


def test_the_person_waits_beside_the_arm_away_from_the_cameras_until_the_gripper_has_made_room():
    place, hanging = np.array([0.03, 0.04, -0.65]), np.array([0.0, 0.0, -0.7])
    on_axis = HandoverPartner(replace(STILL, p_WO_0=np.array([0.0, 0.0, -0.6])))
    np.testing.assert_allclose(on_axis.outputs(0.0, Inputs()).p_WO, [0.12, 0.0, -0.6])
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


SPRING = replace(STILL, guide_stiffness=10.0, guide_damping=0.0, guide_speed=1000.0)


def test_guidance_draws_the_gripper_over_the_ball_with_a_bounded_force():
    partner = HandoverPartner(replace(SPRING, guide_height=0.01, guide_force_max=1.0))
    near, far = np.array([0.18, 0.0, -0.525]), np.array([0.0, 0.0, -0.7])
    p_WO = np.array([0.18, 0.0, -0.59])  # and 1 cm above it
    np.testing.assert_allclose(partner.step(0.0, 0.02, inputs(near, 0.0)).f_G, 10.0 * (p_WO - near), atol=1e-9)
    pull = partner.step(0.02, 0.02, inputs(far, 0.0)).f_G
    up = p_WO + np.array([-0.1, 0.0, 0.08]) - far  # it is low and beside the ball
    np.testing.assert_allclose(pull, up / np.linalg.norm(up), atol=1e-9)
    assert not np.any(HandoverPartner(Params()).step(0.0, 0.02, inputs(near, 0.0)).f_G)  # none unless asked for


def test_guidance_is_damped_by_the_velocity_between_steps():
    partner = HandoverPartner(replace(SPRING, guide_damping=2.0, guide_height=0.0))
    first, second = np.array([0.165, 0.01, -0.53]), np.array([0.168, 0.01, -0.53])
    partner.step(0.0, 0.01, inputs(first, 0.0))
    f_G = partner.step(0.01, 0.02, inputs(second, 0.0)).f_G
    np.testing.assert_allclose(f_G, 10.0 * (P_WO - second) - 2.0 * np.array([0.3, 0.0, 0.0]), atol=1e-6)


def test_guidance_leads_with_its_speed():
    partner = HandoverPartner(replace(SPRING, guide_speed=0.2))
    ys = walk(partner, inputs(np.array([0.0, 0.0, -0.7]), 0.0), 11)
    forces = [float(np.linalg.norm(y.f_G)) for y in ys]
    np.testing.assert_allclose(forces, 10.0 * 0.2 * 0.02 * np.arange(1, 12), atol=1e-6)


def test_guidance_leads_over_the_ball_before_it_leads_down():
    guided = replace(SPRING, guide_height=0.02)
    aside = walk(HandoverPartner(guided), inputs(beside(-0.05, 0.0, 0.05), 0.0), 1)[0].f_G
    np.testing.assert_allclose(aside, [0.5, 0.0, 10.0 * (0.02 + 0.02 - 0.05)], atol=1e-6)
    low = walk(HandoverPartner(guided), inputs(beside(-0.05, 0.0, 0.0), 0.0), 1)[0].f_G
    np.testing.assert_allclose(low, [-0.5, 0.0, 10.0 * (0.02 + 0.02)], atol=1e-6)


def coupled(partner_params: Params, pull: Floats, seconds: float) -> Generator[tuple[ArmOutputs, Outputs], None, None]:
    """Couple arm and person in steps of 10 ms, each with what the other did in the last; something pulls the arm."""
    arm, partner, dt = TendonArmFast(ArmParams()), HandoverPartner(partner_params), 0.01
    arm_y, y = arm.outputs(0.0, ArmInputs()), partner.outputs(0.0, Inputs())
    for i in range(round(seconds / dt)):
        u = Inputs(p_WG=arm_y.p_WG, q_WG=arm_y.q_WG)
        arm_y = arm.step(i * dt, dt, ArmInputs(f_G=y.f_G + pull))
        y = partner.step(i * dt, dt, u)
        yield arm_y, y


def test_a_guided_arm_comes_nearer_and_to_rest():
    clear = np.array([0.0, 0.0, 0.15])  # of the ball
    above = replace(STILL, p_WO_0=np.array([0.12, 0.0, -0.85]), guide_stiffness=10.0, guide_height=0.15)
    distance = [float(np.linalg.norm(y.p_WO + clear - a.p_WG)) for a, y in coupled(above, np.zeros(3), 6.0)]
    assert distance[-1] < 0.75 * distance[0]
    assert np.ptp(distance[-100:]) < 0.01


def test_an_arm_that_leans_on_the_held_ball_stays_calm():
    under_palm = replace(STILL, p_WO_0=np.array([0.01, 0.0, -0.68]), room=0.0)
    seen = [y for _, y in coupled(under_palm, np.array([0.2, 0.0, 0.0]), 6.0)]
    assert seen[-1].holder is Holder.HAND
    settled = np.array([y.f_H for y in seen[-100:]])
    assert np.linalg.norm(settled.mean(axis=0)) > 0.5  # it does lean on it
    assert np.ptp(settled, axis=0).max() < 0.15


def test_guidance_ends_with_the_handover():
    partner = taken(guide_stiffness=10.0)
    y = partner.step(3.0, 0.02, inputs())
    np.testing.assert_allclose(y.f_G, [0.0, 0.0, -0.1962], atol=0.005)


def test_continues_bit_for_bit_from_a_state_here_and_in_another_partner():
    def course(i: int) -> Inputs:
        return inputs(grip=float(10 <= i < 90))

    assert_continues(lambda: HandoverPartner(Params(seed=9, guide_stiffness=5.0)), course, [1, 5, 40, 80], 40, 0.02)


def test_inputs_are_not_kept():
    partner = HandoverPartner(STILL)
    u = inputs(np.array(P_WO))
    y = partner.step(0.0, 0.02, u)
    u.p_WG[:] = 9.0
    np.testing.assert_array_equal(partner.outputs(0.02, u).p_WO, y.p_WO)


@pytest.mark.parametrize(
    ("faults", "changes"),
    [
        (4, {"tremor_bandwidth": 16.0, "cup_radius": 0.03, "ball_radius": 0.04, "force_max": 0.1, "floor": -0.5}),
        (2, {"ball_mass": 0.0, "palm_friction": -0.5}),
        (1, {"p_WO_1": np.array([0.0, 0.2, -1.5]), "move_for": 1.0}),
        (3, {"bowl_radius": 0.02, "bowl_depth": 0.5, "p_WD": np.array([0.0, 0.0, -1.1])}),
    ],
    ids=["contradictions", "ranges", "below the floor", "bowl"],
)
def test_false_parameters_are_refused_all_at_once(faults: int, changes: dict[str, Any], wording: Wording):
    with pytest.raises(InvalidPartnerParameters) as caught:
        HandoverPartner(Params(**changes))
    assert len(caught.value.faults) == faults
    wording.check(caught.value)


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


P_WD = np.array([0.0, -0.16, -0.74])
BOWL = Bowl(P_WD, radius=0.08, depth=0.06, ball_radius=0.025)
DOWN = np.array([0.0, 1.0, 0.0, 0.0])


def dropped(beside: float, v: float = 0.0, dt: float = 0.02, **changes: Any) -> list[Outputs]:
    """Return what a ball does that a gripper, moving at v, takes 0.1 m over the rim and lets go."""
    p_WG = P_WD + np.array([beside, 0.0, 0.1])
    at_rest: Any = {"p_WO_0": p_WG, "p_WD": P_WD, "bowl_radius": 0.08, "tremor_rms": 0.0, "drift_rms": 0.0}
    partner = HandoverPartner(replace(Params(), **(at_rest | changes)))
    step = v * dt * np.array([1.0, 0.0, 0.0])
    take(partner, p_WG, dt=dt)
    carried = round(0.5 / dt)
    for i in range(-carried, 1):
        partner.step(4.0 + i * dt, dt, Inputs(p_WG=p_WG + i * step, q_WG=DOWN, grip=1.0))
    return [partner.step(4.0 + i * dt, dt, Inputs(p_WG=p_WG + i * step, q_WG=DOWN, grip=0.0)) for i in range(1, 150)]


@pytest.mark.parametrize("beside", [0.0, -0.075])
def test_a_ball_over_the_bowl_comes_to_rest_on_its_lowest_point(beside: float):
    ys = dropped(beside)
    assert ys[-1].holder is Holder.FREE
    lowest = P_WD - np.array([0.0, 0.0, BOWL.depth - BOWL.ball_radius])
    np.testing.assert_allclose(ys[-1].p_WO, lowest, atol=0.003)
    inside = [y.p_WO for y in ys if y.p_WO[2] < P_WD[2]]
    assert len(inside) > 20
    assert np.linalg.norm(inside - BOWL.p_WS, axis=1).max() <= BOWL.sphere_radius - BOWL.ball_radius + 1e-12


@pytest.mark.parametrize(("beside", "v", "radius"), [(0.085, 0.0, 0.08), (0.05, 0.4, 0.08), (0.0, 0.0, 0.0)])
def test_a_ball_past_the_rim_or_without_a_bowl_falls_to_the_floor(beside: float, v: float, radius: float):
    assert dropped(beside, v, bowl_radius=radius)[-1].p_WO[2] == Params().floor


def test_nothing_comes_in_from_below_or_past_the_rim():
    over, under = P_WD + np.array([0.0, 0.0, 0.01]), P_WD - np.array([0.0, 0.0, 0.01])
    assert BOWL.catches(over, under)
    assert not BOWL.catches(under, over)
    aside: Floats = np.array([0.081, 0.0, 0.0])
    assert not BOWL.catches(over + aside, under + aside)


def test_a_fall_crosses_the_rim_s_plane_on_the_line_between_two_places():
    before, after = P_WD + np.array([0.1, 0.0, 0.01]), P_WD + np.array([0.14, 0.0, -0.03])
    crossing = BOWL.crossing(before, after)
    assert crossing is not None
    np.testing.assert_allclose(crossing, P_WD + np.array([0.11, 0.0, 0.0]), atol=1e-15)
    assert BOWL.crossing(after, before) is None
    assert BOWL.crossing(after, after - 0.1) is None


def test_the_rim_lies_on_the_inner_surface():
    profile = BOWL.profile(9)
    np.testing.assert_allclose(profile[[0, -1]], [[0.0, P_WD[2] - BOWL.depth], [BOWL.radius, P_WD[2]]], atol=1e-12)


@pytest.mark.slow
def test_the_cameras_see_the_bowl_and_what_lies_in_it_behind_its_wall():
    def picture(bowl_radius: float, p_WO: Floats) -> Any:
        camera = StereoCamera(CameraParams(p_WD=P_WD, bowl_radius=bowl_radius, noise=0.0))
        return np.asarray(camera.outputs(0.0, Seen(p_WO=p_WO)).left).reshape(720, 1280, 3).astype(np.int64)

    def green(pixels: Any) -> int:
        blue, middle, red = (pixels[..., k] for k in range(3))
        return int(np.sum((middle > blue + 40) & (middle > red + 40)))

    inside, aside = P_WD - np.array([0.0, 0.0, 0.035]), np.array([0.18, 0.0, -0.62])
    assert np.any(picture(0.0, aside) != picture(0.08, aside))
    assert green(picture(0.08, inside)) < 0.4 * green(picture(0.0, inside))
