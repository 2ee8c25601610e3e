"""The reflex of the Helix's gripper: what fingers, cameras and motors each tell of the ball's place, and its limits."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from handover.controllers.helix.reflex.finger_model import FingerModel
from handover.controllers.helix.reflex.grasp_reflex import (
    GraspReflex,
    Inputs,
    InvalidGraspReflexParameters,
    InvalidReading,
    Params,
    Source,
)
from handover.controllers.helix.reflex.offset_filter import OffsetFilter
from handover.controllers.helix.servo.constant_curvature import W_FROM_B, forward_kinematics, tendon_lengths
from handover.cosim.blocks.ports import Floats
from handover.plants.helix.finger_infrared import FingerInfrared
from handover.plants.helix.finger_infrared import Inputs as FingerInputs
from handover.plants.helix.finger_infrared import Params as FingerParams

R_DOWN = np.diag([1.0, -1.0, -1.0])
DOWN = np.array([0.0, 1.0, 0.0, 0.0])
P = Params()
Q_HANGING = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.24, 0.0, 0.0, 0.24])
P_WG = np.array([0.0, 0.0, -0.7])
UP = np.array([0.0, 0.0, 1.0])
KNOWN = 1e-8 * np.eye(3)
IDEAL = {"tolerance": 0.0, "range_tolerance": 0.0, "mounting_tolerance": 0.0}


def ticks_of(p_GO: Any, grip: float = 0.0, palm: bool = False, **values: Any) -> Floats:
    """Return what the plant's sensors read of a ball in a gripper that points down."""
    settings: dict[str, Any] = {**IDEAL, "noise": 0.0, **values}
    unit = FingerInfrared(FingerParams(**settings))
    ball = P_WG + R_DOWN @ np.asarray(p_GO, dtype=np.float64)
    u = FingerInputs(p_WG=P_WG, q_WG=DOWN, grip=grip, p_WO=ball, p_WH=ball - (0.04 if palm else 5.0) * UP)
    return unit.outputs(0.0, u).ticks


def model() -> FingerModel:
    return P.model


def seen(p_GO: Any, **values: Any) -> Inputs:
    """Return exact measurements of a hanging arm's gripper and a ball at a place in its frame."""
    p_WO = P_WG + R_DOWN @ np.asarray(p_GO, dtype=np.float64)
    exact: dict[str, Any] = {"p_WO_meas": p_WO, "p_WR_meas": P_WG + 0.1 * UP, "p_WG_meas": P_WG}
    exact |= {"cov_O": KNOWN, "cov_R": KNOWN, "cov_G": KNOWN, "seen_O": True, "seen_R": True}
    return Inputs(**{**exact, **values})


def unseen(**values: Any) -> Inputs:
    return Inputs(**values)


