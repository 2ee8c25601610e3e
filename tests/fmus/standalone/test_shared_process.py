"""Instances of a unit that brings its interpreter: one process for all, and what becomes of them if it fails."""

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.fmus.ctypes_host import ERROR, OK, CtypesHost
from support.fmus.forking_host import expect_end_with_host
from support.processes import lives
from support.sample_units.trouble import Deed

from handover.fmus.build import build
from handover.fmus.catalog import own_unit
from handover.fmus.compile import host_platform

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform == "win32", reason="each instance has a process of its own there"),
]

DT = 1 / 64
OF_THE_HOST = "/of/the/host"
"""A value of environment variables."""
VARIABLES = [
    "PYTHONHOME",
    "PYTHONPATH",
    "LD_PRELOAD",
    "LD_LIBRARY_PATH",
    "PATH",
    "LC_ALL",
    "MPLBACKEND",
    "OMP_NUM_THREADS",
]


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(
        own_unit("support.sample_units.trouble:Trouble", None), 3, tmp_path_factory.mktemp("unit"), standalone=True
    )


@pytest.fixture
def host(fmu: Path) -> Iterator[CtypesHost]:
    made = CtypesHost(fmu, 3)
    yield made
    made.close()


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


def test_a_crash_is_told_to_every_instance_and_each_can_go_on_after_a_reset(host: CtypesHost):
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
    assert not {line.partition("=")[0] for line in given.split("\0")} & set(VARIABLES) - {"LD_LIBRARY_PATH"}


def test_another_unit_at_the_same_place_does_not_meet_the_process_of_the_one_before(fmu: Path):
    host = CtypesHost(fmu, 3)
    first = instance(host)
    program = host.folder / "resources" / "standalone" / host_platform() / "unit"
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
    host.close()


def test_it_ends_with_a_host_of_which_a_fork_lives_on(fmu: Path):
    expect_end_with_host(fmu)


@pytest.mark.parametrize("damaged", [False, True])
def test_where_it_cannot_start_it_says_so_and_no_other_python_is_tried(fmu: Path, damaged: bool):
    host = CtypesHost(fmu, 3)
    bundled = host.folder / "resources" / "standalone" / host_platform()
    if damaged:
        (bundled / "unit").write_bytes(b"\x7fELF damaged")
    else:
        bundled.rename(bundled.with_name("riscv64-linux"))
    assert not host.instantiate()
    told = {False: "brings its interpreter for another platform", True: "which does not start, and no other is tried"}
    assert told[damaged] in host.log[-1]
    host.close()
