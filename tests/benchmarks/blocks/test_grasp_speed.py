"""CPU time of the grasp scene through a grasp: reach, close, pull and shake, in steps of 15 ms.

Run with `pytest tests/benchmarks/blocks/test_grasp_speed.py --benchmark-enable -s`.
"""

import math
import time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from handover.plants.ir_grasp.objects import Thing
from handover.plants.ir_grasp.parameters import Params
from handover.plants.ir_grasp.scene import GraspScene, Inputs

STEP, SECONDS = 0.015, 6.0


def command(t: float) -> Inputs:
    x = -0.20 + min(0.1 * t, 0.09) - min(max(0.12 * (t - 2.5), 0.0), 0.15)
    shake = 0.012 * math.sin(16.0 * (t - 4.0)) if t > 4.0 else 0.0
    return Inputs(p_WH_cmd=np.array([x, shake]), yaw_cmd=0.0, sigma_cmd=min(max(t - 1.0, 0.0), 1.0))


def grasp(thing: Thing) -> list[float]:
    """Seconds of CPU of each step of one grasp."""
    scene = GraspScene(Params(thing=thing, p_WH_0=np.array([-0.20, 0.0])))
    commands = [command(k * STEP) for k in range(round(SECONDS / STEP))]
    times: list[float] = []
    touching = 0
    for k, u in enumerate(commands):
        begin = time.process_time()
        touching = scene.step(k * STEP, STEP, u).touching
        times.append(time.process_time() - begin)
    assert touching >= 3, "the object was lost"
    return times


@pytest.mark.parametrize("thing", Thing)
def test_grasp(benchmark: BenchmarkFixture, thing: Thing):
    rounds: list[list[float]] = []
    benchmark.pedantic(lambda: rounds.append(grasp(thing)), rounds=9, warmup_rounds=1)
    median = SECONDS / float(np.median(np.sum(rounds, axis=1)))
    quiet = SECONDS / float(np.sum(np.min(rounds, axis=0)))  # every round takes the same course
    print(f"\n{thing.name.lower()}: {median:.0f} simulated s a CPU s, {quiet:.0f} with each step at its quickest")
    benchmark.extra_info.update(median=median, quiet=quiet)


def test_set_state_in_the_middle_of_a_grasp(benchmark: BenchmarkFixture):
    scene = GraspScene(Params(p_WH_0=np.array([-0.20, 0.0])))
    for k in range(199):
        scene.step(k * STEP, STEP, command(k * STEP))
    state, times = scene.get_state(), list[float]()

    def restore() -> None:
        begin = time.process_time()
        scene.set_state(state)
        times.append(time.process_time() - begin)

    benchmark.pedantic(restore, rounds=20, warmup_rounds=1)
    print(f"\nset_state 485 ms after a checkpoint: {1e3 * min(times):.1f} ms of CPU, {len(state)} bytes")
