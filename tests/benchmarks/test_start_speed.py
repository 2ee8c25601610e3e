"""CPU time of the calls that one waits for: the command's version, help and lists, beside FMPy's help.

`pytest tests/benchmarks/test_start_speed.py --benchmark-enable -s` prints it.
"""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

resource = pytest.importorskip("resource", reason="the CPU time of children is known on Linux and macOS only")

ROUNDS = 5
CALLS: dict[str, tuple[str, ...]] = {
    "python -c pass": (sys.executable, "-c", "pass"),
    "python -c 'import handover'": (sys.executable, "-c", "import handover"),
    "handover --version": ("handover", "--version"),
    "handover --help": ("handover", "--help"),
    "handover list": ("handover", "list"),
    "handover list helix_handover": ("handover", "list", "helix_handover"),
    "handover list VslArm": ("handover", "list", "VslArm"),
    "handover run --help": ("handover", "run", "--help"),
    "fmpy --help": ("fmpy", "--help"),
}


def program(name: str) -> str:
    """Return the path of a program of this environment."""
    found = shutil.which(name, path=str(Path(sys.executable).parent)) or shutil.which(name)
    if found is None:
        pytest.skip(f"{name} is not installed as a command")
    return found


def cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def test_cpu_time_of_short_calls(benchmark: BenchmarkFixture) -> None:
    """The least of some rounds, in turn, so that what else the machine does falls on all alike."""
    calls = {name: (program(call[0]), *call[1:]) for name, call in CALLS.items()}
    least = dict.fromkeys(calls, float("inf"))

    def measure() -> None:
        for name, call in calls.items():
            before = cpu_of_children()
            subprocess.run(call, check=True, capture_output=True)
            least[name] = min(least[name], cpu_of_children() - before)

    benchmark.pedantic(measure, rounds=ROUNDS, warmup_rounds=1)
    print("\ns of CPU (user and system), least of rounds")
    for name, seconds in least.items():
        print(f"{name:30}{seconds:7.3f}")
    benchmark.extra_info.update(least)
