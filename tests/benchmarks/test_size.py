"""CPU time and memory of large systems and FMUs: an SSP read, checked, loaded and stepped 100 times, an FMU read, run.

`pytest tests/benchmarks/test_size.py --benchmark-enable -s` prints them, and by what power of the size they grow.
"""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.benchmarks.large_systems import write_large_fmu, write_large_ssp

pytest.importorskip("resource", reason="memory is reported on Linux and macOS only")

SIZES = (1_000, 3_000, 10_000)
SECONDS, BYTES = 60.0, 2 << 30
"""What 10,000 components may take."""

COMMAND_SECONDS, COMMAND_BYTES = 20.0, 500 << 20
"""What a command may take with a unit of a million variables."""

_MEASURED = """
import json, resource, sys, time
from fractions import Fraction
from pathlib import Path
import fmpy
from handover.cosim.fmu.file import fmpy_edge
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.ssp.ssp_file import SspFile
from handover.scenarios.runs.results.summary import peak_memory

path, times = Path(sys.argv[1]), [time.process_time()]
def lap():
    times.append(time.process_time())
if path.suffix == ".fmu":
    describe_fmu(path)
    lap()
    peak = peak_memory()
    fmpy.read_model_description(path)
    lap()
else:
    with SspFile(path) as ssp:
        lap()
        master = Master(ssp.system)
        lap()
        with master:
            lap()
            master.run(Fraction(1))
            lap()
        lap()
    peak = peak_memory()
print(json.dumps({"laps": [b - a for a, b in zip(times, times[1:])], "bytes": peak}))
"""

_USED = """
import json, resource, subprocess, sys
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
print(json.dumps([used.ru_utime + used.ru_stime, used.ru_maxrss * (1 if sys.platform == "darwin" else 1024)]))
"""
"""A small process between, as the peak of a forked process begins with that of its parent."""


def measured(path: Path) -> tuple[list[float], int]:
    """Return the CPU seconds of each part, and the peak memory, in a process of its own."""
    done = subprocess.run([sys.executable, "-c", _MEASURED, str(path)], check=True, capture_output=True, text=True)
    found = json.loads(done.stdout)
    return found["laps"], found["bytes"]


def growth(small: float, large: float) -> float:
    """Return the power of the size by which a time grows from the least to the greatest size."""
    return math.log(large / small) / math.log(SIZES[-1] / SIZES[0])


def test_cpu_time_and_memory_of_large_systems(benchmark: BenchmarkFixture, tmp_path: Path) -> None:
    found: dict[int, tuple[list[float], int]] = {}

    def measure() -> None:
        for n in SIZES:
            found[n] = measured(write_large_ssp(tmp_path / f"{n}.ssp", n))

    benchmark.pedantic(measure, rounds=1)
    print("\ncomponents  connections    read   check    load    step    free   CPU s      MB")
    for n, (laps, peak) in found.items():
        parts = "".join(f"{s:8.2f}" for s in laps)
        print(f"{n:10}{3 * n:13}{parts}{sum(laps):8.2f}{peak / 2**20:8.0f}")
    least, most = (sum(found[n][0]) for n in (SIZES[0], SIZES[-1]))
    power = growth(least, most)
    print(f"grows with the size to the power of {power:.2f}")
    assert power < 1.5
    assert found[SIZES[-1]][1] < BYTES
    if benchmark.enabled:  # else other tests run beside it
        assert most < SECONDS


@pytest.mark.parametrize("fmi", [2, 3])
def test_cpu_time_and_memory_of_a_large_fmu(benchmark: BenchmarkFixture, tmp_path: Path, fmi: int) -> None:
    found: dict[int, tuple[list[float], int]] = {}
    sizes = [(10 if benchmark.enabled else 1) * n for n in SIZES]

    def measure() -> None:
        for n in sizes:
            found[n] = measured(write_large_fmu(tmp_path / f"{n}.fmu", n, fmi))

    benchmark.pedantic(measure, rounds=1)
    print(f"\nvariables, FMI {fmi}   CPU s      MB   FMPy's reader alone, CPU s")
    for n, ((ours, of_fmpy), peak) in found.items():
        print(f"{n:16}{ours:8.2f}{peak / 2**20:8.0f}{of_fmpy:8.2f}")
    assert growth(*(found[n][0][0] for n in (sizes[0], sizes[-1]))) < 1.5


def test_cpu_time_and_memory_of_commands_with_a_unit_of_a_million_variables(
    benchmark: BenchmarkFixture, tmp_path: Path
) -> None:
    n = 10**6 if benchmark.enabled else 7 * 10**4  # which is read as a large one, too
    fmu = write_large_fmu(tmp_path / "unit.fmu", n, 3, causalities=("local",))
    command = str(Path(sys.executable).with_name("handover"))
    reader = "import fmpy, sys; fmpy.read_model_description(sys.argv[1])"
    calls = {
        "handover check": [command, "check", str(fmu)],
        "handover run": [command, "run", str(fmu), "--stop", "1", "--out", str(tmp_path / "out")],
        "FMPy's reader alone": [sys.executable, "-c", reader, str(fmu)],
    }
    found: dict[str, tuple[float, int]] = {}

    def measure() -> None:
        for name, call in calls.items():
            done = subprocess.run([sys.executable, "-c", _USED, *call], check=True, text=True, stdout=subprocess.PIPE)
            found[name] = json.loads(done.stdout)

    benchmark.pedantic(measure, rounds=1)
    print(f"\n{n} local variables; {fmu.stat().st_size / 1e6:.1f} MB   CPU s      MB")
    for name, (seconds, peak) in found.items():
        print(f"{name:44}{seconds:8.2f}{peak / 2**20:8.0f}")
    for name in ("handover check", "handover run"):
        assert found[name][1] < COMMAND_BYTES
        if benchmark.enabled:
            assert found[name][0] < COMMAND_SECONDS
