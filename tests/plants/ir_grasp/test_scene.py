"""The grasp scene: its physics, its sensors, its state, which is complete, and what it refuses."""

import math
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from support.restored_states import flat
from support.wording import Wording

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.actuation import PULLEYS, STIFFNESS, resting_posture
from handover.plants.ir_grasp.hand import JOINTS, finger_points, sensor_rays
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
    np.testing.assert_array_equal([first.p_WH, first.p_WO], [p.p_WH_0, p.p_WO_0])
    assert (first.yaw, first.sigma, first.touching) == (0.1, 0.1, 0)
    assert first.yaw_O == pytest.approx(0.3 + math.pi / 2.0)
    np.testing.assert_allclose(first.q, resting_posture(0.1, 400.0, 0.094), atol=1e-12)
    np.testing.assert_array_equal(flat(scene.outputs(0.0, Inputs(sigma_cmd=1.0))), flat(first))
    later = walk(scene, inputs(yaw=0.1), 0.3)[-1]
    np.testing.assert_allclose(later.q, first.q, atol=1e-6)
    np.testing.assert_array_equal(later.p_WO, first.p_WO)


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


@pytest.mark.parametrize("thing", [Thing.CYLINDER, Thing.PAPER_BOX_B, Thing.BABY_CUP_A])
def test_range_is_where_the_sensors_ray_meets_the_object(thing: Thing):
    for aside in (-0.01, 0.004):
        y = GraspScene(replace(AROUND, thing=thing, p_WO_0=np.array([0.0, aside]), sigma_0=0.05)).outputs(0.0, Inputs())
        c, s = math.cos(y.yaw_O), math.sin(y.yaw_O)
        to_O: Floats = np.array([[c, s], [-s, c]])
        for o, d, value in zip(*sensor_rays(y.p_WH, y.yaw, y.q), y.range, strict=True):
            met = SOLIDS[thing].intersect(*(to_O @ (o - y.p_WO)), *(to_O @ d))
            assert value == pytest.approx(met[0] if met else OUT_OF_RANGE, abs=1e-9)


def test_a_beam_half_beside_the_object_reads_less_and_so_does_one_of_a_darker_object():
    def thumb(**changes: Any) -> float:
        p = replace(AROUND, noise=0.0, thing=Thing.PAPER_BOX_A, p_WH_0=np.array([-0.158, 0.0]))
        return float(GraspScene(replace(p, **changes)).outputs(0.0, Inputs()).ticks[0])

    assert 0.6 * thumb(beam=0.0) < thumb(beam=0.15) < 0.75 * thumb(beam=0.0)  # one ray of three misses
    assert thumb(reflectivity=0.5) == pytest.approx(0.5 * thumb(reflectivity=1.0), abs=1.0)
    assert thumb(reflectivity=0.0) == thumb(reflectivity=SOLIDS[Thing.PAPER_BOX_A].reflectivity)


def test_sensors_are_read_every_5_ms_in_turn():
    scene = GraspScene(replace(AROUND, noise=30.0))
    ticks = np.array([scene.outputs(0.0, Inputs()).ticks, *(y.ticks for y in walk(scene, inputs(), 0.045, 1e-3))])
    changed = np.argwhere(np.diff(ticks, axis=0))
    assert changed.tolist() == [[5 * n - 1, (n - 1) % 3] for n in range(1, 10)]


def test_steps_of_any_size_make_the_same_course():
    one, other = (walk(GraspScene(AROUND), inputs(sigma=0.9), 0.72, dt)[-1] for dt in (0.015, 0.008))
    np.testing.assert_array_equal(flat(one), flat(other))
    assert one.touching > 0


def test_a_command_that_is_no_number_and_a_step_of_no_whole_milliseconds_are_refused_and_leave_no_trace():
    scene, other = GraspScene(AROUND), GraspScene(AROUND)
    for u, wrong in (
        (inputs(x=math.nan, sigma=math.inf), ["p_WH_cmd", "sigma_cmd"]),
        (inputs(yaw=-math.inf), ["yaw_cmd"]),
    ):
        with pytest.raises(InvalidCommand) as refused:
            scene.step(0.0, STEP, u)
        assert [fault.split()[0] for fault in refused.value.faults] == wrong
    for dt in (0.0004, 0.0155, -0.015):
        with pytest.raises(StepSizeError):
            scene.step(0.0, dt, inputs())
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


