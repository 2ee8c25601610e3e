"""Units in a program in C that has no Python in it."""

import os
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from drive import STEPS, inputs, parameters
from reference import ARITHMETIC, FMI2_UNITS, Record, References, description, expect_same, variables

from handover.cosim.blocks.variable import Kind, Variable
from handover.fmus import interpreter
from handover.fmus.binaries import FMI2_FOLDERS
from handover.fmus.build import cached
from handover.fmus.catalog import UNITS
from handover.fmus.compile import RUNTIME, host_platform, library, zig_cc
from handover.fmus.layout import element_names

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="c_program.c loads libraries with dlopen"),
    pytest.mark.skipif(not interpreter.library(), reason="this Python has no shared library that a C program can load"),
]

TYPES = {Kind.REAL: "real", Kind.BOOLEAN: "boolean", Kind.BINARY: "binary"}
"""Types in a file of calls; integers and enumerations are `integer`."""

LIGHT = ("HandoverPartner", "Thrusters")
CASES = [(name, fmi) for fmi in (2, 3) for name in (FMI2_UNITS if fmi == 2 else UNITS)]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("c_program") / "c_program"
    source = Path(__file__).with_name("c_program.c")
    flags = ["-O1", "-std=gnu11", "-Wall", "-Wextra", "-Werror", "-I", str(RUNTIME), "-ldl"]
    done = zig_cc([str(source), "-o", str(made), *flags])
    assert done.returncode == 0, done.stdout
    return made


@pytest.mark.parametrize(
    ("unit", "fmi"), [c if c[0] in LIGHT else pytest.param(*c, marks=pytest.mark.slow) for c in CASES]
)
def test_a_unit_gives_the_same(references: References, program: Path, unit: str, fmi: int, tmp_path: Path):
    wanted = references.varying(unit, fmi)
    found = run(program, unit, fmi, tmp_path)
    expect_same(found.rows, wanted)
    assert found.pictures == wanted.pictures


def run(program: Path, unit: str, fmi: int, folder: Path) -> Record:
    """Let the program make a unit's run; return what it printed and wrote."""
    reader: Any = fmpy
    reader.extract(str(cached(unit, fmi)), str(folder / "unpacked"))
    result = reader.read_model_description(str(folder / "unpacked"))
    calls = Calls(unit, fmi, {v.name: v.valueReference for v in result.modelVariables}, folder)
    (folder / "calls.txt").write_text("\n".join(calls.lines()) + "\n")
    platform = FMI2_FOLDERS[host_platform()] if fmi == 2 else host_platform()
    file = unit + library(host_platform(), fmi).suffix
    resources = folder / "unpacked" / "resources"
    done = subprocess.run(
        [
            program,
            str(fmi),
            folder.joinpath("unpacked", "binaries", platform, file),
            result.guid,
            resources.as_uri() if fmi == 2 else f"{resources}/",
            folder / "calls.txt",
        ],
        env={**ARITHMETIC, "PATH": "/nonexistent", "TMPDIR": str(folder)},  # the FMU itself must know its Python
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return calls.record(done.stdout.splitlines())


class Calls:
    """The calls of one run as c_program.c reads them, and its answers."""

    def __init__(self, unit: str, fmi: int, references: Mapping[str, int], folder: Path) -> None:
        self.d, self.known, self.step = description(unit), variables(unit), float(UNITS[unit].step)
        self.fmi, self.references, self.folder = fmi, references, folder

    def lines(self) -> Iterator[str]:
        yield from self._set(parameters(self.d))
        yield from self._set(inputs(self.d, 0))
        yield "initialise"
        yield from self._get(0)
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
                elif self.fmi == 2:
                    rows[k] |= {name: float(next(answers)) for name in element_names(v)}
                else:
                    rows[k] |= zip(element_names(v), map(float, next(answers).split()), strict=True)
        assert next(answers, None) is None
        return Record(rows, pictures)

    def _set(self, values: Mapping[str, Any]) -> Iterator[str]:
        for name, value in values.items():
            v = self.known[name]
            if v.kind is Kind.BINARY:
                path = self.folder / f"{name}.bgr{len(list(self.folder.glob(f'{name}.bgr*')))}"
                path.write_bytes(value.tobytes())
                yield f"set binary {self.references[name]} {path}"
            elif v.kind is not Kind.STRING:
                numbers = [repr(float(n)) for n in np.ravel(value).tolist()]
                for reference, given in self._parts(v, numbers):
                    yield f"set {TYPES.get(v.kind, 'integer')} {reference} {len(given)} {' '.join(given)}"

    def _get(self, k: int) -> Iterator[str]:
        for v in self.d.outputs:
            if v.kind is Kind.BINARY:
                yield f"get binary {self.references[v.name]} {self._file(k, v)}"
            else:
                for reference, part in self._parts(v, [""] * v.size):
                    yield f"get {TYPES.get(v.kind, 'integer')} {reference} {len(part)}"

    def _parts(self, v: Variable, numbers: list[str]) -> Iterator[tuple[int, list[str]]]:
        """Return value references with their numbers: an array has one of its own only in FMI 3."""
        if self.fmi == 3:
            yield self.references[v.name], numbers
        else:
            for name, n in zip(element_names(v), numbers, strict=True):
                yield self.references[name], [n]

    def _file(self, k: int, v: Variable) -> Path:
        return self.folder / f"{v.name}.{k}"
