"""Runs a system in libcosim: `python libcosim_host.py JOB RESULT`, both files in JSON, written and read by `Job`.

A process of its own, which cannot take the tests with it; it knows of this project no more than the files say.
"""

import json
import sys
from pathlib import Path
from typing import Any

from libcosimpy._internal import get_last_error_message
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

from support.exchange.process_cpu import cpu_seconds, family


def main(job_file: str, result_file: str) -> None:
    """Run a job."""
    job = json.loads(Path(job_file).read_text())
    log_output_level(CosimLogLevel.ERROR)
    execution = loaded(job) if job["ssp"] else assembled(job)
    slaves = {info.name.decode(): info.index for info in execution.slave_infos()}
    places = [slaves[unit["name"]] for unit in job["units"]]
    observer, manipulator = CosimObserver.create_last_value(), CosimManipulator.create_override()
    check(execution.add_observer(observer))
    check(execution.add_manipulator(manipulator))

    def advance(k: int) -> list[Any]:
        for i, unit in zip(places, job["units"], strict=True):
            for kind, values in unit["driven"][k].items():
                references, numbers = zip(*values, strict=True)
                check(getattr(manipulator, f"slave_{kind}_values")(i, list(references), list(numbers)))
        check(execution.step())
        return [read(observer, i, unit["outputs"]) for i, unit in zip(places, job["units"], strict=True)]

    rows = [advance(k) for k in range(job["steps"])]
    spent: list[float] = []
    processes = family()
    for times in job["repeats"]:
        began = cpu_seconds(processes)
        for k in range(times * job["steps"]):
            advance(k % job["steps"])
        spent.append(cpu_seconds(processes) - began)
    Path(result_file).write_text(json.dumps({"rows": rows, "spent": spent}))


def loaded(job: Any) -> CosimExecution:
    """Return the system of a job's SSP."""
    try:
        return CosimExecution.from_ssp_file(job["ssp"], job["step"])
    except AssertionError:  # libcosimpy's, which does not say why
        raise SystemExit(get_last_error_message()) from None


def assembled(job: Any) -> CosimExecution:
    """Return a system of a job's units, started as it says."""
    execution = CosimExecution.from_step_size(job["step"])
    slaves = [CosimLocalSlave(unit["fmu"], unit["name"]) for unit in job["units"]]
    for slave in slaves:
        if not slave.ptr():
            raise SystemExit(get_last_error_message())
        execution.add_local_slave(slave)
    for i, unit in enumerate(job["units"]):
        for kind, values in unit["initial"].items():
            for reference, value in values:
                check(getattr(execution, f"{kind}_initial_value")(i, reference, value))
    return execution


def read(observer: CosimObserver, slave: int, outputs: dict[str, list[int]]) -> dict[str, list[Any]]:
    """Return a slave's outputs, by kind."""
    return {kind: getattr(observer, f"last_{kind}_values")(slave, refs) for kind, refs in outputs.items()}


def check(is_done: bool) -> None:
    """Stop with libcosim's words if something was not done."""
    if not is_done:
        raise SystemExit(get_last_error_message())


main(*sys.argv[1:])
