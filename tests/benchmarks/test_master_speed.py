"""What the master costs: rings of trivial native units beside other masters, wiring, and memory while recording.

`pytest tests/benchmarks/test_master_speed.py --benchmark-enable -s` prints the tables. Every host runs in a process of
its own, see ring_hosts.py; all of a ring size are measured in one run.
"""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.processes import program

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="Ecos and libcosim are there for Linux alone"),
]

NativeFmu = Callable[..., Path]
HOSTS = {
    "ours, FMI 2": "handover",
    "ours, FMI 3": "handover",
    "ours, recorded": "recorded",
    "ours, general path": "general",
    "Ecos": "ecos",
    "Ecos, CSV": "ecos_csv",
    "prebuilt ctypes calls": "prebuilt_calls",
    "libcosim": "libcosim",
    "libcosim, CSV": "libcosim_csv",
    "FMPy loop": "fmpy_loop",
}
COMPARED = ("ours, FMI 2", "ours, recorded", "Ecos", "Ecos, CSV")
"""Hosts of which a test without `--benchmark-enable` asserts something."""
TARGET, TARGET_RECORDED = 0.05, 0.1
"""Most us of CPU per unit and macro step."""
WIRING = 2.0
"""Most seconds of CPU for 1,000 units and 5,000 connections, until they are loaded and initialised."""


def script(name: str, environment: dict[str, str], *arguments: object) -> Any:
    """Return what a script prints last."""
    command = program(f"benchmarks/{name}", *arguments)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=170, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("n", [2, 10, 50])
def test_ring(benchmark: BenchmarkFixture, environment: dict[str, str], native_fmu: NativeFmu, n: int) -> None:
    spent: dict[str, dict[str, float]] = {}

    def measure() -> None:
        for name in HOSTS if benchmark.enabled else COMPARED:
            fmu = native_fmu("trivial", 3 if "3" in name else 2)
            spent[name] = script("ring_hosts.py", environment, HOSTS[name], n, fmu)

    benchmark.pedantic(measure)
    print(f"\nring of {n} units, us of CPU per unit and macro step: stepping; ending, files completed")
    for name, costs in spent.items():
        print(f"  {name:24}{costs['step']:8.3f}{costs['end']:8.3f}")
    benchmark.extra_info.update({name: costs["step"] for name, costs in spent.items()})
    assert spent["ours, FMI 2"]["step"] <= spent["Ecos"]["step"] / 2
    assert spent["ours, recorded"]["step"] <= spent["Ecos, CSV"]["step"] / 2
    if benchmark.enabled:  # else other tests run beside it
        assert spent["ours, FMI 2"]["step"] <= TARGET
        assert spent["ours, FMI 3"]["step"] <= TARGET
        assert spent["ours, recorded"]["step"] <= TARGET_RECORDED


def test_memory_of_a_long_record(
    benchmark: BenchmarkFixture, environment: dict[str, str], native_fmu: NativeFmu
) -> None:
    """It does not grow with the record, of 229 MB for 3 * 10^7 values: only one Parquet row group is in memory."""
    fmu, grown = native_fmu("trivial", 2), dict[int, float]()

    def measure() -> None:
        grown.update({n: script("record_memory.py", environment, fmu, n) for n in (10**7, 3 * 10**7)})

    benchmark.pedantic(measure)
    line = ", ".join(f"{megabytes:.0f} MB for {n:.0e} values" for n, megabytes in grown.items())
    print(f"\nrecording, the peak of resident memory grew by {line}")
    benchmark.extra_info.update({f"{n:.0e} values": megabytes for n, megabytes in grown.items()})
    assert grown[3 * 10**7] < 100.0


@pytest.mark.parametrize("fmi", [2, 3])
def test_wiring(benchmark: BenchmarkFixture, environment: dict[str, str], native_fmu: NativeFmu, fmi: int) -> None:
    """It takes less than FMPy takes to load and initialise the units, which wires nothing."""
    found: dict[str, Any] = {}
    benchmark.pedantic(lambda: found.update(script("wiring_hosts.py", environment, native_fmu("hub", fmi))))
    spent: dict[str, float] = found["ours"]
    line = ", ".join(f"{what} {seconds:.2f}" for what, seconds in spent.items())
    print(f"\n1,000 units, 5,000 connections, FMI {fmi}, s of CPU: {line}; FMPy, no connections: {found['FMPy']:.2f}")
    benchmark.extra_info.update(spent, FMPy=found["FMPy"])
    assert sum(spent.values()) <= found["FMPy"]
    if benchmark.enabled:  # else other tests run beside it
        assert sum(spent.values()) <= WIRING
