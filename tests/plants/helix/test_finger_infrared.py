"""Infrared sensors in the gripper's fingers: closed forms of what they read, symmetry, noise, states, refusals."""

from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_continues
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.helix.finger_infrared import FingerInfrared, Inputs, InvalidInfraredParameters, Params, beams

DOWN = np.array([0.0, 1.0, 0.0, 0.0])
R_DOWN = np.diag([1.0, -1.0, -1.0])
P_WG = np.array([0.1, 0.05, -0.6])
FAR = np.array([0.0, 0.0, -5.0])
IDEAL: dict[str, Any] = {"tolerance": 0.0, "range_tolerance": 0.0, "mounting_tolerance": 0.0}
P = Params()
NEAR = Inputs(p_WG=P_WG, q_WG=DOWN, p_WO=P_WG, p_WH=FAR)


def read(p_GO: Any, p_GH: Any = FAR, grip: float = 0.0, **values: Any) -> Floats:
    """Return ideal sensors' readings of a ball and a palm at places in a gripper's frame that points down."""
    settings: dict[str, Any] = {**IDEAL, "noise": 0.0, **values}
    unit = FingerInfrared(Params(**settings))
    ball, palm = (P_WG + R_DOWN @ np.asarray(p, dtype=np.float64) for p in (p_GO, p_GH))
    return unit.outputs(0.0, Inputs(p_WG=P_WG, q_WG=DOWN, grip=grip, p_WO=ball, p_WH=palm)).ticks


def test_a_ray_that_meets_the_ball_reads_the_characteristic_times_the_cosine():
    window, rays = beams(np.zeros(3), np.eye(3), 0.0, (P.across, P.ahead), 0.0)
    for sensor in range(6):
        for gap in (0.006, 0.05):
            ball = window[sensor, 0] + (gap + P.ball_radius) * rays[sensor, 0]
            assert read(ball, beam=0.0)[sensor] == round(P.sensor().ticks(gap, 1.0, 1.0))
    across = np.cross(rays[0, 0], [0.0, 0.0, 1.0])
    slanting = window[0, 0] + (0.02 + 0.8 * P.ball_radius) * rays[0, 0] + 0.6 * P.ball_radius * across
    assert read(slanting, beam=0.0)[0] == pytest.approx(0.8 * P.sensor().ticks(0.02, 1.0, 1.0), abs=0.6)


def test_open_fingers_look_across_to_the_axis_and_forty_degrees_ahead():
    _, rays = beams(np.zeros(3), np.eye(3), 0.0, (P.across, P.ahead), 0.0)
    assert np.arcsin(rays[:3, 0, 2]) == pytest.approx(0.0, abs=0.01)
    assert np.degrees(np.arcsin(rays[3:, 0, 2])) == pytest.approx(40.0, abs=0.5)


def test_on_the_axis_all_fingers_read_the_same_and_beside_it_the_nearer_one_more():
    for along in (0.0, 0.05):
        readings = read([0.0, 0.0, along])
        assert readings[:3] == pytest.approx(readings[0], abs=1.0)
        assert readings[3:] == pytest.approx(readings[3], abs=1.0)
    readings = read(0.008 * np.array([np.cos(np.pi / 3), np.sin(np.pi / 3), 0.0]))  # towards the first finger
    assert readings[0] > 1.3 * readings[1]
    assert readings[1] == pytest.approx(readings[2], abs=1.0)


def test_those_that_look_ahead_see_the_ball_first_and_beyond_the_range_none_does():
    assert not np.any(read([0.0, 0.0, 0.1]))
    first = read([0.0, 0.0, 0.06])
    assert not np.any(first[:3])
    assert np.all(first[3:] > 50.0)
    readings = [read([0.0, 0.0, 0.0], grip=g)[0] for g in (0.0, 0.5, 1.0)]
    assert 400.0 < readings[0] < readings[1] < readings[2]  # a closed finger is nearer
    assert readings[2] > 2.0 * readings[0]


def test_a_palm_is_seen_where_no_ball_hides_it():
    no_ball = [0.0, 0.0, -5.0]
    assert not np.any(read(no_ball))
    seen = read(no_ball, [0.0, 0.0, 0.04])
    assert np.all(seen[:3] < 10.0)
    assert np.all(seen[3:] > 50.0)
    assert not np.any(read(no_ball, [0.0, 0.0, 0.04], palm_radius=0.005))
    np.testing.assert_allclose(read(no_ball, [0.0, 0.0, 0.04], palm_reflectivity=0.3), 0.5 * seen, atol=1.0)


