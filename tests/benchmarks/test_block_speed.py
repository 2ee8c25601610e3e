"""CPU time of a step of each unit's block, and of saving and restoring its state: what a rollback costs beside a step.

Run with `pytest tests/benchmarks/test_block_speed.py --benchmark-enable -s`.
"""

import time
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.exchange import drive

from handover.cosim.blocks.description import describe
from handover.fmus.catalog import UNITS, import_class
from handover.plants.vsl.parameters import Motion

ROUNDS, STEPS = 25, 20
CASES: list[tuple[str, dict[str, Any]]] = [
    *((name, {}) for name in UNITS),
    *(("TendonArm", {"discs_1": n, "discs_2": 2 * n, "discs_3": 2 * n}) for n in (2, 3, 8)),
    ("TendonArmFast", {"internal_step": 0.01}),
    ("Thrusters", {"delay": 0.025}),
    ("Navigation", {"delay": 0.025}),
    *(("VslArm", {"motion": motion}) for motion in Motion),
]


@pytest.mark.parametrize(("name", "parameters"), CASES, ids=str)
def test_step_and_state(benchmark: BenchmarkFixture, name: str, parameters: dict[str, Any]) -> None:
    kind, h = import_class(UNITS[name].block), float(UNITS[name].step)
    d = describe(kind)
    block, us = kind(d.params_type(**parameters)), [d.inputs_type(**drive.inputs(d, k)) for k in range(STEPS)]
    block.outputs(0.0, us[0])
    saved, spent = block.get_state(), list[list[float]]()

    def measure() -> None:
        times = [time.process_time()]
        for k, u in enumerate(us):
            block.step(k * h, h, u)
        times.append(time.process_time())
        for _ in us:
            block.get_state()
        times.append(time.process_time())
        for _ in us:
            block.set_state(saved)
        times.append(time.process_time())
        spent.append(np.diff(times).tolist())

    benchmark.pedantic(measure, rounds=ROUNDS, warmup_rounds=1)
    step, save, restore = (1e6 / STEPS * np.min(spent, axis=0)).tolist()
    benchmark.extra_info.update(step_us=step, save_us=save, restore_us=restore)
    print(f"\n{name} {parameters or ''}: us of CPU, step {step:.1f}, save {save:.1f}, restore {restore:.1f}", end="")
