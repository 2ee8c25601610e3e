"""A unit's run in each host, and what its steps cost there: outputs to compare, and seconds of CPU of steps made again.

All hosts make the STEPS steps of `drive`, and then the same steps again, over and over, while CPU time is taken.
"""

import json
import os
import subprocess
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Any

from handover.cosim.blocks.description import Description
from handover.cosim.blocks.variable import Kind, element_names
from handover.cosim.fmu.file.description import describe_fmu
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import Algorithm, MasterOptions
from handover.fmus.build import build, build_block, cached
from handover.fmus.catalog import UNITS, Entry
from support.exchange import drive
from support.exchange.c_program import run_and_repeat
from support.exchange.container import outputs_of, put_into_container
from support.exchange.ecos_command import Ecos
from support.exchange.fmpy_rows import FmpyInstance
from support.exchange.libcosim_job import Job
from support.exchange.own_master import Placed
from support.exchange.process_cpu import cpu_seconds, family
from support.exchange.reference import Record, References, description, variables
from support.exchange.systems import Wired
from support.processes import program, with_path


class Form(Enum):
    """What can be built of a unit."""

    FMI2 = "FMI 2"
    FMI3 = "FMI 3"
    SCALAR = "scalar FMI 3"
    STANDALONE = "standalone"


@dataclass(frozen=True)
class Case:
    """A unit in a form.

    Attributes:
        fmu: gives its file, in the standard that is named where the form has both.
        repeats: how many times the steps are made again, for each measurement.
    """

    unit: str
    form: Form
    fmu: Callable[[int], Path]
    references: References
    repeats: Sequence[int]

    @property
    def entry(self) -> Entry:
        """The unit in the catalog."""
        return UNITS[self.unit]

    @property
    def step(self) -> float:
        """Length of a step, s."""
        return float(self.entry.step)

    @property
    def declared(self) -> Description:
        """What the unit's block declares."""
        return description(self.unit)

    def driven(self) -> list[drive.Values]:
        """Return the inputs of each step."""
        return [drive.inputs(self.declared, k) for k in range(drive.STEPS)]


@dataclass(frozen=True)
class HostRun:
    """What a host gave.

    Attributes:
        found: outputs from a communication point on.
        first: number of that point.
        spent: seconds of CPU of each repetition.
        held: whether the inputs of step 0 held all the time.
    """

    found: Record
    spent: Sequence[float]
    first: int = 0
    held: bool = False


class CannotGive(Exception):
    """A host cannot give a unit some kind of inputs."""


def fmu_of(unit: str, form: Form, fmi: int, folder: Path) -> Path:
    """Return a unit's file; `fmi` counts where the form has both standards."""
    if form is Form.STANDALONE:
        built = folder / f"{unit}.fmi{fmi}-standalone.fmu"
        return built if built.is_file() else build(UNITS[unit], fmi, folder, standalone=True)
    return cached(unit, 2 if form is Form.FMI2 else 3, scalar=form is Form.SCALAR)


def in_our_master(case: Case, folder: Path) -> HostRun:  # noqa: ARG001
    """Run in our own master, inputs out of another unit; the cost is that of the process but for this one's steps."""
    fmu = case.fmu(3)
    found = case.references.varying_in(case.unit, fmu)
    spent: list[float] = []
    options = MasterOptions(algorithm=Algorithm.JACOBI, cpu_times=True)
    with Master(case.references.played(case.unit, fmu), options) as master:
        done = drive.STEPS
        master.run(done * case.entry.step)
        processes = family()
        for times in case.repeats:
            steps, began = times * drive.STEPS, cpu_seconds(processes)
            done += steps
            master.run(done * case.entry.step)
            of_all = cpu_seconds(processes) - began
            spent.append(of_all - sum(master.cpu.get("player", [])[-steps:]))
    return HostRun(found, spent)


def in_fmpy(case: Case, folder: Path) -> HostRun:
    """Run in FMPy, call by call."""
    return _called_in_fmpy(case.fmu(3), folder, case, drive.parameters(case.declared), case.driven())


def in_libcosim(case: Case, folder: Path) -> HostRun:
    """Run in libcosim, by its Python interface."""
    fmu, driven = case.fmu(2), case.driven()
    if describe_fmu(fmu).fmi == 3:  # to hear what it says
        return HostRun(Record(Job({"unit": Placed(fmu)}, case.entry.step, drive.STEPS).run(folder)["unit"], []), [])
    placed = Placed(fmu, {**drive.parameters(case.declared), **driven[0]})
    job = Job({"unit": placed}, case.entry.step, drive.STEPS, driven={"unit": driven})
    rows, spent = job.run_and_repeat(folder, case.repeats)
    return HostRun(Record(rows["unit"], []), spent, first=1)


