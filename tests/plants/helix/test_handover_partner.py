from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.handover_partner import (
    HandoverPartner,
    Holder,
    Inputs,
    InvalidPartnerParameters,
    Outputs,
    Params,
)
from handover.plants.helix.tendon_arm import Inputs as ArmInputs
from handover.plants.helix.tendon_arm import TendonArm
from handover.plants.helix.tendon_parameters import Params as ArmParams

STILL = Params(tremor_rms=0.0, drift_rms=0.0)
AT_BALL = np.array([0.17, 0.01, -0.59])
TURNED = Rotation.from_euler("xyz", [2.8, 0.3, -0.2])


def inputs(p_WG: Floats = AT_BALL, grip: float = 1.0, turn: Rotation = TURNED) -> Inputs:
    return Inputs(p_WG=p_WG, q_WG=turn.as_quat(scalar_first=True), grip=grip)


def flat(y: Outputs) -> Floats:
    return np.concatenate([np.ravel(getattr(y, v.name)) for v in describe(HandoverPartner).outputs])


def walk(partner: HandoverPartner, u: Inputs, steps: int, dt: float = 0.02) -> list[Outputs]:
    return [partner.step(i * dt, dt, u) for i in range(steps)]


def taken(**changes: Any) -> HandoverPartner:
    partner = HandoverPartner(replace(STILL, **changes))
    assert partner.step(0.0, 0.02, inputs()).holder is Holder.GRIPPER
    return partner


def test_starts_at_its_place_in_the_hand():
    y = HandoverPartner(Params(p_WO_0=np.array([0.1, 0.1, -0.6]))).outputs(0.0, Inputs())
    np.testing.assert_array_equal(y.p_WO, [0.1, 0.1, -0.6])
    np.testing.assert_allclose(y.p_WH, [0.1, 0.1, -0.64])
    np.testing.assert_array_equal(y.f_G, np.zeros(3))
    assert y.holder is Holder.HAND


@pytest.mark.parametrize("dt", [0.005, 0.02, 0.05])
def test_tremor_and_drift_are_as_large_as_declared_whatever_the_step(dt: float):
    def rms(**changes: Any) -> float:
        partner = HandoverPartner(replace(STILL, seed=4, **changes))
        path = np.array([y.p_WO for y in walk(partner, Inputs(), 12000, dt)]) - [0.18, 0.0, -0.6]
        return float(np.sqrt(np.mean(np.sum(path[200:] ** 2, axis=1, dtype=np.float64))))

    assert rms(tremor_rms=0.001) == pytest.approx(0.001, rel=0.08)
    assert rms(drift_rms=0.003, drift_time=0.5) == pytest.approx(0.003, rel=0.15)


def test_tremor_lies_in_its_band():
    partner = HandoverPartner(Params(drift_rms=0.0, tremor_frequency=8.0, tremor_bandwidth=2.0))
    x = np.array([y.p_WO[0] for y in walk(partner, Inputs(), 16384, 0.01)]) - 0.18
    power, f = np.abs(np.fft.rfft(x)) ** 2, np.fft.rfftfreq(len(x), 0.01)
    below = np.cumsum(power) / np.sum(power)
    assert f[np.searchsorted(below, 0.5)] == pytest.approx(8.0, abs=0.4)
    assert f[np.searchsorted(below, 0.15)] > 5.0
    assert f[np.searchsorted(below, 0.9)] < 10.5


def test_correlation_over_a_time_is_the_same_in_one_step_or_many():
    def correlation(dt: float) -> float:
        partner = HandoverPartner(Params(drift_rms=0.0, seed=1))
        path = np.array([y.p_WO for y in walk(partner, Inputs(), round(400.0 / dt), dt)]) - [0.18, 0.0, -0.6]
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
    ("p_GO", "grip", "holder"),
    [
        ((0.0, 0.0, 0.0), 0.95, Holder.GRIPPER),
        ((0.0, 0.0, 0.0), 0.94, Holder.HAND),
        ((0.0299, 0.0, 0.0299), 1.0, Holder.GRIPPER),
        ((0.0, -0.0299, -0.0299), 1.0, Holder.GRIPPER),
        ((0.0, 0.04, 0.0), 1.0, Holder.HAND),
        ((0.022, 0.022, 0.0), 1.0, Holder.HAND),
        ((0.0, 0.0, 0.0301), 1.0, Holder.HAND),
        ((0.0, 0.0, -0.0301), 1.0, Holder.HAND),
    ],
)
def test_hand_lets_go_when_a_closed_gripper_has_the_ball_between_its_fingers(
    p_GO: tuple[float, float, float], grip: float, holder: Holder
):
    partner = HandoverPartner(STILL)
    p_WG = np.array([0.18, 0.0, -0.6]) - TURNED.as_matrix() @ np.array(p_GO)
    assert partner.step(0.0, 0.02, inputs(p_WG, grip)).holder is holder


def test_ball_moves_rigidly_with_the_gripper_and_weighs_on_it():
    partner = taken()
    p_GO = np.transpose(TURNED.as_matrix()) @ (np.array([0.18, 0.0, -0.6]) - AT_BALL)
    later = Rotation.from_euler("xyz", [3.1, -0.4, 0.5])
    y = partner.step(0.02, 0.02, inputs(np.array([0.0, 0.1, -0.5]), 1.0, later))
    np.testing.assert_allclose(y.p_WO, np.array([0.0, 0.1, -0.5]) + later.as_matrix() @ p_GO, atol=1e-12)
    np.testing.assert_allclose(y.f_G, [0.0, 0.0, -0.02 * 9.81])


