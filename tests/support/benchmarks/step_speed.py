"""Measures what a step costs, ours and other packages' in turns, in a process of its own, and prints it as JSON.

`python step_speed.py LOOPS ROUNDS NAME=FMU ...`; LOOPS is the library made of step_loop.c. A NAME
begins with `FMI 2`, `FMI 3`, `pythonfmu` or `pythonfmu3`; with ` apart` at its end Python
runs in a process of its own. It prints microseconds a step: of CPU of the calling thread, and of wall time; medians.
Other packages' libraries share no process with the tests: what they leave in the heap is not the tests' concern.
"""

import argparse
import ctypes
import gc
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from support.fmus.ctypes_host import OK, CtypesHost
from support.sample_units.scalars import Inputs, Params, Scalars

DT = 1 / 128
STEPS = 20_000
N_INPUTS, N_OUTPUTS = 12, 13
INPUTS, OUTPUTS = [f"u{i + 1}" for i in range(N_INPUTS)], [f"y{i + 1}" for i in range(N_OUTPUTS)]

Measured = tuple[float, float]
"""CPU and wall time."""


def assignments(to: str, source: str) -> list[str]:
    """Return the lines of a peer's step."""
    return [f"        self.{y} = {source}{u}" for y, u in zip(OUTPUTS, INPUTS, strict=False)] + [f"        self.{to}"]


def open_host(name: str, fmu: Path) -> CtypesHost:
    """Return a host with an instance."""
    fmi = 3 if name.startswith(("FMI 3", "pythonfmu3")) else 2
    os.environ["FMU_PYTHON_PROCESS"] = str(int(name.endswith(" apart")))
    if name.startswith("FMI"):
        host = CtypesHost(fmu, fmi)
    else:
        host = CtypesHost(fmu, fmi, prefix="peer")  # it crashes in folders of other names
        memory = ctypes.CDLL(None)  # which pythonfmu leaves to the host
        host.callbacks.allocate = ctypes.cast(memory.calloc, ctypes.c_void_p)
        host.callbacks.free = ctypes.cast(memory.free, ctypes.c_void_p)
    assert host.instantiate(), host.log
    return host


def fmu_loop(loops: ctypes.CDLL, host: CtypesHost) -> Callable[[], Measured]:
    """Return a function that makes a round of steps in C and returns microseconds a step."""
    assert host.initialise() == OK
    kind = "Real" if host.fmi == 2 else "Float64"
    functions = [getattr(host.library, f"fmi{host.fmi}{name}") for name in (f"Set{kind}", "DoStep", f"Get{kind}")]
    inputs = (ctypes.c_uint32 * N_INPUTS)(*(host.references[n] for n in INPUTS))
    outputs = (ctypes.c_uint32 * N_OUTPUTS)(*(host.references[n] for n in OUTPUTS))
    y, at = (ctypes.c_double * N_OUTPUTS)(), [0.0]
    loop = getattr(loops, f"loop{host.fmi}")
    loop.restype = ctypes.c_double

    def run() -> Measured:
        t, dt = ctypes.c_double(at[0]), ctypes.c_double(DT)
        begin = time.perf_counter()
        spent = loop(*functions, ctypes.c_void_p(host.instance), inputs, outputs, t, dt, STEPS, y)
        wall = (time.perf_counter() - begin) / STEPS
        at[0] += STEPS * DT
        assert spent > 0.0, host.log[-1:]
        assert list(y) == [STEPS - 1 + 0.5 * i for i in range(N_INPUTS)] + [at[0]]
        return 1e6 * spent, 1e6 * wall

    return run


def timed(body: list[str], names: dict[str, object]) -> Callable[[], Measured]:
    """Return a function that runs the lines STEPS times and returns microseconds each."""
    lines = ["def run(k_last):", "    for k in range(k_last):", *(f"        {line}" for line in body)]
    exec("\n".join(lines), names)
    run: Callable[[int], None] = names["run"]  # type: ignore

    def measure() -> Measured:
        begin, wall = time.thread_time(), time.perf_counter()
        run(STEPS)
        return 1e6 * (time.thread_time() - begin) / STEPS, 1e6 * (time.perf_counter() - wall) / STEPS

    return measure


def plain_loop() -> Callable[[], Measured]:
    """Return what does to the block itself what a host does to its FMU."""
    inputs = [f"u.u{i + 1} = k + {0.5 * i}" for i in range(N_INPUTS)]
    names: dict[str, object] = {"u": Inputs(), "block": Scalars(Params()), "DT": DT}
    return timed([*inputs, "y = block.step(k * DT, DT, u)"], names)


def plain_peer_loop() -> Callable[[], Measured]:
    """Return the same for the object that the other packages step: it keeps inputs and outputs itself."""
    names: dict[str, object] = {"DT": DT}
    body = "\n".join(assignments("y13 = current_time + step_size", "self."))
    exec(
        f"class Peer:\n    def do_step(self, current_time, step_size):\n{body}\n        return True\npeer = Peer()",
        names,
    )
    inputs = [f"peer.u{i + 1} = k + {0.5 * i}" for i in range(N_INPUTS)]
    return timed([*inputs, "peer.do_step(k * DT, DT)"], names)


def medians(measured: Mapping[str, Callable[[], Any]], rounds: int) -> dict[str, Any]:
    """Return the medians of what each returns, numbers or lists of them, measured in turns."""
    rows: dict[str, list[Any]] = {name: [] for name in measured}
    gc.collect()
    for _ in range(rounds):
        for name, run in measured.items():
            rows[name].append(run())
    return {name: np.median(row, axis=0).tolist() for name, row in rows.items()}


def main() -> int:
    parser = argparse.ArgumentParser()
    parser.add_argument("loops", type=Path)
    parser.add_argument("rounds", type=int)
    parser.add_argument("units", nargs="*", metavar="NAME=FMU")
    a = parser.parse_args()
    loops = ctypes.CDLL(str(a.loops))
    units = [unit.partition("=") for unit in a.units]
    hosts = {name: open_host(name, Path(fmu)) for name, _, fmu in units}
    measured = {name: fmu_loop(loops, host) for name, host in hosts.items()}
    found = medians(measured | {"plain block": plain_loop(), "plain peer": plain_peer_loop()}, a.rounds)
    for host in hosts.values():
        host.close()
    print(json.dumps(found), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
