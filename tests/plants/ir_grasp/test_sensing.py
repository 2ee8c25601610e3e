"""What disturbs readings and encoders: tolerances, ambient light, cross-talk, gloss, faces, fingers, other objects."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support.restored_states import assert_continues
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.actuation import PULLEYS, STIFFNESS
from handover.plants.ir_grasp.hand import sensor_rays
from handover.plants.ir_grasp.objects import Thing
from handover.plants.ir_grasp.parameters import InvalidSceneParameters, Params
from handover.plants.ir_grasp.scene import GraspScene, Inputs, Outputs

STEP = 0.015
QUIET = Params(p_WH_0=np.array([-0.13, 0.0]), sigma_0=0.12, noise=0.0)
SQUARE = replace(QUIET, beam=0.0, thing=Thing.PAPER_BOX_A, sigma_0=0.15)
"""The box's sides lie along x; each beam is one ray."""

TENTH = (0.1, -0.1, 0.1, -0.1)
"""Changes of a, b, c, d that make a reading rise."""


def first(p: Params) -> Outputs:
    return GraspScene(p).outputs(0.0, Inputs())


def ticks(p: Params, **changes: Any) -> Floats:
    return first(replace(p, **changes)).ticks


def course(p: Params, seconds: float) -> list[Outputs]:
    scene = GraspScene(p)
    u = Inputs(p_WH_cmd=p.p_WH_0, sigma_cmd=p.sigma_0)
    return [scene.step(k * STEP, STEP, u) for k in range(round(seconds / STEP))]


def test_each_finger_has_its_own_constants():
    p = replace(QUIET, a_scale=np.array([1.2, 1.0, 1.0]), d_scale=np.array([1.0, 1.0, 0.8]))
    usual, off = first(QUIET), first(p)
    assert off.ticks[1] == usual.ticks[1]
    assert off.ticks[0] > usual.ticks[0] + 10
    assert off.ticks[2] > usual.ticks[2] + 10
    np.testing.assert_array_equal(off.range, usual.range)


@pytest.mark.parametrize("closure", [0.6, 0.9])
def test_a_hand_sees_its_own_fingers_and_palm_alike_however_it_is_turned(closure: float):
    p = replace(QUIET, p_WO_0=np.array([0.45, 0.35]), p_WH_0=np.array([-0.2, 0.05]), sigma_0=closure)
    alone = ticks(p, fingers_seen=True)
    assert np.max(alone) > 200
    for yaw in (0.9, -2.0):
        np.testing.assert_allclose(ticks(p, fingers_seen=True, yaw_H_0=yaw), alone, atol=1.0)


def test_tolerances_are_drawn_by_the_seed_within_their_size():
    p = replace(QUIET, sensor_tolerance=0.1)
    usual, off = ticks(QUIET), np.array([ticks(p, seed=s) for s in range(12)])
    assert np.all(off[0] == ticks(p, seed=0))
    assert len({tuple(row) for row in off.tolist()}) == 12
    assert np.all(np.std(off, axis=0) > 5.0)
    # a reading is off at most as if all constants were off by a tenth the same way
    low, high = (
        ticks(QUIET, **{f"{name}_scale": np.full(3, 1.0 + sign * by) for name, by in zip("abcd", TENTH, strict=True)})
        for sign in (-1.0, 1.0)
    )
    assert np.all((low - 1.0 <= off) & (off <= high + 1.0))
    assert np.all(low < usual)
    assert np.all(usual < high)


def test_a_sensor_whose_curve_does_not_reach_so_near_saturates():
    p = replace(QUIET, c_scale=np.full(3, 5.0), reflectivity=1.0, beam=0.0)
    assert np.max(ticks(p)) > 3000
    assert np.max(ticks(p, p_WH_0=np.array([-0.11, 0.0]), reflectivity=2.0)) == 4095


def test_constants_that_are_not_monotonic_are_refused_by_finger(wording: Wording):
    falling = replace(QUIET, a=-0.001, c=0.0665, d=-0.00069)
    GraspScene(falling)  # one that falls although a is below 0
    index = np.array([1.0, 5.0, 1.0])
    rising = replace(QUIET, d=0.00043), replace(QUIET, a=-0.02, c=0.1), replace(falling, a_scale=index, b_scale=index)
    for p in rising:
        with pytest.raises(InvalidSceneParameters) as refused:
            GraspScene(p)
        wording.check(refused.value)


