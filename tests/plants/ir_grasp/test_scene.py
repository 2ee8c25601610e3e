import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from handover.cosim.blocks.description import describe
from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.actuation import PULLEYS, STIFFNESS, resting_posture
from handover.plants.ir_grasp.hand import FINGERS, JOINTS, finger_points, sensor_rays
from handover.plants.ir_grasp.objects import SOLIDS, Thing
from handover.plants.ir_grasp.parameters import OUT_OF_RANGE, InvalidSceneParameters, Params
from handover.plants.ir_grasp.scene import GraspScene, Inputs, InvalidCommand, Outputs, StepSizeError
from handover.plants.ir_grasp.world import DT, GraspWorld, initial_snapshot

STEP = 0.015
AROUND = Params(p_WH_0=np.array([-0.13, 0.0]), sigma_0=0.1)
"""The object between the fingers, seen by all three sensors."""
FIXED = replace(AROUND, mass_O=5.0, table_friction=2.0)
"""The object as good as fixed to the table."""


def inputs(x: float = -0.13, y: float = 0.0, yaw: float = 0.0, sigma: float = 0.1) -> Inputs:
    return Inputs(p_WH_cmd=np.array([x, y]), yaw_cmd=yaw, sigma_cmd=sigma)


def walk(scene: GraspScene, u: Inputs, seconds: float, dt: float = STEP) -> list[Outputs]:
    return [scene.step(i * dt, dt, u) for i in range(round(seconds / dt))]


def test_starts_at_rest_where_the_parameters_say():
    p = replace(AROUND, p_WO_0=np.array([0.01, 0.02]), yaw_O_0=0.3, thing=Thing.PAPER_BOX_B, yaw_H_0=0.1)
    scene = GraspScene(p)
    first = scene.outputs(0.0, Inputs())
    np.testing.assert_array_equal(first.p_WH, p.p_WH_0)
    np.testing.assert_array_equal(first.p_WO, p.p_WO_0)
    assert (first.yaw, first.sigma, first.touching) == (0.1, 0.1, 0)
    assert first.yaw_O == pytest.approx(0.3 + math.pi / 2.0)
    np.testing.assert_allclose(first.q, resting_posture(0.1, 400.0, 0.094), atol=1e-12)
    later = walk(scene, inputs(yaw=0.1), 0.3)[-1]
    np.testing.assert_allclose(later.q, first.q, atol=1e-6)
    np.testing.assert_array_equal(later.p_WO, first.p_WO)


def test_outputs_are_of_the_declared_shapes_and_take_no_time():
    scene = GraspScene(AROUND)
    y = scene.outputs(0.0, Inputs())
    for v in describe(GraspScene).outputs:
        assert np.shape(getattr(y, v.name)) == v.shape
    again = scene.outputs(0.0, Inputs(sigma_cmd=1.0))
    np.testing.assert_array_equal(again.ticks, y.ticks)
    np.testing.assert_array_equal(again.range, y.range)


def test_pictures_show_the_hand_where_the_physics_has_it():
    world = GraspWorld(AROUND, initial_snapshot(AROUND))
    for k in range(1800):
        world.advance((-0.11 - 7e-5 * k, 0.01 * math.sin(0.007 * k), 2e-4 * k, 1.0))
    _, (_, _, *phalanges), _ = world.snapshot
    x, y, yaw = world.wrist
    points = finger_points(np.array([x, y]), yaw, np.array(world.joints))
    middles = [(a + b) / 2.0 for finger in points for a, b in pairwise(finger)]
    assert world.touching > 0
    np.testing.assert_allclose(middles, [m[:2] for m in phalanges], atol=1e-3)  # joints give by some 0.1 mm


@pytest.mark.parametrize("thing", SOLIDS)
@pytest.mark.parametrize("aside", [-0.01, 0.004])
def test_range_is_where_the_sensors_ray_meets_the_object(thing: Thing, aside: float):
    p = replace(AROUND, thing=thing, p_WO_0=np.array([0.0, aside]), sigma_0=0.05)
    y = GraspScene(p).outputs(0.0, Inputs())
    origins, directions = sensor_rays(y.p_WH, y.yaw, y.q)
    c, s = math.cos(y.yaw_O), math.sin(y.yaw_O)
    for o, d, value in zip(origins, directions, y.range, strict=True):
        x_O, y_O = np.array([[c, s], [-s, c]]) @ (o - y.p_WO)
        d_x, d_y = np.array([[c, s], [-s, c]]) @ d
        met = SOLIDS[thing].intersect(x_O, y_O, d_x, d_y)
        assert value == pytest.approx(met[0] if met else OUT_OF_RANGE, abs=1e-9)


