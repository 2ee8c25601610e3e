"""Units in a program in C that has no Python in it: the calls of a run as its file lists them, and its answers."""

import itertools
import subprocess
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import fmpy
import numpy as np

from handover.cosim.blocks.variable import Kind, Variable
from handover.fmus.binaries import FMI2_FOLDERS
from handover.fmus.catalog import UNITS
from handover.fmus.compile import host_platform, library
from handover.fmus.layout import element_names
from support.c_programs import compiled
from support.exchange.drive import STEPS, inputs, parameters
from support.exchange.process_cpu import cpu_seconds, family
from support.exchange.reference import ARITHMETIC, Record, description, variables

TYPES = {"Real": "real", "Float64": "real", "Boolean": "boolean", "Int32": "integer32"}
"""Types in a file of calls, by those of the standards; the other integers, and enumerations, are `integer`."""

LIMIT = 300.0
"""Seconds after which a run is ended."""


PROGRAM = Path(__file__).with_name("c_program.c")
FLAGS = ("-Wall", "-Wextra", "-Werror")


def run_and_repeat(unit: str, fmu: Path, folder: Path, repeats: Sequence[int]) -> tuple[Record, list[float]]:
    """Let the program make a unit's run, and then its steps again, some number of times, as often as there are numbers.

    Returns:
        What it printed and wrote of the run, and of each repetition the seconds of CPU, those of processes that the
        unit has started included.
    """
    reader: Any = fmpy
    reader.extract(str(fmu), str(folder / "unpacked"))
    item = reader.read_model_description(str(folder / "unpacked"))
    fmi = int(float(item.fmiVersion))
    calls = Calls(unit, {v.name: (v.valueReference, v.type) for v in item.modelVariables}, folder)
    repeated = [f"repeat {times}" for times in (0, *repeats)] if repeats else []
    (folder / "calls.txt").write_text("\n".join([*calls.lines(), *repeated]) + "\n")
    platform = FMI2_FOLDERS[host_platform()] if fmi == 2 else host_platform()
    file = unit + library(host_platform(), fmi).suffix
    resources = folder / "unpacked" / "resources"
    command = [
        compiled(PROGRAM, flags=FLAGS),
        str(fmi),
        folder.joinpath("unpacked", "binaries", platform, file),
        item.guid,
        resources.as_uri() if fmi == 2 else f"{resources}/",
        folder / "calls.txt",
    ]
    printed, spent = _watched(command, {**ARITHMETIC, "PATH": "/nonexistent", "TMPDIR": str(folder)}, folder)
    return calls.record(printed), spent


def _watched(command: Sequence[Any], environment: Mapping[str, str], folder: Path) -> tuple[list[str], list[float]]:
    """Return what a program prints besides `repeated`, and the seconds of CPU between two of these.

    The environment must be one in which an FMU itself has to know its Python.
    """
    lines: list[str] = []
    seen: list[float] = []
    with (folder / "errors.txt").open("w+") as errors:
        host = subprocess.Popen(
            command, env=dict(environment), stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True
        )
        limit = threading.Timer(LIMIT, host.kill)
        limit.start()
        with host:
            assert host.stdin is not None
            assert host.stdout is not None
            for line in host.stdout:
                if line == "repeated\n":
                    seen.append(cpu_seconds(family(host.pid)))
                    host.stdin.write("\n")
                    host.stdin.flush()
                else:
                    lines.append(line.rstrip("\n"))
        limit.cancel()
        errors.seek(0)
        assert host.returncode == 0, f"it ended with {host.returncode}: {errors.read()}" + "\n".join(lines[-9:])
    return lines, [after - before for before, after in itertools.pairwise(seen)]


class Calls:
    """The calls of one run as c_program.c reads them, and its answers."""

    def __init__(self, unit: str, references: Mapping[str, tuple[int, str]], folder: Path) -> None:
        self.d, self.known, self.step = description(unit), variables(unit), float(UNITS[unit].step)
        self.references, self.folder = references, folder

    def lines(self) -> Iterator[str]:
        yield from self._set(parameters(self.d))
        yield from self._set(inputs(self.d, 0))
        yield "initialise"
        yield from self._get(0)
        yield "cycle"
        for k in range(STEPS):
            yield from self._set(inputs(self.d, k))
            yield f"step {k * self.step!r} {self.step!r}"
            yield from self._get(k + 1)

    def record(self, printed: list[str]) -> Record:
        """Return the values that were printed, and the pictures that lie in files."""
        answers = iter(printed)
        rows: list[dict[str, float]] = []
        pictures: list[dict[str, bytes]] = []
        for k in range(STEPS + 1):
            rows.append({})
            pictures.append({})
            for v in self.d.outputs:
                if v.kind is Kind.BINARY:
                    pictures[k][v.name] = self._file(k, v).read_bytes()
                    assert int(next(answers)) == len(pictures[k][v.name])
                elif v.name in self.references:
                    rows[k] |= zip(element_names(v), map(float, next(answers).split()), strict=True)
                else:
                    rows[k] |= {name: float(next(answers)) for name in element_names(v)}
        assert next(answers, None) is None
        return Record(rows, pictures)

    def _set(self, values: Mapping[str, Any]) -> Iterator[str]:
        for name, value in values.items():
            v = self.known[name]
            if v.kind is Kind.BINARY:
                path = self.folder / f"{name}.bgr{len(list(self.folder.glob(f'{name}.bgr*')))}"
                path.write_bytes(value.tobytes())
                yield f"set binary {self.references[name][0]} {path}"
            elif v.kind is not Kind.STRING:
                numbers = [repr(float(n)) for n in np.ravel(value).tolist()]
                for variable, given in self._parts(v, numbers):
                    yield f"set {variable} {len(given)} {' '.join(given)}"

    def _get(self, k: int) -> Iterator[str]:
        for v in self.d.outputs:
            if v.kind is Kind.BINARY:
                yield f"get binary {self.references[v.name][0]} {self._file(k, v)}"
            else:
                for variable, part in self._parts(v, [""] * v.size):
                    yield f"get {variable} {len(part)}"

    def _parts(self, v: Variable, numbers: list[str]) -> Iterator[tuple[str, list[str]]]:
        """Return types and value references with their numbers: an array has one of its own only in FMI 3."""
        if v.name in self.references:
            yield self._typed(v.name), numbers
        else:
            for name, n in zip(element_names(v), numbers, strict=True):
                yield self._typed(name), [n]

    def _typed(self, name: str) -> str:
        reference, fmi_type = self.references[name]
        return f"{TYPES.get(fmi_type, 'integer')} {reference}"

    def _file(self, k: int, v: Variable) -> Path:
        return self.folder / f"{v.name}.{k}"
