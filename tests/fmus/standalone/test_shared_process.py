"""Instances of a unit that brings its interpreter: one process for all, and what becomes of them if it fails.

The program that it brings is a script, not frozen, which starts this Python.
"""

import json
import os
import subprocess
import sys
import threading
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.c_programs import compiled
from support.fmus.ctypes_host import ERROR, OK, CtypesHost
from support.fmus.forking_host import expect_end_with_host
from support.processes import lives
from support.sample_units.trouble import Deed

from handover.fmus.build import build_block
from handover.fmus.compile import RUNTIME, host_platform

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="each instance has a process of its own there")

DT = 1 / 64
OF_THE_HOST = "/of/the/host"
"""A value of environment variables."""
VARIABLES = {"PYTHONHOME", "PYTHONPATH", "LD_PRELOAD", "LD_LIBRARY_PATH", "PATH", "LC_ALL", "OMP_NUM_THREADS"}
SCRIPT = f'#!/bin/sh\nunset LD_LIBRARY_PATH\nexec "{sys.executable}" "$0.py" "$@"\n'

SERVES = """
import runpy, sys
runpy.run_path(sys.argv[1], run_name="__main__")
"""

CRASHES = f"""
import socket
receive = socket.recv_fds
def receive_one(control, *sizes):
    received = receive(control, *sizes)
    control.shutdown(socket.SHUT_RDWR)
    return received
socket.recv_fds = receive_one
{SERVES}
"""
"""It takes one instance, and is for some seconds as one that crashes: it runs, but the control channel is closed."""

ENDS_SLOWLY = f"""
import os, time
{SERVES}
while not os.path.exists(sys.argv[0] + ".may_end"):
    time.sleep(0.01)
"""
"""It ends once a file lets it."""


def program_of(host: CtypesHost) -> Path:
    return host.folder / "resources" / "standalone" / host_platform() / "unit"


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = build_block("support.sample_units.trouble:Trouble", 3, tmp_path_factory.mktemp("unit"))
    with zipfile.ZipFile(built, "a") as archive:
        for name, text in (("unit", SCRIPT), ("unit.py", SERVES)):
            archive.writestr(f"resources/standalone/{host_platform()}/{name}", text)
    return built


@pytest.fixture
def host_of(fmu: Path) -> Iterator[Callable[[str], CtypesHost]]:
    """Return what makes a host of the unit with a program as its interpreter."""
    made: list[CtypesHost] = []

    def host(program: str) -> CtypesHost:
        made.append(CtypesHost(fmu, 3))
        program_of(made[-1]).with_suffix(".py").write_text(program, encoding="utf-8")
        return made[-1]

    yield host
    for each in made:
        each.close()


@pytest.fixture
def host(host_of: Callable[[str], CtypesHost]) -> CtypesHost:
    return host_of(SERVES)


def instance(host: CtypesHost) -> CtypesHost:
    """Return a host of one more instance in the same folder, which has stepped once."""
    other = host.another()
    assert other.step(0.0, DT) == OK, other.log
    return other


def process(host: CtypesHost) -> int:
    return int(host.get("process")[0])


def asked_for(host: CtypesHost, deed: Deed) -> int:
    """Return the status of a step in which the block does something."""
    host.put("Integer", "deed", deed)
    return host.step(DT, DT)


def test_instances_share_a_process_that_ends_with_the_last(host: CtypesHost):
    first, second = instance(host), instance(host)
    assert process(first) == process(second) != os.getpid()
    number = process(first)
    first.free()
    assert lives(number)
    assert second.step(DT, DT) == OK
    assert second.get("count") == [2.0]
    second.free()
    assert not lives(number)


@pytest.mark.slow
def test_a_crash_is_reported_to_every_instance_and_each_can_go_on_after_a_reset(host: CtypesHost):
    first, second = instance(host), instance(host)
    assert asked_for(first, Deed.CRASH) == ERROR
    assert "ended by signal 11 (Segmentation fault)" in first.log[-1]
    assert second.step(DT, DT) == ERROR
    assert "ended by signal 11 (Segmentation fault)" in second.log[-1]
    for each in (first, second):
        assert each.call("Reset") == OK, each.log
        assert each.initialise() == OK
        assert each.step(0.0, DT) == OK
        assert each.get("count") == [1.0]
    assert process(first) == process(second)
    first.free()
    second.free()


