"""Exudyn is imported on machines without a screen, in any host, and nothing else changes."""

import os
import shlex
import subprocess
import sys
import zipfile
from pathlib import Path

import lief
import pytest
from support.c_programs import compiled

from handover.fmus import interpreter
from handover.fmus.build import cached
from handover.plants.helix.arm.empty_library import empty_library

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="Exudyn's wheel wants these libraries on Linux")

ROOT = Path(__file__).parents[3]
OF_A_SCREEN = ("libGL.so.1", "libX11.so.6")
LOAD_ONE = """
from handover.plants.helix.arm.empty_library import can_be_loaded, load_empty
print(can_be_loaded("libof_nothing.so.7"))
load_empty("libof_nothing.so.7")
print(can_be_loaded("libof_nothing.so.7"))
"""
LOAD_REAL = f"""
from handover.plants.helix.arm.empty_library import can_be_loaded
for name in {OF_A_SCREEN}:
    can_be_loaded(name)
for line in open("/proc/self/maps"):
    print(line.split()[-1])
"""
COMPARE = """
import sys
before = sys.getdlopenflags()
import handover.plants.helix.arm.exudyn_edge
print(sys.getdlopenflags() == before, any("libglfw" in line for line in open("/proc/self/maps")))
"""


def files_of_a_screen() -> "list[str]":
    """Return the files of the libraries of a screen; asked of a process of its own, as this one may have empty ones."""
    maps = call(sys.executable, "-c", LOAD_REAL).stdout.splitlines()
    return sorted({file for file in maps if os.path.basename(file).startswith(OF_A_SCREEN)})


@pytest.fixture(scope="module")
def without_screen(tmp_path_factory: pytest.TempPathFactory) -> "list[str]":
    """Return the beginning of a command in which the libraries of a screen cannot be loaded."""
    real = files_of_a_screen()
    if not real:
        return []
    nothing = tmp_path_factory.mktemp("screen") / "nothing"
    nothing.touch()
    hide = " && ".join(f"mount --bind {shlex.quote(str(nothing))} {shlex.quote(file)}" for file in real)
    command = ["unshare", "--map-root-user", "--mount", "sh", "-c", f'{hide} && exec "$@"', "sh"]
    if subprocess.run([*command, "true"], check=False, capture_output=True).returncode:
        pytest.skip("libGL.so.1 is on this machine, and mount namespaces to hide it in are not allowed")
    return command


def call(*command: object, **environment: str) -> "subprocess.CompletedProcess[str]":
    env, one_stream = {**os.environ, **environment}, {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    return subprocess.run([str(part) for part in command], cwd=ROOT, env=env, text=True, check=False, **one_stream)


@pytest.mark.parametrize(("machine", "arch"), [("x86_64", lief.ELF.ARCH.X86_64), ("aarch64", lief.ELF.ARCH.AARCH64)])
def test_an_empty_library_is_a_library_of_its_name(machine: str, arch: lief.ELF.ARCH):
    library = lief.ELF.parse(list(empty_library("libGL.so.1", machine)))
    assert library is not None
    assert (library.header.machine_type, library.header.file_type) == (arch, lief.ELF.Header.FILE_TYPE.DYN)
    names = [entry.name for entry in library.dynamic_entries if isinstance(entry, lief.ELF.DynamicSharedObject)]
    assert names == ["libGL.so.1"]
    assert [symbol.name for symbol in library.dynamic_symbols if symbol.name] == library.libraries == []
    stack = library.get(lief.ELF.Segment.TYPE.GNU_STACK)
    assert stack is not None
    assert not stack.has(lief.ELF.Segment.FLAGS.X)


@pytest.mark.machine
def test_it_counts_as_loaded_by_its_name():
    done = call(sys.executable, "-c", LOAD_ONE)
    assert done.stdout.split() == ["False", "True"]


@pytest.mark.machine
def test_without_a_screen_exudyn_is_loaded_which_alone_wants_one_and_its_windows_are_not(without_screen: "list[str]"):
    assert "libGL.so.1" in call(*without_screen, sys.executable, "-c", "import exudyn").stdout
    assert call(*without_screen, sys.executable, "-c", COMPARE).stdout.split() == ["True", "False"]


def test_with_a_screen_the_real_libraries_are_taken():
    if len(files_of_a_screen()) < len(OF_A_SCREEN):
        pytest.skip("libGL.so.1 or libX11.so.6 is missing (Debian: libgl1)")
    assert call(sys.executable, "-c", COMPARE).stdout.split() == ["True", "True"]


@pytest.mark.machine
def test_without_a_screen_an_arm_runs_in_a_host_that_is_not_python(without_screen: "list[str]", tmp_path: Path):
    with zipfile.ZipFile(cached("TendonArm", 2)) as archive:
        archive.extractall(tmp_path / "arm")
    program = compiled(ROOT / "docs" / "c_host" / "main.c")
    for own_process in ("0", "1") if interpreter.library() else ("1",):  # else Python has no shared library
        done = call(*without_screen, program, tmp_path / "arm", FMU_PYTHON_PROCESS=own_process)
        assert "gripper at x = 0.0343 m, z = -0.6946 m" in done.stdout
