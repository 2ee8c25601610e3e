"""What a process of its own costs a unit, and what two processes save two heavy units.

`pytest tests/benchmarks/test_isolated_speed.py --benchmark-enable -s` prints the figures, of wall time: they are those
of the units only where the machine is idle.
"""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from statistics import median

import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.processes import program

pytestmark = [
    pytest.mark.skipif(sys.platform == "win32", reason="units are isolated on Linux and macOS"),
]

NativeFmu = Callable[..., Path]
TARGET, TARGET_SHARE = 15.0, 0.6
"""Most us of wall time that isolation adds to a step, and the most of one process's time that two need."""
PAIRS = 5
"""Runs of two heavy units in one process, each followed by one of them isolated."""


def microseconds(fmu: Path, isolated: str, *arguments: int) -> float:
    """Return what a step of a ring takes."""
    command = program("benchmarks/isolated_units.py", fmu, isolated, *arguments)
    done = subprocess.run(command, capture_output=True, text=True, timeout=170, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def is_idle() -> bool:
    """Whether nothing else runs: wall time then tells of the units."""
    return os.getloadavg()[0] < 0.7


@pytest.mark.parametrize("fmi", [2, 3])
def test_a_step_of_an_isolated_unit(benchmark: BenchmarkFixture, native_fmu: NativeFmu, fmi: int) -> None:
    times: dict[str, float] = {}

    def measure() -> None:
        for isolated in ("", "u0", "all"):
            times[isolated] = microseconds(native_fmu("trivial", fmi), isolated, 10_000, 2)

    benchmark.pedantic(measure)
    cost = times["u0"] - times[""]
    of_both = (times["all"] - times[""]) / 2
    print(f"\nisolation adds {cost:.1f} us of wall time to a step of FMI {fmi} (set, step and get),", end=" ")
    print(f"{of_both:.1f} us where both units of the ring are isolated; {idleness()}")
    benchmark.extra_info["us a step"] = cost
    if benchmark.enabled and is_idle():
        assert cost <= TARGET


def test_two_heavy_units(benchmark: BenchmarkFixture, native_fmu: NativeFmu) -> None:
    shares: list[float] = []
    alone: list[float] = []

    def measure() -> None:
        for _ in range(PAIRS):  # where the system puts the processes differs from run to run
            one, own = (microseconds(native_fmu("heavy", 3), isolated, 100, 2, 100) for isolated in ("", "all"))
            alone.append(one)
            shares.append(own / one)

    benchmark.pedantic(measure)
    share = median(shares)
    print(f"\ntwo units of {median(alone) / 2e3:.2f} ms a step under Jacobi take {share:.0%} of one process", end=" ")
    print(f"({min(shares):.0%} to {max(shares):.0%} in {PAIRS} pairs of runs); {idleness()}")
    benchmark.extra_info["share of one process"] = share
    if benchmark.enabled and is_idle() and (os.cpu_count() or 1) > 1:
        assert share <= TARGET_SHARE


def idleness() -> str:
    return f"load of the machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors"