def test_ambient_light_adds_crosstalk_too_if_several_are_active_and_a_face_has_its_own_reflectivity():
    own = ticks(SQUARE)
    np.testing.assert_array_equal(ticks(SQUARE, ambient=120.0), own + 120.0)
    np.testing.assert_array_equal(ticks(SQUARE, crosstalk=0.5), own)
    all_active = ticks(SQUARE, active=3, crosstalk=0.2)
    np.testing.assert_allclose(all_active, own + 0.2 * (own.sum() - own), atol=0.8)
    faces = np.array([0.5, 1.0, 0.25, 1.0, 1.0, 1.0, 1.0, 1.0])  # at -y, where the thumb looks, and at y
    np.testing.assert_allclose(ticks(SQUARE, face_reflectivity=faces), own * [0.5, 0.25, 0.25], atol=0.8)


def test_sensors_that_are_active_together_are_read_together():
    for active, found in ((2, [[0, 1], [0, 2], [1, 2]]), (3, [[0, 1, 2]] * 3)):
        scene = GraspScene(replace(QUIET, noise=200.0, active=active))
        u = Inputs(p_WH_cmd=QUIET.p_WH_0, sigma_cmd=QUIET.sigma_0)
        read = [scene.outputs(0.0, u).ticks, *(scene.step(k * 5e-3, 5e-3, u).ticks for k in range(3))]
        assert [np.flatnonzero(b != a).tolist() for a, b in pairwise(read)] == found


def test_a_glossy_object_is_brighter_where_it_is_met_squarely_and_darker_aslant():
    y = first(SQUARE)
    _, directions = sensor_rays(y.p_WH, y.yaw, y.q)
    cosines = np.abs(directions[:, 1])
    assert np.min(cosines) < 0.98
    brightness = np.array([SQUARE.sensor().ticks(d, 1.0, 1.0) for d in y.range])
    wanted = brightness * (0.1 * cosines + 0.9 * (2.0 * cosines**2 - 1.0) ** 40.0)
    np.testing.assert_allclose(ticks(SQUARE, gloss=0.9, gloss_exponent=40.0), wanted, atol=0.51)
    assert SQUARE.sensor().ticks(0.02, 1.0, 1.0, 0.9, 40.0) == pytest.approx(SQUARE.sensor().ticks(0.02, 1.0, 1.0))
    assert SQUARE.sensor().ticks(0.02, 0.3, 1.0, 1.0, 40.0) == 0.0


def test_fingers_that_are_seen_stand_in_each_others_light():
    away = replace(QUIET, p_WO_0=np.array([0.3, 0.0]), sigma_0=0.45)  # the closing fingers look at each other
    assert np.all(ticks(away) == 0.0)
    seen = ticks(away, fingers_seen=True)
    assert np.max(seen) > 100
    np.testing.assert_allclose(ticks(away, fingers_seen=True, finger_reflectivity=1.0), 2.0 * seen, atol=1.5)
    np.testing.assert_array_equal(ticks(away, fingers_seen=True, finger_reflectivity=0.0), np.zeros(3))
    np.testing.assert_array_equal(ticks(QUIET, fingers_seen=True), ticks(QUIET))  # nothing between pads and object


def test_a_second_object_is_seen_and_hides_the_first():
    alone = replace(QUIET, p_WO_0=np.array([0.3, 0.0]), other_radius=0.033, other_reflectivity=0.9)
    np.testing.assert_array_equal(ticks(alone, p_WX_0=np.zeros(2)), ticks(QUIET))
    usual = first(SQUARE)
    origins, directions = sensor_rays(usual.p_WH, usual.yaw, usual.q)
    between = origins[0] + 0.5 * usual.range[0] * directions[0]
    before = replace(SQUARE, other_radius=0.3 * float(usual.range[0]), other_reflectivity=0.0, p_WX_0=between)
    hidden = first(before)
    assert usual.ticks[0] > 100
    assert hidden.ticks[0] == 0.0
    bright = replace(before, other_reflectivity=1.0)
    assert first(bright).ticks[0] == round(SQUARE.sensor().ticks(0.2 * float(usual.range[0]), 1.0, 1.0))
    np.testing.assert_array_equal(hidden.ticks[1:], usual.ticks[1:])
    np.testing.assert_array_equal(hidden.range, usual.range)  # of the object, whatever hides it