def test_reflectivity_and_gain_scale_a_reading():
    usual = read([0.0, 0.0, 0.0])
    np.testing.assert_allclose(read([0.0, 0.0, 0.0], ball_reflectivity=0.5), 0.5 * usual, atol=1.0)
    gains = np.array([read([0.0, 0.0, 0.0], tolerance=0.1, seed=k)[:3] / usual[:3] for k in range(100)])
    assert np.std(gains) == pytest.approx(0.1, abs=0.012)
    assert np.mean(gains) == pytest.approx(1.0, abs=0.02)


def test_a_sensor_of_more_range_reads_from_farther_what_the_characteristic_says():
    window, rays = beams(np.zeros(3), np.eye(3), 0.0, (P.across, P.ahead), 0.0)
    ball, sensor = window[0, 0] + (0.02 + P.ball_radius) * rays[0, 0], P.sensor()
    ranges = [0.02 / sensor.distance(read(ball, beam=0.0, range_tolerance=0.1, seed=k)[0]) for k in range(100)]
    assert np.std(ranges) == pytest.approx(0.1, abs=0.02)
    assert np.mean(ranges) == pytest.approx(1.0, abs=0.03)


def test_a_beam_that_is_mounted_askew_is_turned_along_the_finger_and_to_its_side():
    _, straight = beams(np.zeros(3), np.eye(3), 0.0, (P.across, P.ahead), 0.2)
    turned = np.zeros((6, 2))
    turned[1], turned[3] = (0.1, 0.0), (0.0, 0.1)
    _, askew = beams(np.zeros(3), np.eye(3), 0.0, (P.across, P.ahead), 0.2, turned)
    angles = np.arccos(np.clip(np.sum(straight[:, 0] * askew[:, 0], axis=1), -1.0, 1.0))
    np.testing.assert_allclose(angles, [0.0, 0.1, 0.0, 0.1, 0.0, 0.0], atol=1e-7)
    assert askew[1, 0] @ straight[4, 0] > straight[1, 0] @ straight[4, 0]  # towards the tip, where the other looks
    assert askew[3, 0] @ straight[0, 0] < straight[3, 0] @ straight[0, 0]
    np.testing.assert_allclose(np.linalg.norm(askew, axis=2), 1.0)
    np.testing.assert_allclose(askew @ np.swapaxes(askew, 1, 2), straight @ np.swapaxes(straight, 1, 2), atol=1e-12)


def test_each_sensor_is_mounted_its_own_way_by_the_seed():
    usual = read([0.005, 0.0, 0.02])
    askew = [read([0.005, 0.0, 0.02], mounting_tolerance=0.1, seed=k) for k in range(3)]
    assert all(np.count_nonzero(a != usual) >= 5 for a in askew)
    assert not np.array_equal(askew[0], askew[1])
    np.testing.assert_array_equal(askew[2], read([0.005, 0.0, 0.02], mounting_tolerance=0.1, seed=2))


def test_readings_are_whole_numbers_with_the_noise_that_is_set():
    unit = FingerInfrared(Params(noise=6.0, **IDEAL))
    readings = np.array([unit.step(0.03 * k, 0.03, NEAR).ticks[0] for k in range(250)])
    assert np.array_equal(readings, np.rint(readings))
    assert np.std(readings) == pytest.approx(6.0, rel=0.15)
    assert np.mean(readings) == pytest.approx(read([0.0, 0.0, 0.0])[0], abs=1.5)


def test_a_restored_state_continues_bit_for_bit():
    assert_continues(lambda: FingerInfrared(Params(seed=5)), lambda _: NEAR, [1], 5, 0.03)


def test_what_cannot_be_is_refused_with_the_reason(wording: Wording):
    false: list[dict[str, Any]] = [{"b": 0.001}, {"a": 0.001}, {"beam": 2.0, "tolerance": -0.1}]
    for changes in false:
        with pytest.raises(InvalidInfraredParameters) as caught:
            FingerInfrared(Params(**changes))
        wording.check(caught.value)