def test_noise_free_readings_of_a_narrow_beam_follow_range_and_incidence():
    p = replace(AROUND, noise=0.0, beam=0.0, thing=Thing.PAPER_BOX_A, sigma_0=0.12)
    y = GraspScene(p).outputs(0.0, Inputs())
    _, directions = sensor_rays(y.p_WH, y.yaw, y.q)
    cosines = np.abs(directions[:, 1])  # the box's sides lie along x
    wanted = [p.sensor().ticks(d, c, 1.0) for d, c in zip(y.range, cosines, strict=True)]
    np.testing.assert_array_equal(y.ticks, np.round(wanted))
    assert np.max(y.range) < 0.06


def test_a_beam_half_beside_the_object_reads_less():
    def thumb(beam: float) -> float:
        p = replace(AROUND, noise=0.0, thing=Thing.PAPER_BOX_A, p_WH_0=np.array([-0.158, 0.0]), beam=beam)
        return float(GraspScene(p).outputs(0.0, Inputs()).ticks[0])

    assert 0.6 * thumb(0.0) < thumb(0.15) < 0.75 * thumb(0.0)  # one ray of three misses


def test_reflectivity_scales_the_readings():
    def ticks(reflectivity: float) -> Floats:
        return GraspScene(replace(AROUND, noise=0.0, reflectivity=reflectivity)).outputs(0.0, Inputs()).ticks

    np.testing.assert_allclose(ticks(0.5), ticks(1.0) / 2.0, atol=1.0)
    np.testing.assert_array_equal(ticks(0.0), ticks(SOLIDS[Thing.CYLINDER].reflectivity))


def test_noise_is_as_large_as_declared():
    scene = GraspScene(replace(FIXED, noise=4.0, seed=3))
    x = np.array([y.ticks for y in walk(scene, inputs(), 9.0)])
    np.testing.assert_allclose(np.std(x, axis=0), 4.0, rtol=0.1)
    assert abs(np.corrcoef(x[:, 0], x[:, 1])[0, 1]) < 0.1


def test_one_sensor_is_read_every_5_ms_thumb_index_ring():
    scene = GraspScene(replace(AROUND, noise=30.0))
    last = scene.outputs(0.0, Inputs()).ticks
    changed: list[tuple[int, int]] = []
    for k in range(1, 46):
        ticks = scene.step((k - 1) * 1e-3, 1e-3, inputs()).ticks
        changed.extend((k, int(i)) for i in np.flatnonzero(ticks != last))
        last = ticks
    assert changed == [(5 * n, (n - 1) % 3) for n in range(1, 10)]


def test_steps_of_any_size_make_the_same_course():
    def end(dt: float) -> Outputs:
        return walk(GraspScene(AROUND), inputs(sigma=0.9), 0.72, dt)[-1]

    one, other = end(0.015), end(0.008)
    np.testing.assert_array_equal(one.q, other.q)
    np.testing.assert_array_equal(one.p_WO, other.p_WO)
    np.testing.assert_array_equal(one.ticks, other.ticks)
    assert one.touching > 0


@pytest.mark.parametrize("dt", [0.0004, 0.0155, -0.015])
def test_a_step_that_is_no_multiple_of_a_millisecond_is_refused(dt: float):
    with pytest.raises(StepSizeError, match=r"no multiple of the internal step 0\.001 s"):
        GraspScene(AROUND).step(0.0, dt, inputs())


def test_a_command_that_is_no_number_is_refused_and_leaves_no_trace():
    scene, other = GraspScene(AROUND), GraspScene(AROUND)
    with pytest.raises(InvalidCommand) as refused:
        scene.step(0.0, STEP, inputs(x=math.nan, sigma=math.inf))
    assert [fault.split()[0] for fault in refused.value.faults] == ["p_WH_cmd", "sigma_cmd"]
    with pytest.raises(InvalidCommand, match="yaw_cmd"):
        scene.step(0.0, STEP, inputs(yaw=-math.inf))
    assert scene.get_state() == other.get_state()


