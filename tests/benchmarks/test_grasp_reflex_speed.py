"""CPU time of grasps of the scenario `ir_grasp`: scene and reflex as FMUs, coupled by the master, without recording.

Run with `pytest tests/benchmarks/test_grasp_reflex_speed.py --benchmark-enable -s`.
"""

import time
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.exchange.disturbed_grasp import DISTURBED, OFF

from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.plants.ir_grasp.objects import Thing
from handover.scenarios.execution.runner import experiment_system
from handover.scenarios.experiment.parameters import parse_parameters
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


def pace(system: System, p: Parameters) -> tuple[float, bool]:
    """Simulated seconds a second of CPU of one grasp, its judge's included, and whether it succeeded."""
    experiment, clock = IrGrasp(), Clock()
    evaluator = experiment.evaluator(p)
    with Master(system) as master:
        master.run(experiment.stop_time(p), [evaluator, clock], until=lambda: evaluator.over)
        spent = time.process_time() - clock.begin
    return clock.t / spent, evaluator.outcome().success


def measure(benchmark: BenchmarkFixture, name: str, system: System, p: Parameters) -> bool:
    """Print and keep the pace of five grasps; return whether they succeeded."""
    grasps: list[tuple[float, bool]] = []
    benchmark.pedantic(lambda: grasps.append(pace(system, p)), rounds=5, warmup_rounds=1)
    paces = [each for each, _ in grasps]
    median, best = float(np.median(paces)), max(paces)
    print(f"\n{name}: {median:.0f} simulated s a CPU s through FMUs and master, {best:.0f} at best")
    benchmark.extra_info.update(median=median, best=best)
    return all(success for _, success in grasps)


@pytest.mark.parametrize("thing", Thing)
def test_grasp_by_reflex(benchmark: BenchmarkFixture, thing: Thing):
    p = Parameters(thing=thing)
    assert measure(benchmark, thing.name.lower(), IrGrasp().build(p, SEED, fmu), p)


@pytest.mark.parametrize("correction", ["paper", "fast"])
def test_grasp_with_all_amiss(benchmark: BenchmarkFixture, correction: str):
    """A polygon that is carried and nudged beside another object, by sensors that are off, see light and each other."""
    p = parse_parameters(IrGrasp, [*DISTURBED[1:], f"correction={correction}"])
    fmus = {unit: fmu(unit) for unit in IrGrasp.units}
    system = experiment_system(IrGrasp(), p, SEED, fmus, OFF, MasterOptions())
    measure(benchmark, f"all amiss, {correction}", system, p)
