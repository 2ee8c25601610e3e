"""CPU time of grasps of the scenario `ir_grasp`: scene and reflex as FMUs, coupled by the master, without recording.

Run with `pytest tests/benchmarks/test_grasp_reflex_speed.py --benchmark-enable -s`.
"""

import time
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from handover.cosim.master.master import Master
from handover.cosim.system.signals import Signals
from handover.fmus.build import cached
from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.ir_grasp.ir_grasp import IrGrasp
from handover.scenarios.ir_grasp.parameters import Parameters

SEED = 0


class Clock:
    """Notes the CPU time after the start, so that loading the FMUs does not count, and the simulated time."""

    def __init__(self) -> None:
        self.begin = self.t = 0.0

    def __call__(self, t: float, signals: Signals) -> None:  # noqa: ARG002
        self.begin = self.begin or time.process_time()
        self.t = t


def fmu(unit: str) -> Path:
    return cached(IrGrasp.units[unit], 3)


def pace(thing: Thing) -> float:
    """Simulated seconds a second of CPU of one grasp, which must succeed; its judge is part of the time."""
    p, experiment, clock = Parameters(thing=thing), IrGrasp(), Clock()
    evaluator = experiment.evaluator(p)
    with Master(experiment.build(p, SEED, fmu)) as master:
        master.run(experiment.stop_time(p), [evaluator, clock], until=lambda: evaluator.over)
        spent = time.process_time() - clock.begin
    assert evaluator.outcome().success
    return clock.t / spent


@pytest.mark.parametrize("thing", Thing)
def test_grasp_by_reflex(benchmark: BenchmarkFixture, thing: Thing):
    paces: list[float] = []
    benchmark.pedantic(lambda: paces.append(pace(thing)), rounds=5, warmup_rounds=1)
    median, best = float(np.median(paces)), max(paces)
    print(f"\n{thing.name.lower()}: {median:.0f} simulated s a CPU s through FMUs and master, {best:.0f} at best")
    benchmark.extra_info.update(median=median, best=best)