def test_wrist_and_closure_obey_their_limits_and_arrive():
    scene = GraspScene(replace(AROUND, p_WH_0=np.array([-0.4, 0.0])))
    ys = [scene.outputs(0.0, Inputs()), *walk(scene, inputs(-0.3, 0.1, 0.8, 0.5), 1.2, 0.005)]
    p = np.array([y.p_WH for y in ys])
    v, rate = np.diff(p, axis=0) / 0.005, np.diff([y.yaw for y in ys]) / 0.005
    assert np.max(np.linalg.norm(v, axis=1)) == pytest.approx(0.3, rel=1e-6)
    assert np.max(rate) == pytest.approx(1.5, rel=1e-6)
    assert np.max(np.linalg.norm(np.diff(v, axis=0), axis=1)) / 0.005 <= 10.0 * 1.001
    np.testing.assert_allclose(np.diff([y.sigma for y in ys])[:80] / 0.005, 1.0)
    np.testing.assert_allclose(ys[-1].p_WH, [-0.3, 0.1], atol=1e-9)
    assert (ys[-1].yaw, ys[-1].sigma) == pytest.approx((0.8, 0.5), abs=1e-9)


def test_free_hand_comes_to_rest_where_tendon_and_springs_balance():
    scene = GraspScene(replace(AROUND, p_WH_0=np.array([-0.5, 0.0])))
    y = walk(scene, inputs(-0.5, sigma=0.6), 4.0)[-1]
    np.testing.assert_allclose(y.q, resting_posture(0.6, 400.0, 0.094), atol=1e-4)
    np.testing.assert_allclose(STIFFNESS * y.q, PULLEYS * y.tension, atol=1e-5)
    assert float(PULLEYS @ y.q) == pytest.approx(0.6 * 0.094 - y.tension / 400.0, abs=1e-9)


def test_a_blocked_finger_lets_the_others_close_further():
    p = replace(FIXED, thing=Thing.PAPER_BOX_A, p_WH_0=np.array([-0.12, 0.022]), sigma_0=0.0)
    y = walk(GraspScene(p), inputs(-0.12, 0.022, 0.0, 0.25), 6.0)[-1]
    free = resting_posture(0.25, 400.0, 0.094)
    thumb, others = slice(0, 2), slice(2, JOINTS)
    assert y.touching in (1, 2)
    np.testing.assert_allclose(STIFFNESS[others] * y.q[others], PULLEYS[others] * y.tension, rtol=1e-3)
    assert float(PULLEYS @ y.q) == pytest.approx(0.25 * 0.094 - y.tension / 400.0, abs=1e-9)
    assert float(PULLEYS[thumb] @ y.q[thumb]) < 0.9 * float(PULLEYS[thumb] @ free[thumb])
    assert np.all(y.q[others] > 1.03 * free[others])


def test_joints_keep_to_their_limits():
    q = np.array([y.q for y in walk(GraspScene(AROUND), inputs(sigma=1.0), 3.0)])
    assert np.max(q) < 1.6 + 0.02
    assert np.min(q) > -0.2 - 0.02


@pytest.mark.parametrize("thing", [Thing.CYLINDER, Thing.PAPER_BOX_A])
def test_a_pushed_object_slides_to_rest(thing: Thing):
    p = replace(AROUND, thing=thing, p_WH_0=np.array([-0.5, 0.0]))
    sigma, (palm, (x, y, yaw, *_), *phalanges), _ = initial_snapshot(p)
    world = GraspWorld(p, (sigma, (palm, (x, y, yaw, 0.3, 0.4, 0.0), *phalanges), 0))
    steps = 0
    while math.hypot(*world.snapshot[1][1][3:5]) > 1e-9:
        world.advance((-0.5, 0.0, 0.0, 0.1))
        steps += 1
    assert steps * DT == pytest.approx(0.5 / (0.3 * 9.81), abs=2.0 * DT)
    assert math.hypot(*world.thing[:2]) == pytest.approx(0.5**2 / (2.0 * 0.3 * 9.81), abs=0.5 * DT)
    assert world.thing[1] / world.thing[0] == pytest.approx(4.0 / 3.0)


def test_a_spun_object_turns_to_rest():
    p = replace(AROUND, p_WH_0=np.array([-0.5, 0.0]))
    sigma, (palm, (x, y, yaw, *_), *phalanges), _ = initial_snapshot(p)
    world = GraspWorld(p, (sigma, (palm, (x, y, yaw, 0.0, 0.0, 10.0), *phalanges), 0))
    steps = 0
    while world.snapshot[1][1][5] > 1e-9:
        world.advance((-0.5, 0.0, 0.0, 0.1))
        steps += 1
    braking = 0.3 * 9.81 * (2.0 * 0.033 / 3.0) / (0.033**2 / 2.0)
    assert steps * DT == pytest.approx(10.0 / braking, abs=2.0 * DT)


