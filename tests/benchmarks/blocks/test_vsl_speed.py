"""CPU time of a step of the arm with variable-stiffness links, at rest at every instant and swinging.

Run with `pytest tests/benchmarks/blocks/test_vsl_speed.py --benchmark-enable -s`.
"""

import math
import time

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from handover.plants.vsl.arm import Inputs, VslArm
from handover.plants.vsl.parameters import Motion, Params


def inputs(steps: int) -> list[Inputs]:
    """Commands of all joints that move in every step, pressures and loads that change."""
    return [
        Inputs(
            q_cmd=np.array([math.sin(0.02 * i), 0.8 + 0.3 * math.sin(0.05 * i), -1.5 + 0.5 * math.cos(0.03 * i)]),
            p_cmd=np.array([1.25e5 + 0.75e5 * math.sin(0.01 * i), 1e5]),
            load=0.05 * (1.0 + math.sin(0.007 * i)),
        )
        for i in range(steps)
    ]


@pytest.mark.parametrize("motion", list(Motion))
def test_step(benchmark: BenchmarkFixture, motion: Motion):
    course = inputs(500)
    rounds: list[float] = []

    def walk() -> None:
        arm = VslArm(Params(motion=motion))
        begin = time.process_time()
        for i, u in enumerate(course):
            arm.step(0.02 * i, 0.02, u)
        rounds.append((time.process_time() - begin) / len(course))

    benchmark.pedantic(walk, rounds=5, warmup_rounds=1)
    median = float(np.median(rounds))
    print(f"\n{motion.name}: {1e3 * median:.3f} ms of CPU a step of 20 ms, {1.0 / median:.0f} steps a second")
    benchmark.extra_info.update(median_ms=1e3 * median)
