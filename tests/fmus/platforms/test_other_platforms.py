"""A unit on other platforms, emulated: where there is no Python it says so, and nothing that a host calls crashes."""

import os
import shutil
import subprocess
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from pathlib import Path

import pytest
from support.fmus.foreign import compile_program, compiled_host, expect_clear_answers, unpack

from handover.fmus.catalog import Entry

ENTRY = Entry("Scalars", "support.sample_units.scalars:Scalars", Fraction(1, 100), "for a test")
QEMU = shutil.which("qemu-aarch64")
AARCH64_LIBRARIES = Path("/usr/aarch64-linux-gnu")

INTERPRETER = r"""
#include <stdio.h>
int main(int argc, char **argv) {
    fprintf(stderr, "library = of the wrong stream\n");
    printf("executable = \nlibrary = %s.dll\n", argc > 1 ? argv[1] : "no script");
    return 0;
}
"""
"""Answers as fmus/interpreter.py does, and with a library that is named like the script it was given."""


def run(command: Sequence[str | Path], environment: Mapping[str, str], folder: Path) -> str:
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "FMU_"))}
    done = subprocess.run(
        command, env={**kept, **environment}, cwd=folder, capture_output=True, text=True, check=False, timeout=150
    )
    assert done.returncode == 0, f"{done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout


@pytest.fixture
def wine(tmp_path: Path) -> Iterator[dict[str, str]]:
    """Return the environment of a Windows of its own, whose processes end with the test."""
    environment = {"WINEPREFIX": str(tmp_path / "windows"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
    yield environment
    subprocess.run(["wineserver", "-k", "-w"], env={**os.environ, **environment}, check=False, timeout=60)


@pytest.mark.skipif(not (shutil.which("wine") and shutil.which("wineserver")), reason="wine is not installed")
@pytest.mark.parametrize("fmi", [pytest.param(2, marks=pytest.mark.slow), pytest.param(3, marks=pytest.mark.platforms)])
def test_windows(fmi: int, tmp_path: Path, wine: dict[str, str]):
    unit = unpack(ENTRY, fmi, "x86_64-windows", tmp_path)
    host = compiled_host(fmi, "x86_64-windows", tmp_path)
    resources = unit.folder / "resources"
    place = f"file:///Z:{resources.as_uri()[7:]}" if fmi == 2 else f"Z:{resources}/".replace("/", "\\")
    output = run(["wine", host, f"Z:{unit.library}", unit.token, place], wine, tmp_path)
    expect_clear_answers(output, fmi)
    assert "resources/python.txt: " in output
    assert "resources/python.txt: cannot be read" not in output
    assert "python on the PATH: cannot be read" in output


@pytest.mark.platforms
@pytest.mark.skipif(not (shutil.which("wine") and shutil.which("wineserver")), reason="wine is not installed")
def test_windows_asks_the_interpreter_on_the_path(tmp_path: Path, wine: dict[str, str]):
    unit = unpack(ENTRY, 2, "x86_64-windows", tmp_path)
    (unit.folder / "resources" / "python.txt").unlink()
    host = compiled_host(2, "x86_64-windows", tmp_path)
    source = tmp_path / "python.c"
    source.write_text(INTERPRETER)
    compile_program(source, tmp_path / "python.exe", "x86_64-windows")  # a program's own folder comes before the PATH
    resources = f"file:///Z:{(unit.folder / 'resources').as_uri()[7:]}"
    output = run(["wine", host, f"Z:{unit.library}", unit.token, resources], wine, tmp_path)
    script = f"Z:{unit.folder}/resources/sources/handover/fmus/interpreter.py"
    assert f"python on the PATH: {script}.dll: LoadLibrary failed with code" in output


aarch64 = pytest.mark.skipif(
    not (QEMU and AARCH64_LIBRARIES.is_dir()),
    reason="qemu-user and AArch64's C library are not installed",
)


def on_aarch64(fmi: int, folder: Path, environment: Mapping[str, str]) -> str:
    """Return what the host prints; a process that it starts is of this machine's own kind."""
    unit = unpack(ENTRY, fmi, "aarch64-linux", folder)
    host = compiled_host(fmi, "aarch64-linux", folder)
    resources = unit.folder / "resources"
    place = resources.as_uri() if fmi == 2 else f"{resources}/"
    emulator = [str(QEMU), "-L", str(AARCH64_LIBRARIES)]
    return run([*emulator, host, unit.library, unit.token, place], {"PATH": "/nonexistent", **environment}, folder)


@aarch64
@pytest.mark.platforms
@pytest.mark.parametrize("fmi", [2, 3])
def test_linux_on_aarch64(fmi: int, tmp_path: Path):
    output = on_aarch64(fmi, tmp_path, {"FMU_PYTHON_PROCESS": "0"})
    expect_clear_answers(output, fmi)
    assert "resources/python.txt: cannot be read" not in output
    assert "python3 on the PATH: cannot be read" in output


@aarch64
@pytest.mark.parametrize("fmi", [pytest.param(2, marks=pytest.mark.platforms), pytest.param(3, marks=pytest.mark.slow)])
def test_linux_on_aarch64_starts_a_process_for_python(fmi: int, tmp_path: Path):
    output = on_aarch64(fmi, tmp_path, {})
    assert output.count("instance: made") == 2
    assert output.rstrip().endswith("closed: 0")
