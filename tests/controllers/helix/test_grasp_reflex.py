"""The reflex of the Helix's gripper: what fingers, cameras and motors each tell of the ball's place, and its limits."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_passed_on
from support.wording import Wording

from handover.controllers.helix.reflex.grasp_reflex import (
    GraspReflex,
    Inputs,
    InvalidGraspReflexParameters,
    InvalidReading,
    Outputs,
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
M = P.model
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


def seen(p_GO: Any, **values: Any) -> Inputs:
    """Return exact measurements of a hanging arm's gripper and a ball at a place in its frame."""
    p_WO = P_WG + R_DOWN @ np.asarray(p_GO, dtype=np.float64)
    exact: dict[str, Any] = {"p_WO_meas": p_WO, "p_WR_meas": P_WG + 0.1 * UP, "p_WG_meas": P_WG, "q_est": Q_HANGING}
    exact |= {"cov_O": KNOWN, "cov_R": KNOWN, "cov_G": KNOWN, "seen_O": True, "seen_R": True}
    return Inputs(**{**exact, **values})


def beside(reported: Floats, true: Any) -> float:
    """Return the distance between two places of the ball in the gripper's frame, across its axis, m."""
    return float(np.hypot(*(reported - np.asarray(true))[:2]))


def reported(y: Outputs) -> Floats:
    return R_DOWN @ (y.p_WO - y.p_WG)


@pytest.mark.parametrize("grip", [0.0, 0.4, 1.0])
def test_the_controller_expects_what_the_plant_s_sensors_read(grip: float):
    for p_GO in ((0.0, 0.0, 0.05), (0.01, -0.004, 0.03), (-0.006, 0.008, 0.0)):
        np.testing.assert_allclose(M.readings(M.beams(grip), np.array(p_GO)), ticks_of(p_GO, grip), atol=1.0)


def test_a_palm_is_expected_by_those_that_look_ahead_alone_as_they_come_near():
    near, far = (M.of_palm(M.beams(0.0), np.array([0.0, 0.0, z]), UP) for z in (0.0, 0.06))
    assert np.all(near[3:] > 50.0)
    assert not np.any(near[:3])
    assert not np.any(far)


@pytest.mark.parametrize("along", [0.05, 0.03, 0.0])
@pytest.mark.parametrize("reflectivity", [0.5, 1.0, 1.6])
def test_the_fingers_find_a_ball_of_any_brightness_beside_the_axis(along: float, reflectivity: float):
    true = np.array([0.008, -0.005, along])
    f = OffsetFilter(M, replace(P, brightness=1.0).doubts)
    f.see(R_DOWN @ np.array([0.0, 0.0, along]), 0.01**2 * np.eye(3))
    for _ in range(20):
        f.feel(ticks_of(true, ball_reflectivity=reflectivity), R_DOWN, 0.0, 0.5)
    assert beside(R_DOWN @ f.offset, true) < 0.004  # 9.4 mm at first
    if along < 0.05:  # farther off, a dark ball and one that is farther read alike
        assert f.reflectivity == pytest.approx(reflectivity, rel=0.3)


def felt(believed: float, deviation: float, true: Any, n: int, dt: float) -> OffsetFilter:
    """Return what n readings of a ball make of a belief that it is so far ahead."""
    f = OffsetFilter(M, P.doubts)
    f.see(R_DOWN @ np.array([0.0, 0.0, believed]), deviation**2 * np.eye(3))
    for _ in range(n):
        f.feel(ticks_of(true), R_DOWN, 0.0, dt)
    return f


def test_errors_that_stay_alike_are_not_averaged_away_and_a_belief_that_fits_no_reading_is_given_up():
    """Twenty readings within the memory tell as much as those of one memory, not of twenty."""
    often, seldom = (felt(0.03, 0.01, [0.0, 0.0, 0.03], n, P.memory / n) for n in (20, 1))
    assert often.deviation == pytest.approx(seldom.deviation, rel=0.1)
    true = np.array([0.003, 0.002, 0.04])  # 40 mm off, of which 2 mm are believed
    assert np.linalg.norm(R_DOWN @ felt(0.0, 0.002, true, 20, 0.1).offset - true) < 0.005


