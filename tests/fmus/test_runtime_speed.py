"""What a step of an FMU costs beyond that of the plain object, beside two other packages; what a picture costs.

`pytest tests/fmus/test_runtime_speed.py --benchmark-enable -s` prints a table: CPU time of a host in C that sets 12
real inputs, steps and gets 13 outputs (step_loop.c), and of Python code that does the same to the block itself.
"""

import ctypes
import gc
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from ctypes_host import OK, CtypesHost
from pytest_benchmark.fixture import BenchmarkFixture
from sample_units.scalars import Inputs, Params, Scalars
from workshop import Workshop

from fmus.compile import RUNTIME, zig_cc

pytestmark = pytest.mark.skipif(os.name == "nt", reason="step_loop.c measures with clock_gettime")

DT = 1 / 128
STEPS, ROUNDS = 20_000, 9
N_INPUTS, N_OUTPUTS = 12, 13
INPUTS, OUTPUTS = [f"u{i + 1}" for i in range(N_INPUTS)], [f"y{i + 1}" for i in range(N_OUTPUTS)]
PICTURE_BYTES = 1280 * 720 * 3


@pytest.fixture(scope="module")
def loops(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    made = tmp_path_factory.mktemp("loops") / "step_loop.so"
    source = Path(__file__).with_name("step_loop.c")
    done = zig_cc(["-O2", "-std=gnu11", "-shared", "-fPIC", "-I", str(RUNTIME), str(source), "-o", str(made)])
    assert done.returncode == 0, done.stdout
    library = ctypes.CDLL(str(made))
    for name in ("loop2", "loop3", "copy_loop", "set_loop", "get_loop"):
        getattr(library, name).restype = ctypes.c_double
    return library


def assignments(to: str, source: str) -> list[str]:
    return [f"        self.{y} = {source}{u}" for y, u in zip(OUTPUTS, INPUTS, strict=False)] + [f"        self.{to}"]


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


def peer_host(fmi: int, folder: Path) -> CtypesHost:
    """Build an FMU with another package and open it."""
    source = folder / f"peer{fmi}.py"
    source.write_text(peer_source(fmi))
    package = "pythonfmu" if fmi == 2 else "pythonfmu3"
    command = [sys.executable, "-m", package, "build", "-f", str(source), "-d", str(folder)]
    done = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False)
    assert done.returncode == 0, done.stdout
    host = CtypesHost(folder / f"Peer{fmi}.fmu", fmi, prefix="peer")  # it crashes in folders of other names
    memory = ctypes.CDLL(None)  # which pythonfmu leaves to the host
    host.callbacks.allocate = ctypes.cast(memory.calloc, ctypes.c_void_p)
    host.callbacks.free = ctypes.cast(memory.free, ctypes.c_void_p)
    assert host.instantiate()
    return host


def fmu_loop(loops: ctypes.CDLL, host: CtypesHost) -> Callable[[], float]:
    """Return what makes a round of steps in C and tells microseconds of CPU a step."""
    assert host.initialise() == OK
    kind = "Real" if host.fmi == 2 else "Float64"
    functions = [getattr(host.library, f"fmi{host.fmi}{name}") for name in (f"Set{kind}", "DoStep", f"Get{kind}")]
    inputs = (ctypes.c_uint32 * N_INPUTS)(*(host.references[n] for n in INPUTS))
    outputs = (ctypes.c_uint32 * N_OUTPUTS)(*(host.references[n] for n in OUTPUTS))
    y, at = (ctypes.c_double * N_OUTPUTS)(), [0.0]
    loop = getattr(loops, f"loop{host.fmi}")

    def run() -> float:
        t, dt = ctypes.c_double(at[0]), ctypes.c_double(DT)
        spent = loop(*functions, ctypes.c_void_p(host.instance), inputs, outputs, t, dt, STEPS, y)
        at[0] += STEPS * DT
        assert spent > 0.0, host.log[-1:]
        assert list(y) == [STEPS - 1 + 0.5 * i for i in range(N_INPUTS)] + [at[0]]
        return 1e6 * spent

    return run


def timed(body: "list[str]", names: "dict[str, object]") -> Callable[[], float]:
    """Return what runs the lines STEPS times and tells microseconds of CPU a time."""
    lines = ["def run(k_last):", "    for k in range(k_last):", *(f"        {line}" for line in body)]
    exec("\n".join(lines), names)
    run: Callable[[int], None] = names["run"]  # pyright: ignore[reportAssignmentType]

    def measure() -> float:
        begin = time.thread_time()
        run(STEPS)
        return 1e6 * (time.thread_time() - begin) / STEPS

    return measure