@pytest.mark.parametrize("grip", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("p_GO", [(0.0, 0.0, 0.05), (0.01, -0.004, 0.03), (-0.006, 0.008, 0.0)])
def test_the_controller_expects_what_the_plant_s_sensors_read(p_GO: Any, grip: float):
    m = model()
    expected = m.readings(m.beams(grip), np.array(p_GO))
    np.testing.assert_allclose(expected, ticks_of(p_GO, grip), atol=1.0)


def test_a_palm_is_expected_by_those_that_look_ahead_alone_as_they_come_near():
    m = model()
    down = np.array([0.0, 0.0, 1.0])
    near, far = (m.of_palm(m.beams(0.0), np.array([0.0, 0.0, z]), down) for z in (0.0, 0.06))
    assert np.all(near[3:] > 50.0)
    assert not np.any(near[:3])
    assert not np.any(far)


@pytest.mark.parametrize("along", [0.05, 0.03, 0.0])
@pytest.mark.parametrize("reflectivity", [0.5, 1.0, 1.6])
def test_the_fingers_find_a_ball_of_any_brightness_beside_the_axis(along: float, reflectivity: float):
    true = np.array([0.008, -0.005, along])
    f = OffsetFilter(model(), replace(P, brightness=1.0).doubts)
    f.see(R_DOWN @ np.array([0.0, 0.0, along]), 0.01**2 * np.eye(3))
    for _ in range(20):
        f.feel(ticks_of(true, ball_reflectivity=reflectivity), R_DOWN, 0.0, 0.5)
    found = R_DOWN @ f.offset
    assert np.hypot(*(found - true)[:2]) < 0.004  # 9.4 mm at first
    if along < 0.05:  # farther off, a dark ball and one that is farther read alike
        assert f.reflectivity == pytest.approx(reflectivity, rel=0.3)


def test_errors_that_stay_alike_are_not_averaged_away():
    """Twenty readings within the memory tell as much as those of one memory, not of twenty."""
    often, seldom = (OffsetFilter(model(), P.doubts) for _ in range(2))
    for f, n, dt in ((often, 20, P.memory / 20.0), (seldom, 1, P.memory)):
        f.see(R_DOWN @ np.array([0.0, 0.0, 0.03]), 0.01**2 * np.eye(3))
        for _ in range(n):
            f.feel(ticks_of([0.0, 0.0, 0.03]), R_DOWN, 0.0, dt)
    assert often.deviation == pytest.approx(seldom.deviation, rel=0.1)


def test_cameras_that_are_off_are_found_out_by_the_fingers():
    reflex, beside = GraspReflex(Params(bias=0.01)), np.array([0.006, 0.0, 0.0])
    y = None
    for k in range(100):
        u = seen(np.array([0.0, 0.0, 0.02]) + beside, ticks=ticks_of([0.0, 0.0, 0.02]))
        y = reflex.step(0.1 * k, 0.1, u)
    assert y is not None
    assert y.source is Source.CAMERAS_AND_FINGERS
    assert np.hypot(*y.p_GO_est[:2]) < 0.002
    told = R_DOWN @ (y.p_WO - y.p_WG)
    assert np.hypot(*told[:2]) < 0.002


def test_without_fingers_measurements_go_through_as_they_are():
    reflex = GraspReflex(Params(feels=False))
    for k in range(10):
        u = seen([0.01, 0.0, 0.04], ticks=ticks_of([0.0, 0.0, 0.04]))
        y = reflex.step(0.1 * k, 0.1, u)
        assert y.source is Source.CAMERAS
        np.testing.assert_array_equal(y.p_WO, u.p_WO_meas)
        np.testing.assert_array_equal(y.p_WG, u.p_WG_meas)
        np.testing.assert_array_equal(y.P_O, u.cov_O)


def test_far_from_the_ball_what_is_not_seen_is_not_told():
    reflex = GraspReflex(P)
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.2]))
    y = reflex.step(0.1, 0.1, unseen())
    assert not y.known_O
    assert not y.known_R
    assert y.source is Source.NONE
    y = reflex.step(0.2, 0.1, replace(seen([0.0, 0.0, 0.2]), seen_O=False))
    assert not y.known_O
    assert y.known_R


def test_covered_cameras_are_bridged_by_what_the_motors_do():
    """Shortened by as much in all segments, a hanging arm's gripper rises by it, and the ball stays where it is."""
    reflex = GraspReflex(Params(feels=False))
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03], q_est=Q_HANGING))
    shorter = Q_HANGING - 0.002 * (np.arange(9) % 3 == 2)
    dl_t = tendon_lengths(shorter, P.d_tendon) - tendon_lengths(Q_HANGING, P.d_tendon)
    rise = (W_FROM_B * (forward_kinematics(shorter, 0.1) - forward_kinematics(Q_HANGING, 0.1)))[3:]
    y = None
    for k in range(1, 31):
        y = reflex.step(0.1 * k, 0.1, unseen(dl_t=dl_t, q_est=Q_HANGING))
    assert y is not None
    assert y.source is Source.MOTORS
    assert y.known_O
    assert y.known_R
    np.testing.assert_allclose(y.p_WG, P_WG + rise, atol=1e-6)
    np.testing.assert_allclose(y.p_WO, P_WG - 0.03 * UP, atol=1e-6)
    np.testing.assert_allclose(y.p_WR - y.p_WG, 0.1 * UP, atol=1e-6)


def test_a_reckoned_gripper_keeps_its_distance_from_the_wrist():
    """Else the servo, which keeps it, takes the gripper to be elsewhere than the ball is told from."""
    reflex, q = GraspReflex(Params(feels=False)), np.array([0.1, 0.0, 0.12, 0.3, 0.1, 0.24, 0.4, -0.2, 0.24])
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03], q_est=q))
    for k in range(1, 20):
        dl_t = tendon_lengths(q - 0.001 * k, P.d_tendon) - tendon_lengths(q, P.d_tendon)
        y = reflex.step(0.1 * k, 0.1, unseen(dl_t=dl_t, q_est=q))
        assert np.linalg.norm(y.p_WG - y.p_WR) == pytest.approx(P.d_gripper, abs=1e-12)


def test_a_hidden_ball_is_left_in_its_place_by_a_gripper_that_is_seen_to_move():
    """What the motors were told counts for nothing where the ring is in view."""
    reflex, p_WO = GraspReflex(Params(feels=False)), P_WG - 0.03 * UP
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03], q_est=Q_HANGING))
    for k in range(1, 20):
        up = 0.001 * k * UP
        u = seen([0.0, 0.0, 0.0], q_est=Q_HANGING, seen_O=False)
        u = replace(u, p_WG_meas=P_WG + up, p_WR_meas=P_WG + 0.1 * UP + up, dl_t=np.full(9, 0.01 * k))
        y = reflex.step(0.1 * k, 0.1, u)
        np.testing.assert_allclose(y.p_WO, p_WO, atol=1e-9)
        np.testing.assert_array_equal(y.p_WG, u.p_WG_meas)