def test_cameras_that_are_off_are_found_out_by_the_fingers():
    reflex, off = GraspReflex(Params(bias=0.01)), np.array([0.006, 0.0, 0.02])
    *_, y = [reflex.step(0.1 * k, 0.1, seen(off, ticks=ticks_of([0.0, 0.0, 0.02]))) for k in range(100)]
    assert y.source is Source.CAMERAS_AND_FINGERS
    assert beside(y.p_GO_est, [0.0] * 3) < 0.002
    assert beside(reported(y), [0.0] * 3) < 0.002
    reflex, none = GraspReflex(P), {"cov_O": np.zeros((3, 3)), "cov_G": -1e-6 * np.eye(3)}
    for k in range(10):  # without covariances they are taken for exact ones
        y = reflex.step(0.1 * k, 0.1, seen([0.0, 0.0, 0.04], **none, ticks=ticks_of([0.0, 0.0, 0.04])))
        assert np.linalg.norm(y.p_GO_est - [0.0, 0.0, 0.04]) < 0.002
        assert np.isfinite(y.deviation)


def test_without_fingers_measurements_go_through_as_they_are():
    reflex = GraspReflex(Params(feels=False))
    for k in range(10):
        u = seen([0.01, 0.0, 0.04], ticks=ticks_of([0.0, 0.0, 0.04]))
        y = reflex.step(0.1 * k, 0.1, u)
        assert y.source is Source.CAMERAS
        np.testing.assert_array_equal(y.p_WO, u.p_WO_meas)
        np.testing.assert_array_equal(y.p_WG, u.p_WG_meas)
        np.testing.assert_array_equal(y.P_O, u.cov_O)


def test_far_from_the_ball_or_too_long_after_what_is_not_seen_is_not_reported():
    reflex = GraspReflex(P)
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.2]))
    y = reflex.step(0.1, 0.1, Inputs())
    assert (y.known_O, y.known_R, y.source) == (False, False, Source.NONE)
    y = reflex.step(0.2, 0.1, seen([0.0, 0.0, 0.2], seen_O=False))
    assert (y.known_O, y.known_R) == (False, True)
    reflex = GraspReflex(Params(feels=False))
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03]))
    known = [reflex.step(0.1 * k, 0.1, Inputs()).known_O for k in range(1, 1000)]
    assert (known[0], known[-1]) == (True, False)
    assert known == sorted(known, reverse=True)


def test_covered_cameras_are_bridged_by_what_the_motors_do():
    """Shortened by as much in all segments, a hanging arm's gripper rises by it, and the ball stays where it is."""
    reflex, shorter = GraspReflex(Params(feels=False)), Q_HANGING - 0.002 * (np.arange(9) % 3 == 2)
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03]))
    dl_t = tendon_lengths(shorter, P.d_tendon) - tendon_lengths(Q_HANGING, P.d_tendon)
    rise = (W_FROM_B * (forward_kinematics(shorter, 0.1) - forward_kinematics(Q_HANGING, 0.1)))[3:]
    *_, y = [reflex.step(0.1 * k, 0.1, Inputs(dl_t=dl_t, q_est=Q_HANGING)) for k in range(1, 31)]
    assert (y.source, y.known_O, y.known_R) == (Source.MOTORS, True, True)
    np.testing.assert_allclose(y.p_WG, P_WG + rise, atol=1e-6)
    np.testing.assert_allclose(y.p_WO, P_WG - 0.03 * UP, atol=1e-6)
    np.testing.assert_allclose(y.p_WR - y.p_WG, 0.1 * UP, atol=1e-6)
    reflex, q = GraspReflex(Params(feels=False)), np.array([0.1, 0.0, 0.12, 0.3, 0.1, 0.24, 0.4, -0.2, 0.24])
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03], q_est=q))
    for k in range(1, 20):  # it keeps its distance from the wrist, as the servo has it
        dl_t = tendon_lengths(q - 0.001 * k, P.d_tendon) - tendon_lengths(q, P.d_tendon)
        y = reflex.step(0.1 * k, 0.1, Inputs(dl_t=dl_t, q_est=q))
        assert np.linalg.norm(y.p_WG - y.p_WR) == pytest.approx(P.d_gripper, abs=1e-12)


