"""CPU times of saving and restoring a unit's state, beside a step: what iterated and adaptive runs pay for a rollback.

Run with `pytest tests/benchmarks/test_state_speed.py --benchmark-enable -s`.
"""

import time
import timeit
from collections.abc import Callable
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from handover.cosim.blocks.description import describe
from handover.fmus.catalog import UNITS, import_class

ROUNDS, CALLS = 25, 200


def microseconds(call: Callable[[], Any], calls: int = CALLS) -> float:
    """Return the least mean CPU time of some rounds of calls: what else the machine does counts little."""
    return min(timeit.repeat(call, number=calls, repeat=ROUNDS, timer=time.process_time)) / calls * 1e6


@pytest.mark.parametrize("name", ["FreeFlyer", "HandAndObject", "VslArm", "TendonArm"])
def test_save_and_restore(name: str, benchmark: BenchmarkFixture):
    kind = import_class(UNITS[name].block)
    d = describe(kind)
    block, inputs, h = kind(d.params_type()), d.inputs_type(), float(UNITS[name].step)
    block.outputs(0.0, inputs)
    block.step(0.0, h, inputs)
    saved = block.get_state()
    save, restore = microseconds(block.get_state), microseconds(lambda: block.set_state(saved))
    assert block.get_state() == saved

    step = microseconds(lambda: block.step(h, h, inputs), 10)
    benchmark.pedantic(block.get_state, rounds=ROUNDS)
    print(
        f"\n{name}: save {save:.1f} us, restore {restore:.1f} us, step {step:.0f} us, {len(saved)} bytes; "
        f"both are {(save + restore) / step:.0%} of a step"
    )
    benchmark.extra_info.update(save_us=save, restore_us=restore, step_us=step)
