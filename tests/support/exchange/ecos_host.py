"""Steps a unit by Ecos' Python interface and prints what that costs: `python ecos_host.py JOB`, a file in JSON.

The job has the FMU, the step in s, parameters and the inputs of each step by the names of scalars, the names of the
outputs that are read by their types, and how many times these steps are made again, for each measurement. It prints the
seconds of CPU of each, those of processes that the unit has started included.
"""

import json
import os
import sys
from pathlib import Path
from typing import Any

from ecospy import EcosSimulation, EcosSimulationStructure

from support.exchange.process_cpu import cpu_seconds, family


def main(job_file: str) -> None:
    """Do a job."""
    job = json.loads(Path(job_file).read_text())
    structure = EcosSimulationStructure()
    structure.add_model("unit", job["fmu"])
    structure.add_parameter_set("driven", {f"unit::{name}": value for name, value in job["start"].items()})
    simulation: Any = EcosSimulation(structure=structure, step_size=job["step"])
    assert simulation.init(parameter_set="driven")
    setters = {bool: simulation.set_bool, int: simulation.set_integer, float: simulation.set_real}
    driven = [[(setters[type(v)], f"unit::{name}", v) for name, v in values.items()] for values in job["driven"]]
    outputs = [
        (getattr(simulation, f"get_{kind}"), f"unit::{n}") for kind, names in job["outputs"].items() for n in names
    ]
    spent: list[float] = []
    processes = family()
    for times in job["repeats"]:
        began = cpu_seconds(processes)
        for _ in range(times):
            for values in driven:
                for function, name, value in values:
                    function(name, value)
                simulation.step(1)
                for function, name in outputs:
                    function(name)
        spent.append(cpu_seconds(processes) - began)
    print(json.dumps(spent), flush=True)
    os._exit(0)  # Ecos' library crashes now and then as Python unloads it


if __name__ == "__main__":
    main(*sys.argv[1:])
