"""Measures a host that steps a ring of units: `python ring_hosts.py HOST N FMU`; prints us of CPU per unit and step.

Each unit's output, its input plus one, feeds the next unit. All step in parallel, from the values at the communication
point, so after k steps each output is k: that is looked at. The CPU time is that of the whole process while it steps,
of all threads; the best of several repeats. A process of its own: a host's library shares none with the tests.
"""

import contextlib
import ctypes
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Generator
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
from fmpy.fmi2 import FMU2Slave

STEPS, WARMING = 10_000, 500
MIN_REPEATS, MAX_REPEATS, ENOUGH = 3, 40, 0.5
"""A host is measured again until that has taken enough seconds of CPU: what takes milliseconds is easily disturbed."""
H = Fraction(1, 128)
REFERENCE_U, REFERENCE_Y = 1, 2


class Ring(NamedTuple):
    """A ring that is ready: how to go on by some steps, and how to read the first unit's output."""

    advance: Callable[[int], None]
    read: Callable[[], float]


Host = Callable[[int, Path, Path], contextlib.AbstractContextManager[Ring]]
"""Takes the number of units, their FMU, and a folder for files."""


@contextlib.contextmanager
def handover(
    n: int, fmu: Path, folder: Path, recorded: bool = False, compiled: bool = True
) -> Generator[Ring, None, None]:
    """Give a ring in our master."""
    from handover.cosim.master.master import Master
    from handover.cosim.record.recorder import Recorder
    from handover.cosim.stepping.options import Algorithm, MasterOptions
    from handover.cosim.system.system import System

    system = System()
    units = [system.add(f"u{i}", fmu, period=H) for i in range(n)]
    for i, unit in enumerate(units):
        system.connect(unit.y.y, units[(i + 1) % n].u.u)
    done = 0
    with contextlib.ExitStack() as stack:
        observers = [stack.enter_context(Recorder(folder / "signals.parquet"))] if recorded else []
        master = stack.enter_context(Master(system, MasterOptions(algorithm=Algorithm.JACOBI, compiled=compiled)))

        def advance(steps: int) -> None:
            nonlocal done
            done += steps
            master.run(done * H, observers)

        yield Ring(advance, lambda: float(master.signals["u0.y"]))


@contextlib.contextmanager
def ecos(n: int, fmu: Path, folder: Path, recorded: bool = False) -> Generator[Ring, None, None]:
    """Give a ring in Ecos, or, recorded, with its CSV writer."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    for i in range(n):
        structure.add_model(f"u{i}", str(fmu))
    for i in range(n):
        structure.make_real_connection(f"u{i}::y", f"u{(i + 1) % n}::u")
    simulation = EcosSimulation(structure=structure, step_size=float(H))
    if recorded:
        simulation.add_csv_writer(str(folder / "signals.csv"), identifiers=[f"u{i}::y" for i in range(n)])
    assert simulation.init()

    def advance(steps: int) -> None:
        simulation.step(steps)

    yield Ring(advance, lambda: simulation.get_real("u0::y"))
    simulation.terminate()
    simulation.free()


@contextlib.contextmanager
def libcosim(n: int, fmu: Path, folder: Path, recorded: bool = False) -> Generator[Ring, None, None]:
    """Give a ring in libcosim; the last values are observed only where they are read."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_step_size(round(H * 10**9))
    slaves = [CosimLocalSlave(str(fmu), f"u{i}") for i in range(n)]
    for slave in slaves:
        execution.add_local_slave(slave)
    for i in range(n):
        assert execution.connect_real_variables(i, REFERENCE_Y, (i + 1) % n, REFERENCE_U) == 0
    if recorded:
        assert execution.add_observer(CosimObserver.create_to_dir(str(folder)))

    def advance(steps: int) -> None:
        assert execution.step(steps)

    def read() -> float:
        observer = CosimObserver.create_last_value()
        assert execution.add_observer(observer)
        return observer.last_real_values(0, [REFERENCE_Y])[0]

    yield Ring(advance, read)