def test_neither_ball_nor_hand_jump_at_the_handover():
    partner = HandoverPartner(Params(seed=3))
    before = walk(partner, inputs(grip=0.0), 50)[-1]
    after = partner.step(1.0, 0.001, inputs())
    assert after.holder is Holder.GRIPPER
    np.testing.assert_allclose(after.p_WO, before.p_WO, atol=1e-12)
    assert np.linalg.norm(after.p_WH - before.p_WH) < 2e-4


def test_hand_withdraws_smoothly_outwards_and_down():
    partner = taken()
    path = np.array([y.p_WH for y in walk(partner, inputs(), 70)])
    gone = path[-1] - [0.18, 0.0, -0.64]
    np.testing.assert_allclose(gone, 0.15 * np.array([1.0, 0.0, -1.0]) / np.sqrt(2.0), atol=1e-12)
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) / 0.02
    assert speed.max() == pytest.approx(0.15 * 1.875, rel=0.01)  # of a minimum-jerk course in 1 s
    assert np.abs(np.diff(speed)).max() / 0.02 < 0.15 * 5.8


def test_ball_falls_with_its_velocity_from_an_opened_gripper_and_rests_on_the_floor():
    partner = taken()
    start = partner.step(0.02, 0.02, inputs(AT_BALL + np.array([0.002, 0.0, 0.0]))).p_WO
    y = walk(partner, inputs(grip=0.49), 10)[-1]
    assert y.holder is Holder.FREE
    np.testing.assert_allclose(y.p_WO, start + np.array([0.1 * 0.2, 0.0, -9.81 * 0.2**2 / 2]), atol=1e-12)
    np.testing.assert_array_equal(y.f_G, np.zeros(3))
    rest = walk(partner, inputs(grip=0.0), 60)[-1]
    assert rest.p_WO[2] == -1.2
    assert walk(partner, inputs(rest.p_WO), 1)[-1].holder is Holder.FREE


def test_no_guidance_unless_asked_for():
    assert not np.any(HandoverPartner(Params()).step(0.0, 0.02, Inputs()).f_G)


def test_guidance_draws_the_gripper_to_the_ball_with_a_bounded_force():
    partner = HandoverPartner(replace(STILL, guide_stiffness=10.0, guide_damping=0.0, guide_force_max=1.0))
    near, far = np.array([0.16, 0.03, -0.62]), np.array([0.0, 0.0, -0.7])
    p_WO = np.array([0.18, 0.0, -0.6])
    np.testing.assert_allclose(partner.step(0.0, 0.02, inputs(near, 0.0)).f_G, 10.0 * (p_WO - near), atol=1e-12)
    pull = partner.step(0.02, 0.02, inputs(far, 0.0)).f_G
    np.testing.assert_allclose(pull, (p_WO - far) / np.linalg.norm(p_WO - far), atol=1e-12)


def test_guidance_is_damped_by_the_velocity_between_steps():
    partner = HandoverPartner(replace(STILL, guide_stiffness=10.0, guide_damping=2.0))
    first, second = np.array([0.16, 0.03, -0.62]), np.array([0.163, 0.03, -0.62])
    partner.step(0.0, 0.01, inputs(first, 0.0))
    f_G = partner.step(0.01, 0.02, inputs(second, 0.0)).f_G
    spring = 10.0 * (np.array([0.18, 0.0, -0.6]) - second)
    np.testing.assert_allclose(f_G, spring - 2.0 * np.array([0.3, 0.0, 0.0]), atol=1e-12)


@pytest.mark.parametrize("stiffness", [10.0, 50.0])
def test_a_guided_arm_comes_nearer_and_to_rest(stiffness: float):
    arm, partner = TendonArm(ArmParams()), HandoverPartner(replace(STILL, guide_stiffness=stiffness))
    arm_y, y = arm.outputs(0.0, ArmInputs()), partner.outputs(0.0, Inputs())
    distance: list[float] = []
    for i in range(150):
        u = Inputs(p_WG=arm_y.p_WG, q_WG=arm_y.q_WG)
        arm_y = arm.step(i * 0.02, 0.02, ArmInputs(f_G=y.f_G))
        y = partner.step(i * 0.02, 0.02, u)
        distance.append(float(np.linalg.norm(y.p_WO - arm_y.p_WG)))
    assert distance[-1] < 0.7 * distance[0]
    assert np.ptp(distance[-50:]) < 0.01


def test_guidance_ends_with_the_handover():
    np.testing.assert_allclose(taken(guide_stiffness=10.0).outputs(0.02, inputs()).f_G, [0.0, 0.0, -0.1962])


@pytest.mark.parametrize("steps", [1, 5, 40, 80])
def test_continues_bit_for_bit_from_a_state_here_and_in_another_partner(steps: int):
    def course(partner: HandoverPartner, first: int, last: int) -> list[Floats]:
        grips = np.select([np.arange(120) < 30, np.arange(120) < 70], [0.0, 1.0], 0.0)
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
    u = inputs(np.array(AT_BALL))
    y = partner.step(0.0, 0.02, u)
    u.p_WG[:] = 9.0
    np.testing.assert_array_equal(partner.outputs(0.02, u).p_WO, y.p_WO)


def test_contradicting_parameters_are_refused_all_at_once():
    with pytest.raises(InvalidPartnerParameters) as caught:
        HandoverPartner(Params(tremor_bandwidth=16.0, release_grip=0.95, floor=-0.5))
    assert len(caught.value.faults) == 3
    assert "release_grip 0.95 must be less than capture_grip" in str(caught.value)
