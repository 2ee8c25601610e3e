"""What a step of an FMU costs beyond that of the plain object, beside two other packages; what a picture costs.

`pytest tests/benchmarks/test_step_speed.py --benchmark-enable -s` prints a table: CPU time of a host in C that sets 12
real inputs, steps and gets 13 outputs (step_loop.c), and of Python code that does the same to the block itself. With
Python in a process of its own (`apart`) the host mostly waits, so that the wall time is what counts there.
"""

import ctypes
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from support.benchmarks.step_speed import INPUTS, OUTPUTS, Measured, assignments, medians
from support.fmus.ctypes_host import OK
from support.fmus.workshop import Workshop
from support.processes import program, with_path

from handover.fmus.compile import RUNTIME, zig_cc

pytestmark = pytest.mark.skipif(os.name == "nt", reason="step_loop.c measures with clock_gettime")

ROUNDS = 9
TARGET = 3.0
"""Most microseconds of CPU that a step should cost over the plain object."""

PICTURE_BYTES = 1280 * 720 * 3


@pytest.fixture
def workshop(tmp_path: Path) -> Iterator[Workshop]:
    made = Workshop(tmp_path)
    yield made
    for host in made.open:
        host.close()


@pytest.fixture(scope="module")
def loops(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("loops") / "step_loop.so"
    source = Path(__file__).with_name("step_loop.c")
    done = zig_cc(["-O2", "-std=gnu11", "-shared", "-fPIC", "-I", str(RUNTIME), str(source), "-o", str(made)])
    assert done.returncode == 0, done.stdout
    return made


def peer_source(fmi: int) -> str:
    """Return the block of sample_units/scalars.py as `pythonfmu` (FMI 2) and `pythonfmu3` take it."""
    package, real = ("pythonfmu", "Real") if fmi == 2 else ("pythonfmu3", "Float64")
    register = "            self.register_variable"
    return "\n".join(
        [
            f"from {package} import Fmi{fmi}Causality, Fmi{fmi}Slave, {real}",
            f"class Peer{fmi}(Fmi{fmi}Slave):",
            "    def __init__(self, **kwargs):",
            "        super().__init__(**kwargs)",
            f"        for name in {INPUTS!r}:",
            "            setattr(self, name, 0.0)",
            f"{register}({real}(name, causality=Fmi{fmi}Causality.input))",
            f"        for name in {OUTPUTS!r}:",
            "            setattr(self, name, 0.0)",
            f"{register}({real}(name, causality=Fmi{fmi}Causality.output))",
            "    def do_step(self, current_time, step_size):",
            *assignments("y13 = current_time + step_size", "self."),
            "        return True",
            "",
        ]
    )


def peer_fmu(fmi: int, folder: Path) -> Path:
    """Build an FMU with another package."""
    source = folder / f"peer{fmi}.py"
    source.write_text(peer_source(fmi))
    package = "pythonfmu" if fmi == 2 else "pythonfmu3"
    command = [sys.executable, "-m", package, "build", "-f", str(source), "-d", str(folder)]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert done.returncode == 0, done.stdout
    return folder / f"Peer{fmi}.fmu"


def measured_apart(loops: Path, rounds: int, fmus: Mapping[str, Path]) -> dict[str, Measured]:
    """Return microseconds of CPU and of wall time a step, measured by step_speed.py."""
    units = [f"{name}={fmu}" for name, fmu in fmus.items()]
    done = subprocess.run(
        program("benchmarks/step_speed.py", loops, rounds, *units),
        env=with_path(),
        capture_output=True,
        text=True,
        check=False,
    )
    # how it ends says nothing: the peers' exit handlers use the freed interpreter, which may end in an abort
    assert done.stdout, f"ended with {done.returncode}: {done.stderr}"
    return json.loads(done.stdout)


def test_step(benchmark: BenchmarkFixture, loops: Path, workshop: Workshop, tmp_path: Path):
    ours = {f"FMI {fmi}": workshop.fmu("scalars:Scalars", fmi) for fmi in (2, 3)}
    fmus = {**ours, "pythonfmu": peer_fmu(2, tmp_path), "pythonfmu3": peer_fmu(3, tmp_path)}
    fmus |= {f"{name} apart": fmu for name, fmu in ours.items()}
    found: dict[str, Measured] = {}
    benchmark.pedantic(lambda: found.update(measured_apart(loops, ROUNDS, fmus)), rounds=1)
    cpu = {name: row[0] for name, row in found.items()}
    over = {n: cpu[n] - cpu["plain peer" if n.startswith("pythonfmu") else "plain block"] for n in fmus}
    print(f"\nus a step        CPU of host  over plain object (target {TARGET:g})    wall")
    for name, (spent, wall) in found.items():
        print(f"{name:16} {spent:11.2f}  {f'{over[name]:31.2f}' if name in over else 31 * ' '} {wall:7.2f}")
    benchmark.extra_info.update(cpu)
    leanest_peer = min(over["pythonfmu"], over["pythonfmu3"])
    assert 2.0 * max(over["FMI 2"], over["FMI 3"]) < leanest_peer
    assert 2.0 * max(cpu["FMI 2"], cpu["FMI 3"]) < min(cpu["pythonfmu"], cpu["pythonfmu3"])


def test_picture(benchmark: BenchmarkFixture, loops: Path, workshop: Workshop):
    host, library = workshop.host("eye:Eye", 3), ctypes.CDLL(str(loops))
    for name in ("copy_loop", "set_loop", "get_loop"):
        getattr(library, name).restype = ctypes.c_double
    assert host.initialise() == OK
    picture = np.random.default_rng(1).integers(0, 256, PICTURE_BYTES, dtype=np.uint8)
    target, place = np.zeros_like(picture), ctypes.c_void_p()
    reference = ctypes.c_uint32(host.references["picture"])
    size, source = ctypes.c_size_t(PICTURE_BYTES), ctypes.c_void_p(picture.ctypes.data)
    set_binary, get_binary, instance = host.library.fmi3SetBinary, host.library.fmi3GetBinary, host.instance
    times = 50
    measured: dict[str, Callable[[], float]] = {
        "memcpy": lambda: 1e6 * library.copy_loop(ctypes.c_void_p(target.ctypes.data), source, size, times),
        "set": lambda: 1e6 * library.set_loop(set_binary, ctypes.c_void_p(instance), reference, source, size, times),
        "get": lambda: (
            1e6 * library.get_loop(get_binary, ctypes.c_void_p(instance), reference, times, ctypes.byref(place))
        ),
    }
    found: dict[str, float] = {}
    benchmark.pedantic(lambda: found.update(medians(measured, ROUNDS)), rounds=1)
    print(f"\nus of CPU for {PICTURE_BYTES / 1e6:.2f} MB: " + ", ".join(f"{n} {us:.2f}" for n, us in found.items()))
    benchmark.extra_info.update(found)
    seen = np.ctypeslib.as_array((ctypes.c_uint8 * PICTURE_BYTES).from_address(place.value or 0))
    assert np.array_equal(seen, picture)
    assert 0.0 < found["set"] < 1.3 * found["memcpy"]
    assert 0.0 < found["get"] < 0.01 * found["memcpy"]