def test_a_hidden_ball_is_left_in_its_place_by_a_gripper_that_is_seen_to_move():
    """What the motors were asked counts for nothing where the ring is in view."""
    reflex = GraspReflex(Params(feels=False))
    reflex.step(0.0, 0.1, seen([0.0, 0.0, 0.03]))
    for k in range(1, 20):
        places = {"p_WG_meas": P_WG + 0.001 * k * UP, "p_WR_meas": P_WG + (0.1 + 0.001 * k) * UP}
        y = reflex.step(0.1 * k, 0.1, seen([0.0] * 3, seen_O=False, **places, dl_t=np.full(9, 0.01 * k)))
        np.testing.assert_allclose(y.p_WO, P_WG - 0.03 * UP, atol=1e-9)
        np.testing.assert_array_equal(y.p_WG, places["p_WG_meas"])


def test_covered_cameras_and_an_arm_that_slipped_leave_it_to_the_fingers():
    true = np.array([0.012, 0.004, 0.03])  # seen on the axis last
    reflex, blind, doubtful = GraspReflex(P), GraspReflex(Params(feels=False)), GraspReflex(P)
    for each in (reflex, blind, doubtful):
        each.step(0.0, 0.1, seen([0.0, 0.0, 0.03]))
    u = Inputs(ticks=ticks_of(true, palm=True), q_est=Q_HANGING)
    *_, y = [reflex.step(0.1 * k, 0.1, u) for k in range(1, 60)]
    assert (y.source, y.sensors) == (Source.MOTORS_AND_FINGERS, 6)
    assert beside(reported(y), true) < 0.003
    assert beside(reported(blind.step(0.1, 0.1, u)), [0.0] * 3) < 1e-6
    y = doubtful.step(0.1, 0.1, Inputs(ticks=np.array([0.0, 0.0, 0.0, 400.0, 0.0, 0.0])))
    assert (y.source, y.sensors) == (Source.MOTORS, 1)  # one reading alone is not taken in


def test_a_restored_state_continues_bit_for_bit():
    moved = [{"dl_t": np.full(9, 0.001 * k)} for k in range(12)]
    given = [seen([0.002 * k, 0.0, 0.05], ticks=ticks_of([0.0, 0.0, 0.05]), **moved[k]) for k in range(6)]
    noisy = [ticks_of([0.004, 0.0, 0.04], noise=4.0, seed=k) for k in range(6, 12)]
    given += [Inputs(ticks=ticks, q_est=Q_HANGING, **m) for ticks, m in zip(noisy, moved[6:], strict=True)]
    assert_passed_on(lambda: GraspReflex(P), given, 1, 0.1)


def test_what_cannot_be_is_refused_with_the_reason(wording: Wording):
    for bad in (Params(nearest=0.06, farthest=0.05), Params(b=0.001, sensors_min=7)):
        with pytest.raises(InvalidGraspReflexParameters) as caught:
            GraspReflex(bad)
        wording.check("\n".join(caught.value.faults))
    u = seen([0.0, 0.0, 0.05])
    for name in ("ticks", "grip", "p_WO_meas", "cov_G"):
        with pytest.raises(InvalidReading) as refused:
            GraspReflex(P).step(0.0, 0.1, replace(u, **{name: getattr(u, name) * np.nan}))
        wording.check(refused.value)
    GraspReflex(P).step(0.0, 0.1, replace(u, seen_O=False, p_WO_meas=np.full(3, np.nan)))  # of which nothing is seen