def test_sensors_have_noise_of_their_own_and_the_truth_has_none():
    alone = replace(QUIET, wrist_noise=1e-3, noise=3.0, ambient_noise=4.0, mass_O=5.0)
    p = replace(alone, heading_noise=0.02, closure_noise=0.01, joint_noise=0.02, tension_noise=0.3)
    ys = course(p, 6.0)
    off = [(y.p_WH_meas - y.p_WH, y.yaw_meas - y.yaw, y.sigma_meas - y.sigma, y.q_meas - y.q) for y in ys]
    errors = np.array([np.hstack([*o, y.tension_meas - y.tension]) for o, y in zip(off, ys, strict=True)])
    deviations = [1e-3, 1e-3, 0.02, 0.01, *[0.02] * 8, 0.3]
    np.testing.assert_allclose(np.std(errors, axis=0), deviations, rtol=0.14)
    np.testing.assert_array_less(np.abs(np.mean(errors, axis=0)), 0.18 * np.array(deviations))
    shares = errors / np.std(errors, axis=0)
    assert np.max(np.abs(shares.T @ shares / len(ys) - np.eye(13))) < 0.22
    np.testing.assert_allclose(np.std([y.ticks for y in ys], axis=0), 5.0, rtol=0.12)
    for y, z in zip(ys, course(alone, 1.0), strict=False):
        for name in ("ticks", "p_WH_meas", "q"):  # no other random numbers for what both have
            np.testing.assert_array_equal(getattr(y, name), getattr(z, name))
        np.testing.assert_array_equal(z.q_meas, z.q)
        assert (z.yaw_meas, z.sigma_meas, z.tension_meas) == (z.yaw, z.sigma, z.tension)
    for z in course(replace(QUIET, mass_O=5.0), 0.15):
        np.testing.assert_array_equal(z.p_WH_meas, z.p_WH)


def test_joints_are_off_their_design_by_a_tolerance_drawn_once():
    p = replace(QUIET, stiffness_tolerance=0.3, seed=3)
    off = p.joint_stiffness / STIFFNESS - 1.0
    assert 0.15 < np.max(np.abs(off)) <= 0.3
    np.testing.assert_array_equal(p.joint_stiffness, replace(p, noise=9.0).joint_stiffness)
    assert np.any(p.joint_stiffness != replace(p, seed=4).joint_stiffness)
    np.testing.assert_array_equal(replace(p, stiffness_tolerance=0.0).joint_stiffness, STIFFNESS)
    y = course(replace(p, p_WO_0=np.array([0.5, 0.3])), 1.5)[-1]  # at rest, in free space
    np.testing.assert_allclose(p.joint_stiffness * y.q, PULLEYS * y.tension, atol=2e-4)


def test_a_state_with_all_that_moves_and_disturbs_is_complete():
    noises: dict[str, Any] = {"noise": 5.0, "ambient_noise": 3.0, "wrist_noise": 1e-3, "heading_noise": 0.01}
    noises |= {"closure_noise": 0.01, "joint_noise": 0.01, "tension_noise": 0.1, "stiffness_tolerance": 0.02}
    p = replace(QUIET, thing=Thing.BAR, bar_size=np.array([0.03, 0.11]), ambient=40.0, active=2, **noises)
    p = replace(p, p_WH_0=np.array([-0.27, 0.0]), other_radius=0.02, p_WX_0=np.array([0.0, 0.085]))
    p = replace(p, carry_velocity=np.array([-0.01, 0.02]), carry_until=1.5, nudge=np.array([0.0, 0.02]), nudge_time=0.9)
    p = replace(p, fingers_seen=True, sensor_tolerance=0.1)

    def command(k: int) -> Inputs:
        return Inputs(p_WH_cmd=np.array([-0.27 + 0.002 * min(k, 70), 0.0]), sigma_cmd=min(1.0, 0.01 * k))

    scene = GraspScene(p)
    end = [scene.step(k * STEP, STEP, command(k)) for k in range(137)][-1]
    assert np.linalg.norm(end.p_WX - p.p_WX_0) > 1e-3
    assert_continues(lambda: GraspScene(p), command, [30, 77], 60, STEP)


def test_by_default_a_reading_is_the_sensors_law_and_one_random_number():
    p = replace(QUIET, noise=4.0, seed=9, mass_O=5.0)
    y = first(replace(p, noise=0.0))
    origins, directions = sensor_rays(y.p_WH, y.yaw, y.q)
    x = np.zeros(3)
    for i, (o, looks) in enumerate(zip(origins, directions, strict=True)):
        for angle in (0.0, -p.beam, p.beam):
            c, s = np.cos(angle), np.sin(angle)
            d = (float(c * looks[0] - s * looks[1]), float(s * looks[0] + c * looks[1]))
            hit = p.solid.intersect(float(o[0]), float(o[1]), *d)  # O is W here
            if hit is not None:
                x[i] += p.sensor().ticks(hit.distance, hit.cosine, 0.9) / 3.0
    rng = np.random.default_rng(9)
    wanted = [x + 4.0 * rng.standard_normal(3) for _ in range(201)]  # three at the start, three a step of 15 ms
    found = [first(p).ticks, *(z.ticks for z in course(p, 3.0))]
    off = np.abs(np.array(found) - np.array(wanted))
    assert np.max(off) < 0.6  # rounding, and joints that give by some micrometres
    assert np.min(x) > 50.0