@contextlib.contextmanager
def _slaves(n: int, fmu: Path, folder: Path) -> Generator[list[Any], None, None]:
    fmpy.extract(str(fmu), str(folder))
    md: Any = fmpy.read_model_description(str(fmu))
    identity = {"guid": md.guid, "modelIdentifier": md.coSimulation.modelIdentifier, "unzipDirectory": str(folder)}
    made: list[Any] = [FMU2Slave(**identity) for _ in range(n)]
    for slave in made:
        slave.instantiate()
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
        slave.exitInitializationMode()
    yield made
    for slave in made:
        slave.terminate()
        slave.freeInstance()


@contextlib.contextmanager
def fmpy_loop(n: int, fmu: Path, folder: Path) -> Generator[Ring, None, None]:
    """Give a ring in a plain loop over FMPy's slaves."""
    with _slaves(n, fmu, folder) as slaves:
        y, done, h = [0.0] * n, 0, float(H)

        def advance(steps: int) -> None:
            nonlocal done
            for k in range(done, done + steps):
                for i, slave in enumerate(slaves):
                    slave.setReal([REFERENCE_U], [y[i - 1]])
                for slave in slaves:
                    slave.doStep(currentCommunicationPoint=k * h, communicationStepSize=h)
                for i, slave in enumerate(slaves):
                    y[i] = slave.getReal([REFERENCE_Y])[0]
            done += steps

        yield Ring(advance, lambda: y[0])


@contextlib.contextmanager
def prebuilt_calls(n: int, fmu: Path, folder: Path) -> Generator[Ring, None, None]:
    """Give a ring in a loop over ctypes calls whose arguments were made once: outputs land in the next one's inputs."""
    with _slaves(n, fmu, folder) as slaves:
        u, y = ((ctypes.c_uint * 1)(r) for r in (REFERENCE_U, REFERENCE_Y))
        values = (ctypes.c_double * n)()
        pointer = ctypes.POINTER(ctypes.c_double)
        places = [ctypes.cast(ctypes.addressof(values) + 8 * i, pointer) for i in range(n)]
        components = [slave.component for slave in slaves]
        dll = slaves[0].dll
        set_real, do_step, get_real = dll.fmi2SetReal, dll.fmi2DoStep, dll.fmi2GetReal
        sets = [(c, u, 1, places[i - 1]) for i, c in enumerate(components)]
        gets = [(c, y, 1, places[i]) for i, c in enumerate(components)]
        done, h = 0, float(H)

        def advance(steps: int) -> None:
            nonlocal done
            for k in range(done, done + steps):
                t = k * h
                for arguments in sets:
                    set_real(*arguments)
                for component in components:
                    do_step(component, t, h, 1)
                for arguments in gets:
                    get_real(*arguments)
            done += steps

        yield Ring(advance, lambda: values[0])


HOSTS: dict[str, Host] = {
    "handover": handover,
    "recorded": partial(handover, recorded=True),
    "general": partial(handover, compiled=False),
    "ecos": ecos,
    "ecos_csv": partial(ecos, recorded=True),
    "libcosim": libcosim,
    "libcosim_csv": partial(libcosim, recorded=True),
    "fmpy_loop": fmpy_loop,
    "prebuilt_calls": prebuilt_calls,
}


def measured(host: Host, n: int, fmu: Path) -> dict[str, float]:
    """Return us of CPU per unit and macro step: of a step, the best of the repeats, and of ending it all."""
    spent: list[float] = []
    with tempfile.TemporaryDirectory() as folder:
        with host(n, fmu, Path(folder)) as ring:
            ring.advance(WARMING)
            while len(spent) < MIN_REPEATS or (len(spent) < MAX_REPEATS and sum(spent) < ENOUGH):
                began = time.process_time()
                ring.advance(STEPS)
                spent.append(time.process_time() - began)
            steps = WARMING + len(spent) * STEPS
            assert steps <= ring.read() <= steps + 1, f"{host}: {ring.read()} after {steps} steps"
            began = time.process_time()
        ended = time.process_time() - began
    return {"step": 1e6 * min(spent) / (n * STEPS), "end": 1e6 * ended / (n * steps)}


if __name__ == "__main__":
    print(json.dumps(measured(HOSTS[sys.argv[1]], int(sys.argv[2]), Path(sys.argv[3]))), flush=True)
    os._exit(0)  # all is measured; Ecos' library crashes now and then as Python unloads it
