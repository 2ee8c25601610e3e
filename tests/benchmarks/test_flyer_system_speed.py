"""CPU time of the free-flyer's scenarios: robot, thrusters, controllers and person as FMUs, coupled by the master.

Run with `pytest tests/benchmarks/test_flyer_system_speed.py --benchmark-enable -s`. Recording is off. Beside it stands
what the units' own steps take of it, by the master's count, and what the master adds.
"""

import time
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Signals
from handover.fmus.build import cached
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.experiment.experiment import Experiment

SEED = 0


class Clock:
    """Notes the CPU time after the start, so that loading the FMUs does not count, and the simulated time."""

    def __init__(self) -> None:
        self.begin = self.t = 0.0

    def __call__(self, t: float, signals: Signals) -> None:  # noqa: ARG002
        self.begin = self.begin or time.process_time()
        self.t = t


def pace(experiment: Experiment[Any]) -> tuple[float, float]:
    """Simulated seconds a second of CPU of a run, and the units' share of the CPU time."""
    p, clock = experiment.parameters_type(), Clock()
    evaluator = experiment.evaluator(p)
    system = experiment.build(p, SEED, lambda unit: cached(experiment.units[unit], 3))
    with Master(system, MasterOptions(cpu_times=True)) as master:
        master.run(experiment.stop_time(p), [evaluator, clock], until=lambda: evaluator.over)
        spent = time.process_time() - clock.begin
    assert evaluator.over
    return clock.t / spent, sum(sum(cpu) for cpu in master.cpu.values()) / spent


@pytest.mark.parametrize(
    "name",
    [
        "flyer_impedance",
        "flyer_robot_to_human",
        "flyer_collaborative",
    ],
)
def test_pace(benchmark: BenchmarkFixture, name: str):
    runs: list[tuple[float, float]] = []
    benchmark.pedantic(lambda: runs.append(pace(SCENARIOS[name]())), rounds=5, warmup_rounds=1)
    paces, shares = np.transpose(runs)
    median, best, share = float(np.median(paces)), float(np.max(paces)), 100.0 * float(np.median(shares))
    print(f"\n{name}: {median:.0f} simulated s a CPU s, {best:.0f} at best; {share:.0f} % of it in the units")
    benchmark.extra_info.update(median=median, best=best, share=share)