@pytest.mark.slow
def test_an_instance_that_hangs_is_ended_when_its_time_is_over(host: CtypesHost, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("FMU_PYTHON_TIMEOUT", "0.5")
    first, second = instance(host), instance(host)
    number = process(first)
    assert asked_for(first, Deed.HANG) == ERROR
    assert "did not answer for 0.5 s and was ended" in first.log[-1]
    assert not lives(number)
    assert second.step(DT, DT) == ERROR
    assert "was ended, as it did not answer another instance of the unit in time" in second.log[-1]
    first.free()
    second.free()


@pytest.mark.skipif(sys.platform != "linux", reason="reads the process's environment in /proc")
def test_no_variable_of_the_host_reaches_it_but_where_it_may_write(
    host: CtypesHost, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name in VARIABLES:
        monkeypatch.setenv(name, OF_THE_HOST)
    monkeypatch.setenv("HOME", str(tmp_path))
    first = instance(host)
    given = Path(f"/proc/{process(first)}/environ").read_bytes().decode()
    first.free()
    assert OF_THE_HOST not in given
    assert f"HOME={tmp_path}\0" in given
    assert not {line.partition("=")[0] for line in given.split("\0")} & VARIABLES - {"LD_LIBRARY_PATH"}


@pytest.mark.slow
def test_another_unit_at_the_same_place_does_not_meet_the_process_of_the_one_before(host: CtypesHost):
    first, program = instance(host), program_of(host)
    content, mode = program.read_bytes(), program.stat().st_mode
    program.unlink()  # unpacked again: the same sources, perhaps with other packages
    program.write_bytes(content)
    program.chmod(mode)
    second = instance(host)
    facts = host.folder / "resources" / "unit.json"
    host.token = "{another}"
    facts.write_text(json.dumps({**json.loads(facts.read_text()), "token": host.token}))
    third, fourth = instance(host), instance(host)
    assert len({process(each) for each in (first, second, third)}) == 3
    assert process(third) == process(fourth)
    for each in (first, second, third, fourth):
        assert each.step(DT, DT) == OK, each.log
        each.free()


@pytest.mark.slow
def test_it_ends_with_a_host_of_which_a_fork_lives_on(fmu: Path):
    expect_end_with_host(fmu)


@pytest.mark.parametrize("damaged", [False, True])
def test_where_it_cannot_start_it_says_so_and_no_other_python_is_tried(host: CtypesHost, damaged: bool):
    program = program_of(host)
    if damaged:
        program.write_bytes(b"\x7fELF damaged")
    else:
        program.parent.rename(program.parent.with_name("riscv64-linux"))
    assert not host.instantiate()
    reported = {
        False: "brings its interpreter for another platform",
        True: "which does not start, and no other is tried",
    }
    assert reported[damaged] in host.log[-1]


def test_an_instance_gets_another_process_where_the_one_that_runs_is_about_to_crash(
    host_of: Callable[[str], CtypesHost],
):
    host = host_of(CRASHES)
    first = host.another()
    second = host.another()
    assert first.get("process") != second.get("process")
    first.free()
    second.free()


def test_an_instance_is_made_while_another_process_takes_its_time_to_end(host_of: Callable[[str], CtypesHost]):
    host = host_of(ENDS_SLOWLY)
    first = host.another()
    leaving = threading.Thread(target=first.free)
    leaving.start()
    leaving.join(0.1)
    second = host.another()
    assert leaving.is_alive()
    program_of(host).with_suffix(".py.may_end").touch()
    leaving.join()
    second.free()


def test_a_fork_of_a_host_of_which_a_thread_has_the_lock_makes_instances():
    program = compiled(Path(__file__).with_name("lock_in_fork.c"), RUNTIME / "process_posix.c", RUNTIME / "text.c")
    assert subprocess.run([program], check=False, timeout=60).returncode == 0
