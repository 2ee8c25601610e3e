"""A state of the grasp scene is complete: what follows it is the same, bit for bit, wherever it is set."""

import math
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from handover.cosim.blocks.description import describe
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


def packed(y: Outputs) -> bytes:
    return b"".join(np.asarray(getattr(y, v.name)).tobytes() for v in describe(GraspScene).outputs)


def course(scene: GraspScene, first: int, last: "int | None" = None) -> list[bytes]:
    """Return what is there after each step; by default after 60 of them."""
    last = first + 60 if last is None else last
    return [packed(scene.step(k * STEP, STEP, command(k))) for k in range(first, last)]


@pytest.mark.parametrize(
    ("thing", "steps"),
    [
        (0, 55),
        (3, 120),
        (8, 101),
        *(pytest.param(*given, marks=pytest.mark.slow) for given in ((0, 0), (1, 90), (7, 67))),
    ],
)
def test_continues_bit_for_bit_here_and_in_another_scene(thing: int, steps: int):
    params = PARAMS[Thing(thing)]
    scene, other, bent = GraspScene(params), GraspScene(params), GraspScene(params)
    course(scene, 0, steps)
    course(bent, 0, 77)
    state = scene.get_state()
    assert scene.get_state() == state
    wanted = course(scene, steps)
    for again in (scene, other, bent):
        again.set_state(state)
        assert course(again, steps) == wanted


def test_outputs_after_set_state_are_those_of_the_state():
    scene, other = GraspScene(PARAMS[Thing.CYLINDER]), GraspScene(PARAMS[Thing.CYLINDER])
    course(scene, 0, 90)
    y = scene.outputs(90 * STEP, command(90))
    other.set_state(scene.get_state())
    assert y.touching > 2
    assert packed(other.outputs(90 * STEP, command(90))) == packed(y)


def test_states_between_readings_of_the_sensors_are_complete_too():
    scene, other = GraspScene(PARAMS[Thing.CYLINDER]), GraspScene(PARAMS[Thing.CYLINDER])
    touching = 0
    for k in range(1203):
        scene.step(k * 1e-3, 1e-3, command(k // 15))
    other.set_state(scene.get_state())
    for k in range(1203, 1300):
        y, y_other = (s.step(k * 1e-3, 1e-3, command(k // 15)) for s in (scene, other))
        assert packed(y) == packed(y_other)
        touching = y.touching
    assert touching > 2


def test_a_rejected_step_leaves_no_trace():
    kept, rejecting = GraspScene(PARAMS[Thing.PAPER_BOX_A]), GraspScene(PARAMS[Thing.PAPER_BOX_A])
    for k in range(70, 100):
        state = rejecting.get_state()
        rejecting.step(k * STEP, STEP, Inputs(p_WH_cmd=np.array([0.1, 0.1]), sigma_cmd=0.0))
        rejecting.set_state(state)
        assert packed(rejecting.step(k * STEP, STEP, command(k))) == packed(kept.step(k * STEP, STEP, command(k)))


def test_the_state_stays_small():
    scene = GraspScene(PARAMS[Thing.CYLINDER])
    sizes: list[int] = []
    for k in range(200):
        scene.step(k * STEP, STEP, command(k))
        sizes.append(len(scene.get_state()))
    assert max(sizes) < 6000


CONTINUE = """
import pickle, runpy, sys
names = runpy.run_path(sys.argv[1])
thing, steps, state = pickle.load(sys.stdin.buffer)
scene = names["GraspScene"](names["PARAMS"][thing])
scene.set_state(state)
sys.stdout.buffer.write(pickle.dumps(names["course"](scene, steps)))
"""


@pytest.mark.slow
def test_continues_bit_for_bit_in_another_process():
    scene, steps = GraspScene(PARAMS[Thing.BABY_CUP_A]), 101
    course(scene, 0, steps)
    given = pickle.dumps((int(Thing.BABY_CUP_A), steps, scene.get_state()))
    call = [sys.executable, "-c", CONTINUE, str(Path(__file__))]
    answer = subprocess.run(call, input=given, capture_output=True, check=True).stdout
    assert pickle.loads(answer) == course(scene, steps)


@pytest.mark.slow
def test_a_world_made_anew_goes_on_nearly_as_before(monkeypatch: pytest.MonkeyPatch):
    def end(checkpoint: int) -> Outputs:
        monkeypatch.setattr("handover.plants.ir_grasp.scene._CHECKPOINT", checkpoint)
        scene = GraspScene(PARAMS[Thing.CYLINDER])
        return [scene.step(k * STEP, STEP, command(k)) for k in range(130)][-1]

    often, never = end(100), end(10**9)
    np.testing.assert_allclose(often.p_WO - often.p_WH, never.p_WO - never.p_WH, atol=1e-3)