def test_a_blocked_finger_lets_the_others_close_further_and_pushes_nothing_that_friction_holds():
    p = replace(FIXED, thing=Thing.PAPER_BOX_A, p_WH_0=np.array([-0.12, 0.022]), sigma_0=0.0)
    ys = walk(GraspScene(p), inputs(-0.12, 0.022, 0.0, 0.25), 4.0)
    y, free = ys[-1], resting_posture(0.25, 400.0, 0.094)
    thumb, others = slice(0, 2), slice(2, JOINTS)
    assert y.touching in (1, 2)
    np.testing.assert_allclose(STIFFNESS[others] * y.q[others], PULLEYS[others] * y.tension, rtol=1e-3)
    assert float(PULLEYS @ y.q) == pytest.approx(0.25 * 0.094 - y.tension / 400.0, abs=1e-9)
    assert float(PULLEYS[thumb] @ y.q[thumb]) < 0.9 * float(PULLEYS[thumb] @ free[thumb])
    assert np.all(y.q[others] > 1.03 * free[others])
    assert np.max(np.abs([y.p_WO for y in ys])) < 1e-6
    assert np.max(np.abs([y.yaw_O for y in ys])) < 5e-5
    light = walk(GraspScene(replace(p, mass_O=0.1, table_friction=0.3)), inputs(-0.12, 0.022, 0.0, 0.25), 1.0)
    assert np.max(np.abs([y.p_WO for y in light])) > 1e-3


def set_off(p: Params, velocity: tuple[float, float, float]) -> tuple[GraspWorld, int]:
    """Let the object slide and turn to rest; return how many steps that takes, too."""
    sigma, (palm, (x, y, yaw, *_), *phalanges), _ = initial_snapshot(p)
    world, steps = GraspWorld(p, (sigma, (palm, (x, y, yaw, *velocity), *phalanges), 0)), 0
    while np.linalg.norm(world.snapshot[1][1][3:]) > 1e-9:
        world.advance((-0.5, 0.0, 0.0, 0.1))
        steps += 1
    return world, steps


@pytest.mark.parametrize("thing", [Thing.CYLINDER, Thing.PAPER_BOX_A])
def test_a_pushed_object_slides_and_a_spun_one_turns_to_rest(thing: Thing):
    p = replace(AROUND, thing=thing, p_WH_0=np.array([-0.5, 0.0]))
    world, steps = set_off(p, (0.3, 0.4, 0.0))
    assert steps * DT == pytest.approx(0.5 / (0.3 * 9.81), abs=2.0 * DT)
    assert math.hypot(*world.thing[:2]) == pytest.approx(0.5**2 / (2.0 * 0.3 * 9.81), abs=0.5 * DT)
    assert world.thing[1] / world.thing[0] == pytest.approx(4.0 / 3.0)
    if thing is Thing.CYLINDER:
        braking = 0.3 * 9.81 * (2.0 * 0.033 / 3.0) / (0.033**2 / 2.0)
        assert set_off(p, (0.0, 0.0, 10.0))[1] * DT == pytest.approx(10.0 / braking, abs=2.0 * DT)


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


@pytest.mark.parametrize(("thing", "x"), [(Thing.CYLINDER, -0.11), (Thing.BABY_CUP_A, -0.125)])
def test_an_object_between_the_fingers_is_held_through_pull_and_shake(thing: Thing, x: float):
    closed, end = grasp(Params(thing=thing, p_WH_0=np.array([x, 0.0])))
    assert min(closed.touching, end.touching) >= 3
    np.testing.assert_allclose(end.p_WO - end.p_WH, closed.p_WO - closed.p_WH, atol=0.015)
    assert end.p_WO[0] < -0.12
    assert max(closed.q) < 1.6 + 0.02  # the joints' limits


def test_an_object_before_the_fingertips_is_left_behind():
    _, end = grasp(Params(thing=Thing.PAPER_BOX_B, p_WH_0=np.array([-0.18, 0.0])))
    assert end.touching == 0
    assert end.p_WO[0] > -0.03