def in_ecos(case: Case, folder: Path) -> HostRun:
    """Run in Ecos' command line, and for the cost by its Python interface.

    Raises:
        CannotGive: the unit has inputs that are pictures.
    """
    ecos, fmu = Ecos(folder), case.fmu(2)
    if any(v.kind is Kind.BINARY for v in case.declared.inputs):
        raise CannotGive("pictures")
    notary = build_block("support.exchange.notary:Notary", 2, folder / "notary", step=case.entry.step)
    rows = ecos.outputs(folder, case.unit, fmu, notary)
    job = folder / "job.json"
    job.write_text(json.dumps(_ecos_job(case, fmu)))
    environment = {**with_path(), **ecos.environment, "PATH": f"{ecos.environment['PATH']}:{os.environ['PATH']}"}
    done = subprocess.run(
        program("exchange/ecos_host.py", job),
        env=environment,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        cwd=folder,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return HostRun(Record(rows, []), json.loads(done.stdout.splitlines()[-1]))


def in_container(case: Case, folder: Path) -> HostRun:
    """Run inside an FMU of fmu-manipulation-toolbox, which FMPy runs."""
    fmu = case.fmu(2)
    d, driven, start = describe_fmu(fmu), case.driven(), drive.parameters(case.declared)
    held = any(port.shape and len(port.references) == 1 for port in d.inputs.values())  # which a container leaves alone
    placed = Placed(fmu, {**start, **driven[0]} if held else start)
    container = put_into_container(Wired({"unit": placed}, [], case.entry.step), d.fmi, folder)
    given: list[drive.Values] = [{} if held else {f"unit_{n}": x for n, x in values.items()} for values in driven]
    run = _called_in_fmpy(container, folder, case, {}, given)
    found = Record(outputs_of("unit", run.found.rows), outputs_of("unit", run.found.pictures))
    return HostRun(found, run.spent, held=held)


def in_c_program(case: Case, folder: Path) -> HostRun:
    """Run in a program in C."""
    found, spent = run_and_repeat(case.unit, case.fmu(3), folder, case.repeats)
    return HostRun(found, spent)


HOSTS: Mapping[str, Callable[[Case, Path], HostRun]] = {
    "our master": in_our_master,
    "FMPy": in_fmpy,
    "libcosim": in_libcosim,
    "Ecos": in_ecos,
    "fmu-manipulation-toolbox": in_container,
    "C program": in_c_program,
}


def _called_in_fmpy(
    fmu: Path, folder: Path, case: Case, start: Mapping[str, Any], driven: Sequence[drive.Values]
) -> HostRun:
    spent: list[float] = []
    with FmpyInstance(fmu, folder / "unpacked", case.step, start, driven[0]) as instance:
        cycle = [instance.calls(values) for values in driven]
        got = [instance.outputs(), *map(instance.advance, cycle)]
        processes = family()
        for times in case.repeats:
            began = cpu_seconds(processes)
            for _ in range(times):
                for calls in cycle:
                    instance.advance(calls)
            spent.append(cpu_seconds(processes) - began)
        return HostRun(instance.record(got), spent)


def _ecos_job(case: Case, fmu: Path) -> dict[str, Any]:
    """Return the job of `ecos_host.py`; without enumerations, which Ecos does not know."""
    known = {name: v for name, v in variables(case.unit).items() if v.kind is not Kind.ENUMERATION}

    def scalars(values: Mapping[str, Any]) -> dict[str, Any]:
        return drive.scalars(known, {n: x for n, x in values.items() if n in known})

    kinds = {"real": Kind.REAL, "integer": Kind.INTEGER, "bool": Kind.BOOLEAN}
    outputs = [v for v in case.declared.outputs if v.name in known]
    names = {called: [n for v in outputs if v.kind is kind for n in element_names(v)] for called, kind in kinds.items()}
    driven = case.driven()
    return {
        "fmu": str(fmu),
        "step": case.step,
        "start": scalars({**drive.parameters(case.declared), **driven[0]}),
        "driven": [scalars(values) for values in driven],
        "outputs": names,
        "repeats": list(case.repeats),
    }
