"""A state of the grasp scene is complete: what follows it is the same, bit for bit, wherever it is set."""

import math

import numpy as np
import pytest
from support.restored_states import flat

from handover.cosim.blocks.ports import Floats
from handover.plants.ir_grasp.objects import Thing
from handover.plants.ir_grasp.parameters import Params
from handover.plants.ir_grasp.scene import GraspScene, Inputs, Outputs

STEP = 0.015
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
