"""A unit whose Python runs in a process of its own: the same values, and the host survives whatever happens to it."""

import ctypes
import os
import signal
from pathlib import Path

import pytest
from support.fmus.ctypes_host import ERROR, OK, CtypesHost
from support.fmus.forking_host import expect_end_with_host
from support.fmus.saved_states import called, deserialise, save, serialised
from support.fmus.workshop import Workshop
from support.sample_units.trouble import Deed

pytestmark = pytest.mark.skipif(os.name == "nt", reason="looks after processes as POSIX has them")

TROUBLE = "trouble:Trouble"
DT = 1 / 64


@pytest.fixture(autouse=True)
def apart(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("FMU_PYTHON_PROCESS", "1")


def process_of(host: CtypesHost) -> int:
    return int(host.get("process")[0])


def kill(host: CtypesHost) -> None:
    """Kill the instance's process and wait until it is gone; whoever started it can still ask how it ended."""
    process = process_of(host)
    os.kill(process, signal.SIGKILL)
    os.waitid(os.P_PID, process, os.WEXITED | os.WNOWAIT)


def running(workshop: Workshop, fmi: int = 3) -> CtypesHost:
    host = workshop.host(TROUBLE, fmi)
    assert host.initialise() == OK, host.log
    assert host.step(0.0, DT) == OK
    return host


def asked_for(host: CtypesHost, deed: Deed) -> int:
    """Return the status of a step in which the block does something."""
    host.put("Integer", "deed", deed)
    return host.step(DT, DT)


def expect_revival(host: CtypesHost) -> None:
    """Fail unless the instance has failed, and is usable again after a reset."""
    assert host.step(DT, DT) == ERROR
    assert "failed: only reset" in host.log[-1]
    assert host.call("Reset") == OK, host.log
    assert host.initialise() == OK
    assert host.step(0.0, DT) == OK
    assert host.get("count") == [1.0]


def expect_told(host: CtypesHost, *parts: str) -> None:
    assert [part for part in parts if part not in host.log[-1]] == []


@pytest.mark.machine
@pytest.mark.parametrize(
    ("deed", "fmi", "how"),
    [
        (Deed.EXIT, 2, "ended with exit status 7"),
        (Deed.CRASH, 3, "ended by signal 11 (Segmentation fault); compiled code of a package has crashed"),
        (Deed.LEAVE_A_CHILD, 3, "ended with exit status 7"),
    ],
)
def test_a_process_that_ends_in_a_step_is_an_error_that_says_how(workshop: Workshop, deed: Deed, fmi: int, how: str):
    host = running(workshop, fmi)
    assert asked_for(host, deed) == ERROR
    expect_told(host, "DoStep: the unit's Python process", how, "Cure: reset the instance or set a saved state")


def test_a_process_killed_between_two_calls_is_an_error_of_the_next_that_reset_or_a_state_mends(workshop: Workshop):
    host = running(workshop)
    assert process_of(host) != os.getpid()
    state = save(host)

    def restored() -> None:
        assert host.call(called(host, "SetFMUstate"), state) == OK, host.log
        assert host.step(DT, DT) == OK
        assert host.get("count") == [2.0]

    kill(host)
    restored()  # though nobody has noticed
    kill(host)
    assert host.step(2 * DT, DT) == ERROR
    expect_told(host, "ended by signal 9 (Killed)")
    restored()
    kill(host)
    word = (ctypes.c_char_p * 1)()
    for reported in ("fmi3GetString: the unit's Python process", "has ended. Cure"):
        assert host.transfer("GetString", "word", word) == ERROR
        expect_told(host, reported)
    expect_revival(host)
    kill(host)
    assert host.call("Reset") == OK, host.log
    assert host.initialise() == OK


def test_a_process_that_hangs_is_ended_when_its_time_is_over(workshop: Workshop, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("FMU_PYTHON_TIMEOUT", "0.5")
    host = running(workshop)
    process = process_of(host)
    assert asked_for(host, Deed.HANG) == ERROR
    expect_told(
        host, "DoStep: the unit's Python", "did not answer for 0.5 s and was ended", "Cure", "FMU_PYTHON_TIMEOUT"
    )
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)


def test_a_state_that_does_not_fit_leaves_a_revived_instance_failed(workshop: Workshop):
    host, other = running(workshop), workshop.host("scalars:Scalars", 3)
    status, foreign = deserialise(host, serialised(other, save(other)))
    assert status == OK
    kill(host)
    assert host.call("SetFMUState", foreign) == ERROR
    expect_revival(host)


@pytest.mark.parametrize(
    ("setting", "deed"), [("0", Deed.INTERRUPT), ("1", Deed.SYSTEM_EXIT), ("1", Deed.FAIL_DEEP_DOWN)]
)
def test_an_exception_is_an_error_with_the_traceback_of_the_block_alone(
    workshop: Workshop, monkeypatch: pytest.MonkeyPatch, setting: str, deed: Deed
):
    monkeypatch.setenv("FMU_PYTHON_PROCESS", setting)
    host = running(workshop)
    process = process_of(host)
    assert asked_for(host, deed) == ERROR
    expect_told(host, "Traceback")
    assert "server.py" not in host.log[-1]
    expect_revival(host)
    assert process_of(host) == process


def test_prints_reach_the_hosts_output_and_nothing_else_and_a_signal_at_the_terminal_is_the_hosts_business(
    workshop: Workshop, capfd: pytest.CaptureFixture[str]
):
    host = running(workshop)
    assert os.getpgid(process_of(host)) != os.getpgid(0)
    os.kill(process_of(host), signal.SIGINT)
    assert asked_for(host, Deed.CHATTER) == OK
    assert host.get("count") == [2.0]
    assert capfd.readouterr().out.splitlines()[-1] == "words, words, words 19999"


def test_a_process_that_ends_while_the_block_is_made_is_an_error(workshop: Workshop):
    host = workshop.host(TROUBLE, 2)
    assert host.put("Integer", "deed_at_start", Deed.EXIT) == OK
    assert host.initialise() == ERROR
    expect_told(host, "ended with exit status 7")
    assert host.call("Reset") == OK
    assert host.initialise() == OK


@pytest.mark.parametrize("name", ["FMU_PYTHON_PROCESS", "FMU_PYTHON_TIMEOUT"])
def test_a_setting_that_makes_no_sense_is_refused(workshop: Workshop, monkeypatch: pytest.MonkeyPatch, name: str):
    host = workshop.own(TROUBLE, 3)
    for value in ("yes", "-1", "1.2.3", f"0.{'3' * 400}"):
        monkeypatch.setenv(name, value)
        assert not host.instantiate()
        expect_told(host, f"{name} is '{value}'; it is ")


def children() -> set[int]:
    """Return this process's children, ended ones among them."""
    tasks = Path("/proc/self/task").glob("*/children")
    return {int(process) for task in tasks for process in task.read_text().split()}


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="counts descriptors and processes as Linux has them")
def test_nothing_is_left_behind(workshop: Workshop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    host = workshop.host(TROUBLE, 3)
    host.free()
    files, processes = sorted(os.listdir("/proc/self/fd")), children()
    for deed in (Deed.EXIT, Deed.NONE):
        assert host.instantiate(), host.log
        assert host.initialise() == OK
        assert host.step(0.0, DT) == OK
        assert asked_for(host, deed) == (OK if deed is Deed.NONE else ERROR)
        host.free()
    assert sorted(os.listdir("/proc/self/fd")) == files
    assert children() == processes
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("deed", [Deed.NONE, pytest.param(Deed.HANG, marks=pytest.mark.slow)])
def test_the_process_ends_with_the_host(workshop: Workshop, deed: Deed):
    expect_end_with_host(workshop.fmu(TROUBLE, 3), deed)