HANDLE = Params(thing=Thing.BABY_CUP_B, p_WO_0=np.array([0.55, 0.0]))


@pytest.mark.parametrize(
    ("p", "faults"),
    [
        (Params(p_WO_0=np.array([0.58, 0.0]), b=0.003, nearest=0.07), 4),
        (Params(mass_O=1e-12), 1),
        (Params(wrist_speed=-1.0), 1),
        (HANDLE, 1),
        (replace(AROUND, sigma_0=0.5), 1),
        (replace(AROUND, thing=Thing.PAPER_BOX_B, sigma_0=0.3), 1),
    ],
    ids=["several", "mass", "speed", "handle", "thumb", "ring"],
)
def test_a_scene_that_cannot_be_is_refused_with_all_faults(p: Params, faults: int, wording: Wording):
    with pytest.raises(InvalidSceneParameters) as caught:
        GraspScene(p)
    assert len(caught.value.faults) >= faults
    wording.check(caught.value)
    GraspScene(replace(HANDLE, yaw_O_0=math.pi / 2.0))


PARAMS = {
    thing: Params(thing=thing, p_WH_0=np.array([-0.14, 0.004]), yaw_O_0=0.1, seed=5, tendon_stiffness=500.0)
    for thing in Thing
}


def command(k: int) -> Inputs:
    """Close, pull and shake."""
    t = k * STEP
    x, y = -0.12 - 0.12 * max(t - 1.4, 0.0), 0.012 * math.sin(12.0 * max(t - 2.0, 0.0))
    return Inputs(p_WH_cmd=np.array([x, y]), yaw_cmd=0.1 * t, sigma_cmd=min(1.0, 0.1 + t))


def course(scene: GraspScene, first: int, last: int) -> Floats:
    return np.array([flat(scene.step(k * STEP, STEP, command(k))) for k in range(first, last)])


@pytest.mark.parametrize(("thing", "steps"), [(3, 120), (8, 101)])
def test_continues_bit_for_bit_here_and_in_another_scene(thing: int, steps: int):
    scene, other, bent = (GraspScene(PARAMS[Thing(thing)]) for _ in range(3))
    course(scene, 0, steps)
    course(bent, 0, 77)
    state, y = scene.get_state(), scene.outputs(steps * STEP, command(steps))
    assert scene.get_state() == state
    assert len(state) < 6000
    assert y.touching > 2
    wanted = course(scene, steps, steps + 60)
    for again in (scene, other, bent):
        again.set_state(state)
        np.testing.assert_array_equal(flat(again.outputs(steps * STEP, command(steps))), flat(y))
        np.testing.assert_array_equal(course(again, steps, steps + 60), wanted)


def test_a_rejected_step_leaves_no_trace_between_readings_of_the_sensors_either():
    kept, rejecting = GraspScene(PARAMS[Thing.PAPER_BOX_A]), GraspScene(PARAMS[Thing.PAPER_BOX_A])
    for k in range(1200, 1260):
        state, (t, dt) = rejecting.get_state(), (k * 1e-3, 1e-3)
        rejecting.step(t, dt, Inputs(p_WH_cmd=np.array([0.1, 0.1]), sigma_cmd=0.0))
        rejecting.set_state(state)
        again, y = (scene.step(t, dt, command(k // 15)) for scene in (rejecting, kept))
        np.testing.assert_array_equal(flat(again), flat(y))


@pytest.mark.slow
def test_a_world_made_anew_goes_on_nearly_as_before(monkeypatch: pytest.MonkeyPatch):
    ends: list[Outputs] = []
    for checkpoint in (100, 10**9):
        monkeypatch.setattr("handover.plants.ir_grasp.scene._CHECKPOINT", checkpoint)
        scene = GraspScene(PARAMS[Thing.CYLINDER])
        ends.append([scene.step(k * STEP, STEP, command(k)) for k in range(130)][-1])
    often, never = ends
    np.testing.assert_allclose(often.p_WO - often.p_WH, never.p_WO - never.p_WH, atol=1e-3)
