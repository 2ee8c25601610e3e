"""Wires 1,000 units, each fed by the five before it: `python wiring_hosts.py FMU`; prints s of CPU by part.

Beside it stand the same units in FMPy, loaded and initialised alone, that wires nothing. A process of its own has no
objects of other tests for the garbage collector to go through, which would be charged to what is measured.
"""

import json
import sys
import tempfile
import time
from fractions import Fraction
from pathlib import Path
from typing import Any

import fmpy
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave

from handover.cosim.master.master import Master
from handover.cosim.system.schedule import Schedule
from handover.cosim.system.system import System

UNITS, FED_BY, ROUNDS = 1000, 5, 2
STAGES = ("adding and connecting", "checking", "schedule", "checked and scheduled again, loaded, initialised")


def ours(fmu: Path) -> dict[str, float]:
    """Return what it costs to wire the units until they are loaded and initialised, in seconds of CPU by stage."""
    marks = [time.process_time()]
    system = System()
    units = [system.add(f"u{i}", fmu, period=Fraction(1, 100)) for i in range(UNITS)]
    for i, unit in enumerate(units):
        for j in range(FED_BY):
            system.connect(units[i - 1 - j].y.y, getattr(unit.u, f"u{j + 1}"))
    marks.append(time.process_time())
    system.check()
    marks.append(time.process_time())
    Schedule(system)
    marks.append(time.process_time())
    with Master(system) as master:
        marks.append(time.process_time())
        master.run(Fraction(1, 100))
        assert [float(master.signals[f"u{i}.y"]) for i in range(7)] == [1, 2, 4, 8, 16, 32, 63]
    return {what: after - before for what, before, after in zip(STAGES, marks[:-1], marks[1:], strict=True)}


def of_fmpy(fmu: Path) -> float:
    """Return what FMPy takes to load and initialise the units, in seconds of CPU."""
    with tempfile.TemporaryDirectory() as folder:
        before = time.process_time()
        fmpy.extract(str(fmu), folder)
        description: Any = fmpy.read_model_description(str(fmu))
        identity = {
            "guid": description.guid,
            "modelIdentifier": description.coSimulation.modelIdentifier,
            "unzipDirectory": folder,
        }
        made: list[Any] = []
        for i in range(UNITS):
            if description.fmiVersion.startswith("2"):
                unit: Any = FMU2Slave(**identity, instanceName=f"u{i}")
                unit.instantiate()
                unit.setupExperiment(startTime=0.0)
                unit.enterInitializationMode()
            else:
                unit = FMU3Slave(**identity, instanceName=f"u{i}")
                unit.instantiate()
                unit.enterInitializationMode(startTime=0.0)
            unit.exitInitializationMode()
            made.append(unit)
        spent = time.process_time() - before
        for unit in made:
            unit.terminate()
            unit.freeInstance()
    return spent


if __name__ == "__main__":
    path = Path(sys.argv[1])
    wired = min((ours(path) for _ in range(ROUNDS)), key=lambda stages: sum(stages.values()))
    print(json.dumps({"ours": wired, "FMPy": min(of_fmpy(path) for _ in range(ROUNDS))}))
