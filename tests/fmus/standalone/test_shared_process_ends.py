"""What a host does while the process that its instances share crashes or ends; its program is a script, not frozen."""

import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support.c_programs import compiled
from support.fmus.ctypes_host import CtypesHost

from handover.fmus.build import build_block
from handover.fmus.compile import RUNTIME, host_platform

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="each instance has a process of its own there")

CRASHES = """
import runpy, socket, sys
receive = socket.recv_fds
def receive_one(control, *sizes):
    received = receive(control, *sizes)
    control.shutdown(socket.SHUT_RDWR)
    return received
socket.recv_fds = receive_one
runpy.run_path(sys.argv[1], run_name="__main__")
"""
"""It takes one instance, and is for some seconds as one that crashes: it runs, but the control channel is closed."""

ENDS_SLOWLY = """
import os, runpy, sys, time
runpy.run_path(sys.argv[1], run_name="__main__")
while not os.path.exists(sys.argv[0] + "may_end"):
    time.sleep(0.01)
"""
"""It ends once a file lets it."""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build_block("support.sample_units.trouble:Trouble", 3, tmp_path_factory.mktemp("unit"))


@pytest.fixture
def host_of(fmu: Path) -> Iterator[Callable[[str], CtypesHost]]:
    """Return what makes a host of the unit with a program as its interpreter."""
    made: list[CtypesHost] = []

    def host(program: str) -> CtypesHost:
        made.append(CtypesHost(fmu, 3))
        folder = made[-1].folder / "resources" / "standalone" / host_platform()
        folder.mkdir(parents=True)
        source = program.replace("sys.argv[0]", repr(f"{folder}/"))
        (folder / "unit.py").write_text(source, encoding="utf-8")
        script = (
            f'#!/bin/sh\nunset LD_LIBRARY_PATH\nPYTHONPATH="{folder}" exec "{sys.executable}" -c "import unit" "$@"\n'
        )
        (folder / "unit").write_text(script, encoding="utf-8")
        return made[-1]

    yield host
    for each in made:
        each.close()


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
    (host.folder / "resources" / "standalone" / host_platform() / "may_end").touch()
    leaving.join()
    second.free()


def test_a_fork_of_a_host_of_which_a_thread_has_the_lock_makes_instances():
    program = compiled(Path(__file__).with_name("lock_in_fork.c"), RUNTIME / "process_posix.c", RUNTIME / "text.c")
    assert subprocess.run([program], check=False, timeout=60).returncode == 0