def plain_loop() -> Callable[[], float]:
    """Return what does to the block itself what a host does to its FMU."""
    inputs = [f"u.u{i + 1} = k + {0.5 * i}" for i in range(N_INPUTS)]
    names: dict[str, object] = {"u": Inputs(), "block": Scalars(Params()), "DT": DT}
    return timed([*inputs, "y = block.step(k * DT, DT, u)"], names)


def plain_peer_loop() -> Callable[[], float]:
    """Return the same for the object that the other packages step: it keeps inputs and outputs itself."""
    names: dict[str, object] = {"DT": DT}
    body = "\n".join(assignments("y13 = current_time + step_size", "self."))
    exec(
        f"class Peer:\n    def do_step(self, current_time, step_size):\n{body}\n        return True\npeer = Peer()",
        names,
    )
    inputs = [f"peer.u{i + 1} = k + {0.5 * i}" for i in range(N_INPUTS)]
    return timed([*inputs, "peer.do_step(k * DT, DT)"], names)


def medians(measured: "dict[str, Callable[[], float]]", rounds: int = ROUNDS) -> "dict[str, float]":
    """Return the median of each, measured in turns."""
    rows: dict[str, list[float]] = {name: [] for name in measured}
    gc.collect()
    for _ in range(rounds):
        for name, run in measured.items():
            rows[name].append(run())
    return {name: float(np.median(row)) for name, row in rows.items()}


def test_step(benchmark: BenchmarkFixture, loops: ctypes.CDLL, workshop: Workshop, tmp_path: Path):
    hosts = {f"FMI {fmi}": workshop.host("scalars:Scalars", fmi) for fmi in (2, 3)}
    hosts |= {"pythonfmu": peer_host(2, tmp_path), "pythonfmu3": peer_host(3, tmp_path)}
    workshop.open += [hosts["pythonfmu"], hosts["pythonfmu3"]]
    measured = {name: fmu_loop(loops, host) for name, host in hosts.items()}
    measured |= {"plain block": plain_loop(), "plain peer": plain_peer_loop()}
    found: dict[str, float] = {}
    benchmark.pedantic(lambda: found.update(medians(measured, ROUNDS if benchmark.enabled else 1)), rounds=1)
    plain = {n: found["plain peer" if n.startswith("pythonfmu") else "plain block"] for n in hosts}
    over = {name: found[name] - plain[name] for name in hosts}
    print("\nus of CPU a step     all  over plain object")
    for name in found:
        print(f"{name:16} {found[name]:7.2f}  {f'{over[name]:7.2f}' if name in over else ''}")
    benchmark.extra_info.update(found)
    leanest_peer = min(over["pythonfmu"], over["pythonfmu3"])
    assert 2.0 * max(over["FMI 2"], over["FMI 3"]) < leanest_peer
    assert 2.0 * max(found["FMI 2"], found["FMI 3"]) < min(found["pythonfmu"], found["pythonfmu3"])


def test_picture(benchmark: BenchmarkFixture, loops: ctypes.CDLL, workshop: Workshop):
    host = workshop.host("eye:Eye", 3)
    assert host.initialise() == OK
    picture = np.random.default_rng(1).integers(0, 256, PICTURE_BYTES, dtype=np.uint8)
    target, place = np.zeros_like(picture), ctypes.c_void_p()
    reference = ctypes.c_uint32(host.references["picture"])
    size, source = ctypes.c_size_t(PICTURE_BYTES), ctypes.c_void_p(picture.ctypes.data)
    set_binary, get_binary, instance = host.library.fmi3SetBinary, host.library.fmi3GetBinary, host.instance
    times = 50
    measured: dict[str, Callable[[], float]] = {
        "memcpy": lambda: 1e6 * loops.copy_loop(ctypes.c_void_p(target.ctypes.data), source, size, times),
        "set": lambda: 1e6 * loops.set_loop(set_binary, ctypes.c_void_p(instance), reference, source, size, times),
        "get": lambda: (
            1e6 * loops.get_loop(get_binary, ctypes.c_void_p(instance), reference, times, ctypes.byref(place))
        ),
    }
    found: dict[str, float] = {}
    benchmark.pedantic(lambda: found.update(medians(measured)), rounds=1)
    print(f"\nus of CPU for {PICTURE_BYTES / 1e6:.2f} MB: " + ", ".join(f"{n} {us:.2f}" for n, us in found.items()))
    benchmark.extra_info.update(found)
    seen = np.ctypeslib.as_array((ctypes.c_uint8 * PICTURE_BYTES).from_address(place.value or 0))
    assert np.array_equal(seen, picture)
    assert 0.0 < found["set"] < 1.3 * found["memcpy"]
    assert 0.0 < found["get"] < 0.01 * found["memcpy"]