def test_a_push_below_the_limit_of_friction_moves_nothing():
    p = replace(FIXED, thing=Thing.PAPER_BOX_A, p_WH_0=np.array([-0.12, 0.022]), sigma_0=0.0)
    ys = walk(GraspScene(p), inputs(-0.12, 0.022, 0.0, 0.25), 2.0)
    assert ys[-1].touching > 0
    assert np.max(np.abs([y.p_WO for y in ys])) < 1e-6
    assert np.max(np.abs([y.yaw_O for y in ys])) < 5e-5
    np.testing.assert_allclose(ys[-60].p_WO, ys[-1].p_WO, atol=1e-8)
    light = walk(GraspScene(replace(p, mass_O=0.1, table_friction=0.3)), inputs(-0.12, 0.022, 0.0, 0.25), 2.0)
    assert np.max(np.abs([y.p_WO for y in light])) > 1e-3


def grasp(p: Params) -> tuple[Outputs, Outputs]:
    """Close, pull back by 150 mm, shake sideways; return the outputs at closure and at the end."""
    scene, t, x = GraspScene(p), 0.0, float(p.p_WH_0[0])
    closed = walk(scene, inputs(x, sigma=1.0), 1.5)[-1]
    y = closed
    while t < 3.5:
        shake = 0.012 * math.sin(2.0 * math.pi * 2.5 * (t - 1.5)) if t > 1.5 else 0.0
        y = scene.step(1.5 + t, STEP, inputs(x - min(0.12 * t, 0.15), shake, 0.0, 1.0))
        t += STEP
    return closed, y


@pytest.mark.parametrize(
    "thing",
    [t if t in (Thing.CYLINDER, Thing.BABY_CUP_A) else pytest.param(t, marks=pytest.mark.slow) for t in SOLIDS],
)
def test_an_object_between_the_fingers_is_held_through_pull_and_shake(thing: Thing):
    x = -0.125 if thing is Thing.BABY_CUP_A else -0.11
    closed, end = grasp(Params(thing=thing, p_WH_0=np.array([x, 0.0])))
    assert closed.touching >= 3
    assert end.touching >= 3
    np.testing.assert_allclose(end.p_WO - end.p_WH, closed.p_WO - closed.p_WH, atol=0.015)
    assert end.p_WO[0] < -0.12


@pytest.mark.parametrize("thing", [Thing.CYLINDER, Thing.PAPER_BOX_B])
def test_an_object_before_the_fingertips_is_left_behind(thing: Thing):
    _, end = grasp(Params(thing=thing, p_WH_0=np.array([-0.18, 0.0])))
    assert end.touching == 0
    assert end.p_WO[0] > -0.03


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"p_WH_0": np.array([-0.07, 0.0])}, "palm by 19 mm"),
        ({"sigma_0": 0.5}, "thumb phalanx 2 by"),
        ({"thing": Thing.PAPER_BOX_B, "sigma_0": 0.3}, "ring phalanx 3 by"),
    ],
)
def test_a_hand_in_the_object_is_refused(changes: dict[str, Any], part: str):
    with pytest.raises(InvalidSceneParameters, match=part):
        GraspScene(replace(AROUND, **changes))


def test_faults_of_the_parameters_are_reported_together():
    with pytest.raises(InvalidSceneParameters) as caught:
        GraspScene(Params(p_WO_0=np.array([0.58, 0.0]), b=0.003, nearest=0.07))
    assert len(caught.value.faults) == 4
    assert "the cylinder stands out 13 mm beyond the table" in caught.value.faults[0]
    with pytest.raises(InvalidSceneParameters, match=r"mass_O 1e-12 kg must be 0.* or at least 0\.001 kg"):
        GraspScene(Params(mass_O=1e-12))
    with pytest.raises(InvalidSceneParameters, match="wrist_speed"):
        GraspScene(Params(wrist_speed=-1.0))
    handle = Params(thing=Thing.BABY_CUP_B, p_WO_0=np.array([0.55, 0.0]))
    with pytest.raises(InvalidSceneParameters, match="4 mm beyond"):
        GraspScene(handle)
    GraspScene(replace(handle, yaw_O_0=math.pi / 2.0))


def test_every_finger_is_named_in_the_order_of_the_outputs():
    assert [len(f.lengths) for f in FINGERS] == [2, 3, 3]
    assert [v.shape for v in describe(GraspScene).outputs if v.name in ("q", "ticks")] == [(3,), (8,)]
