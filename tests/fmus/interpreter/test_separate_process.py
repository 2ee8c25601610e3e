"""A unit whose Python runs in a process of its own: the same values, and the host survives whatever happens to it."""

import ctypes
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.fmus.binary_values import SIZE_OF_PICTURE, put, take
from support.fmus.ctypes_host import DOUBLE, ERROR, OK, SIZE, CtypesHost
from support.fmus.saved_states import called, deserialise, save, serialised
from support.fmus.workshop import Workshop
from support.sample_units.trouble import Deed

pytestmark = pytest.mark.skipif(os.name == "nt", reason="looks after processes as POSIX has them")

TROUBLE = "trouble:Trouble"
DT = 1 / 64


@pytest.fixture(autouse=True)
def apart(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("FMU_PYTHON_PROCESS", "1")


def set_integer(host: CtypesHost, name: str, value: int) -> int:
    reference = (ctypes.c_uint32 * 1)(host.references[name])
    if host.fmi == 2:
        return host.call("SetInteger", reference, SIZE(1), (ctypes.c_int * 1)(value))
    return host.call("SetInt64", reference, SIZE(1), (ctypes.c_int64 * 1)(value), SIZE(1))


def kill(host: CtypesHost) -> None:
    """Kill the instance's process and wait until it is gone; whoever started it can still ask how it ended."""
    process = int(host.get("process")[0])
    os.kill(process, signal.SIGKILL)
    os.waitid(os.P_PID, process, os.WEXITED | os.WNOWAIT)


def get_string(host: CtypesHost, name: str) -> tuple[int, bytes | None]:
    values, reference = (ctypes.c_char_p * 1)(), (ctypes.c_uint32 * 1)(host.references[name])
    sizes = [SIZE(1)] if host.fmi == 3 else []
    return host.call("GetString", reference, SIZE(1), values, *sizes), values[0]


def running(workshop: Workshop, fmi: int = 3) -> CtypesHost:
    host = workshop.host(TROUBLE, fmi)
    assert host.initialise() == OK, host.log
    assert host.step(0.0, DT) == OK
    assert int(host.get("process")[0]) != os.getpid()
    return host


def asked_for(host: CtypesHost, deed: Deed) -> int:
    """Return the status of a step in which the block does something."""
    set_integer(host, "deed", deed)
    return host.step(DT, DT)


def expect_revival(host: CtypesHost) -> None:
    """Fail unless the instance has failed, and is usable again after a reset."""
    assert host.step(DT, DT) == ERROR
    assert "failed: only reset" in host.log[-1]
    assert host.call("Reset") == OK, host.log
    assert host.initialise() == OK
    assert host.step(0.0, DT) == OK
    assert host.get("count") == [1.0]


def run_of_everything(host: CtypesHost) -> list[object]:
    """Return all outputs of some steps, and the state at the end."""
    host.set("p0", [0.1, 0.2, 0.3])
    assert host.initialise(1.5) == OK
    seen: list[object] = []
    for i in range(20):
        assert host.set("v", [np.sin(i), np.cos(i), 1.0 / (i + 1)]) == OK
        assert host.set("a", [0.1 * i]) == OK
        assert host.step(1.5 + i * DT, DT) == OK, host.log
        seen += [host.get("b"), host.get("p", 3), host.get("N", 9), host.get("c"), get_string(host, "sentence")]
    return [*seen, serialised(host, save(host))]


@pytest.mark.machine
def test_values_and_states_are_those_of_the_hosts_own_process(workshop: Workshop, monkeypatch: pytest.MonkeyPatch):
    other = run_of_everything(workshop.host("every_kind:EveryKind", 3))
    monkeypatch.setenv("FMU_PYTHON_PROCESS", "0")
    assert other == run_of_everything(workshop.host("every_kind:EveryKind", 3))


def test_a_picture_goes_in_and_out_through_shared_memory(workshop: Workshop):
    host = workshop.host("eye:Eye", 3)
    picture = np.random.default_rng(1).integers(0, 256, SIZE_OF_PICTURE, dtype=np.uint8)
    assert put(host, "picture", picture.tobytes()) == OK
    assert put(host, "note", b"drawer") == OK
    assert host.initialise() == OK
    address, size = take(host, "brighter")
    assert ctypes.string_at(address, size) == (picture + np.uint8(1)).tobytes()
    put(host, "picture", (picture + np.uint8(7)).tobytes())
    assert host.step(0.0, 1 / 30) == OK
    assert take(host, "brighter") == (address, size)
    assert ctypes.string_at(address, size) == (picture + np.uint8(8)).tobytes()
    assert ctypes.string_at(*take(host, "note_back")) == b"reward"


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
    for part in ("DoStep: the unit's Python process", how, "Cure: reset the instance or set a saved state"):
        assert part in host.log[-1]
    expect_revival(host)


def test_a_process_killed_between_two_calls_is_an_error_of_the_next(workshop: Workshop):
    host = running(workshop)
    kill(host)
    assert host.step(DT, DT) == ERROR
    assert "ended by signal 9 (Killed)" in host.log[-1]
    expect_revival(host)


def test_every_call_names_the_process_end(workshop: Workshop):
    host = running(workshop)
    kill(host)
    assert get_string(host, "word")[0] == ERROR
    assert "fmi3GetString: the unit's Python process" in host.log[-1]
    assert get_string(host, "word")[0] == ERROR
    assert "has ended. Cure" in host.log[-1]
    expect_revival(host)


def test_a_process_that_hangs_is_ended_when_its_time_is_over(workshop: Workshop, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("FMU_PYTHON_TIMEOUT", "0.5")
    host = running(workshop)
    process = int(host.get("process")[0])
    assert asked_for(host, Deed.HANG) == ERROR
    for part in ("DoStep: the unit's Python", "did not answer for 0.5 s and was ended", "Cure: ", "FMU_PYTHON_TIMEOUT"):
        assert part in host.log[-1]
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
    expect_revival(host)


def test_a_saved_state_revives_an_instance_whose_process_was_killed(workshop: Workshop):
    others = children()
    host, whole = (workshop.host("every_kind:EveryKind", 3) for _ in range(2))
    for each in (host, whole):
        assert each.initialise() == OK
        assert each.step(0.0, DT) == OK
    data = serialised(host, save(host))
    state = deserialise(host, data)[1]
    processes = children() - others
    assert len(processes) == 2
    for process in processes:
        os.kill(process, signal.SIGKILL)
    assert host.step(DT, DT) == ERROR
    assert host.call("SetFMUState", state) == OK
    assert whole.call("SetFMUState", deserialise(whole, data)[1]) == OK
    assert host.step(DT, DT) == whole.step(DT, DT) == OK
    assert host.get("p", 3) == whole.get("p", 3)
    assert not processes & children()


def test_a_state_that_does_not_fit_leaves_a_revived_instance_failed(workshop: Workshop):
    host, other = running(workshop), workshop.host("every_kind:EveryKind", 3)
    status, foreign = deserialise(host, serialised(other, save(other)))
    assert status == OK
    kill(host)
    assert host.call("SetFMUState", foreign) == ERROR
    expect_revival(host)


def test_an_exception_is_an_error_with_the_traceback_of_the_block_alone(workshop: Workshop):
    host = workshop.host("every_kind:EveryKind", 3)
    assert host.initialise() == OK
    host.set("a", [666.0])
    assert host.step(0.0, DT) == ERROR
    assert 'raise Misfortune("the number of the beast # 100%")' in host.log[-1]
    assert "server.py" not in host.log[-1]


@pytest.mark.parametrize(("setting", "deed"), [("0", Deed.INTERRUPT), ("1", Deed.SYSTEM_EXIT)])
def test_leaving_by_an_exception_is_an_error_wherever_python_runs(
    workshop: Workshop, monkeypatch: pytest.MonkeyPatch, setting: str, deed: Deed
):
    monkeypatch.setenv("FMU_PYTHON_PROCESS", setting)
    host = workshop.host(TROUBLE, 3)
    assert host.initialise() == OK
    assert host.step(0.0, DT) == OK
    process = host.get("process")
    assert asked_for(host, deed) == ERROR
    assert "Traceback" in host.log[-1]
    expect_revival(host)
    assert host.get("process") == process


def test_what_a_block_prints_reaches_the_hosts_output_and_nothing_else(
    workshop: Workshop, capfd: pytest.CaptureFixture[str]
):
    host = running(workshop)
    assert asked_for(host, Deed.CHATTER) == OK
    assert host.get("count") == [2.0]
    assert capfd.readouterr().out.splitlines()[-1] == "words, words, words 19999"


def test_a_process_that_ends_while_the_block_is_made_is_an_error(workshop: Workshop):
    host = workshop.host(TROUBLE, 2)
    assert set_integer(host, "deed_at_start", Deed.EXIT) == OK
    assert host.initialise() == ERROR
    assert "ended with exit status 7" in host.log[-1]
    assert host.call("Reset") == OK
    assert host.initialise() == OK


@pytest.mark.parametrize("name", ["FMU_PYTHON_PROCESS", "FMU_PYTHON_TIMEOUT"])
@pytest.mark.parametrize("value", ["yes", "-1", "1.2.3", f"0.{'3' * 400}"])
def test_a_setting_that_makes_no_sense_is_refused(
    workshop: Workshop, monkeypatch: pytest.MonkeyPatch, name: str, value: str
):
    host = workshop.own(TROUBLE, 3)
    monkeypatch.setenv(name, value)
    assert not host.instantiate()
    assert f"{name} is '{value}'; it is " in host.log[-1]


def children() -> set[int]:
    """Return this process's children, ended ones among them."""
    tasks = Path("/proc/self/task").glob("*/children")
    return {int(process) for task in tasks for process in task.read_text().split()}


def cycle(host: CtypesHost, deed: Deed) -> None:
    assert host.instantiate(), host.log
    assert host.initialise() == OK
    assert host.step(0.0, DT) == OK
    assert asked_for(host, deed) == (OK if deed is Deed.NONE else ERROR)
    host.free()


def expect_no_leak(workshop: Workshop, folder: Path, cycles: int) -> None:
    host = workshop.host(TROUBLE, 3)
    host.free()
    files, processes = sorted(os.listdir("/proc/self/fd")), children()
    for i in range(cycles):
        cycle(host, (Deed.NONE, Deed.EXIT)[i % 2])
    assert sorted(os.listdir("/proc/self/fd")) == files
    assert children() == processes
    assert list(folder.iterdir()) == []


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="counts descriptors and processes as Linux has them")
@pytest.mark.parametrize("cycles", [4, pytest.param(40, marks=pytest.mark.slow)])
def test_nothing_is_left_behind(workshop: Workshop, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cycles: int):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    expect_no_leak(workshop, tmp_path, cycles)


HOST = """
import os, signal, sys
sys.path[:0] = {path!r}
from pathlib import Path
from support.fmus.ctypes_host import CtypesHost
from test_separate_process import Deed, asked_for
host = CtypesHost(Path({fmu!r}), 3)
assert host.instantiate() and host.initialise() == 0 and host.step(0.0, 1 / 64) == 0
assert int(host.get("process")[0]) != os.getpid()
print("ready", flush=True)
if {hangs}:
    signal.setitimer(signal.ITIMER_REAL, 0.1)  # whose signal ends this process
    asked_for(host, Deed.HANG)
signal.pause()
"""


@pytest.mark.parametrize("hangs", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_process_ends_with_the_host(workshop: Workshop, hangs: bool):
    path = [str(Path(__file__).parent), *sys.path]
    script = HOST.format(path=path, fmu=str(workshop.fmu(TROUBLE, 3)), hangs=hangs)
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as host:
        assert host.stdout
        assert host.stdout.readline() == "ready\n"
        if not hangs:
            host.kill()
        assert host.communicate(timeout=60)[0] == ""  # ends when the unit's process does, which has the pipe, too


def test_a_signal_at_the_terminal_is_the_hosts_business(workshop: Workshop):
    host = running(workshop)
    process = int(host.get("process")[0])
    assert os.getpgid(process) != os.getpgid(0)
    os.kill(process, signal.SIGINT)
    assert host.step(DT, DT) == OK
    values = (DOUBLE * 1)()
    assert host.call("GetFloat64", (ctypes.c_uint32 * 1)(host.references["count"]), SIZE(1), values, SIZE(1)) == OK
    assert values[0] == 2.0


def test_an_end_that_nobody_has_noticed_is_mended_by_reset_and_by_a_saved_state(workshop: Workshop):
    host = running(workshop, 2)
    state = save(host)
    kill(host)
    assert host.call(called(host, "SetFMUstate"), state) == OK, host.log
    assert host.step(DT, DT) == OK
    assert host.get("count") == [2.0]
    kill(host)
    assert host.call("Reset") == OK, host.log
    assert host.initialise() == OK