def test_a_ball_whose_place_has_become_too_uncertain_is_lost():
    reflex = GraspReflex(Params(feels=False))
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03]))
    known = [reflex.step(0.1 * k, 0.1, unseen()).known_O for k in range(1, 1000)]
    assert known[0]
    assert not known[-1]
    assert known == sorted(known, reverse=True)


def test_covered_cameras_and_an_arm_that_slipped_leave_it_to_the_fingers():
    reflex, true = GraspReflex(P), np.array([0.012, 0.004, 0.03])  # seen on the axis last
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03]))
    y = None
    for k in range(1, 60):
        y = reflex.step(0.1 * k, 0.1, unseen(ticks=ticks_of(true, palm=True), q_est=Q_HANGING))
    assert y is not None
    assert y.source is Source.MOTORS_AND_FINGERS
    assert y.sensors == 6
    told = R_DOWN @ (y.p_WO - y.p_WG)
    assert np.hypot(*(told - true)[:2]) < 0.003
    blind = GraspReflex(Params(feels=False))
    blind.step(0.0, 0.1, seen([0.0, 0.0, 0.03]))
    y = blind.step(0.1, 0.1, unseen(ticks=ticks_of(true), q_est=Q_HANGING))
    assert np.hypot(*(R_DOWN @ (y.p_WO - y.p_WG))[:2]) < 1e-6


def test_one_reading_alone_is_not_taken_in():
    reflex = GraspReflex(P)
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.05]))
    y = reflex.step(0.1, 0.1, unseen(ticks=np.array([0.0, 0.0, 0.0, 400.0, 0.0, 0.0])))
    assert y.source is Source.MOTORS
    assert y.sensors == 1


def test_a_restored_state_continues_bit_for_bit():
    one, other = GraspReflex(P), GraspReflex(P)
    for k in range(6):
        one.step(
            0.1 * k, 0.1, seen([0.002 * k, 0.0, 0.05], ticks=ticks_of([0.0, 0.0, 0.05]), dl_t=np.full(9, 0.001 * k))
        )
    other.set_state(one.get_state())
    for k in range(6, 12):
        u = unseen(ticks=ticks_of([0.004, 0.0, 0.04], noise=4.0, seed=k), dl_t=np.full(9, 0.001 * k), q_est=Q_HANGING)
        a, b = (vars(r.step(0.1 * k, 0.1, u)) for r in (one, other))
        assert all(np.array_equal(a[name], b[name]) for name in a)


def test_what_cannot_be_is_refused_with_the_reason():
    with pytest.raises(InvalidGraspReflexParameters, match=r"nearest 0.06 m must be less than farthest 0.05 m"):
        GraspReflex(Params(nearest=0.06, farthest=0.05))
    with pytest.raises(InvalidGraspReflexParameters) as caught:
        GraspReflex(Params(b=0.001, sensors_min=7))
    assert len(caught.value.faults) == 2


@pytest.mark.parametrize("name", ["ticks", "grip", "p_WO_meas", "cov_G"])
def test_an_input_that_is_no_number_is_refused_by_its_name(name: str):
    u = seen([0.0, 0.0, 0.05])
    with pytest.raises(InvalidReading, match=f"{name} must be finite"):
        GraspReflex(P).step(0.0, 0.1, replace(u, **{name: getattr(u, name) * np.nan}))
    if name == "p_WO_meas":  # of a ball that is not seen it means nothing
        GraspReflex(P).step(0.0, 0.1, replace(u, seen_O=False, p_WO_meas=np.full(3, np.nan)))


def test_a_belief_that_fits_no_reading_is_given_up():
    """Settled 40 mm off on the axis, of which 2 mm are believed, it finds the ball that the fingers see."""
    f, true = OffsetFilter(model(), P.doubts), np.array([0.003, 0.002, 0.04])
    f.see(np.zeros(3), 0.002**2 * np.eye(3))
    for _ in range(20):
        f.feel(ticks_of(true), R_DOWN, 0.0, 0.1)
    assert np.linalg.norm(R_DOWN @ f.offset - true) < 0.005


def test_measurements_without_covariances_are_taken_for_exact_ones():
    reflex, none = GraspReflex(P), np.zeros((3, 3))
    for k in range(10):
        u = seen([0.0, 0.0, 0.04], cov_O=none, cov_G=-1e-6 * np.eye(3), ticks=ticks_of([0.0, 0.0, 0.04]))
        y = reflex.step(0.1 * k, 0.1, u)
        assert np.linalg.norm(y.p_GO_est - [0.0, 0.0, 0.04]) < 0.002
        assert np.isfinite(y.deviation)
