"""What a unit changes of its process is put back; what the host's own program changes between calls stays."""

import ctypes
import os
import signal
import sys
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
from support.cosim.native_units import native_fmu

from handover.cosim.fmu.host_process import HostProcess
from handover.cosim.master.master import Master
from handover.cosim.stepping.options import MasterOptions
from handover.cosim.system.system import System

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="as POSIX has it")

_LIBM = ctypes.CDLL("libm.so.6" if sys.platform == "linux" else None)


def of_one(unit: str) -> System:
    system = System()
    system.add("bad", native_fmu(unit))
    return system


def handler_of(number: int) -> bytes:
    held = ctypes.create_string_buffer(256)
    ctypes.CDLL(None).sigaction(number, None, held)
    return held.raw[:8]


STATES: dict[str, Callable[[], object]] = {
    "change_directory": Path.cwd,
    "install_handlers": lambda: [handler_of(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGCHLD)],
    "round_up": _LIBM.fegetround,
    "take_output": lambda: os.fstat(1).st_ino,
    "close_output": lambda: os.fstat(1).st_ino,
}


OPTIONS = [MasterOptions(), MasterOptions(compiled=False), MasterOptions(call_limit=10.0)]
WHEN = ["load", "instantiate", "step", "terminate", "free"]


@pytest.mark.parametrize(
    ("harm", "when", "options"),
    [
        (harm, when, OPTIONS[(i + k) % 3])
        for i, harm in enumerate(STATES)
        for k, when in enumerate(WHEN)
        if when == "step" or i == k or harm == "install_handlers"
    ],
)
def test_all_is_as_before(harm: str, when: str, options: MasterOptions):
    before = STATES[harm]()
    with Master(of_one(f"{harm}_in_{when}"), options) as master:
        assert STATES[harm]() == before
        master.run(Fraction(1))
        assert STATES[harm]() == before
    assert STATES[harm]() == before


def test_what_the_program_itself_changes_between_calls_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    before = signal.getsignal(signal.SIGUSR1)
    try:
        with Master(of_one("gain")) as master:
            os.chdir("there")
            signal.signal(signal.SIGUSR1, signal.SIG_IGN)
            master.run(Fraction(1))
            assert Path.cwd() == tmp_path / "there"
            assert signal.getsignal(signal.SIGUSR1) is signal.SIG_IGN
            os.chdir("..")
        assert Path.cwd() == tmp_path
        assert handler_of(signal.SIGUSR1) == (1).to_bytes(8, sys.byteorder)  # SIG_IGN
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_no_descriptor_is_left():
    def descriptors() -> int:
        return len(os.listdir("/dev/fd"))

    before = descriptors()
    for _ in range(3):
        with Master(of_one("gain")) as master:
            master.run(Fraction(1))
    assert descriptors() == before


def test_a_directory_that_is_gone_is_no_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    host = HostProcess()
    os.chdir(tmp_path)
    host.restore()
    host.close()
    assert Path.cwd() == tmp_path
