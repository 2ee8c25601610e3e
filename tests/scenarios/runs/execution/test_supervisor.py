"""A run in a child process ends as one process would: by signals, by Ctrl-C in a terminal, when it is killed."""

import contextlib
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import Command, data_in
from support.failing_systems import failing_ssp, start, wait_until
from support.processes import children, recorded_rows, stopped, until

from handover.cosim.record.reader import Record

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc")

IN_TERMINAL = """
import fcntl, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
from handover.scenarios.cli.entry import main
main()
"""
"""The command where standard input is a terminal, which it makes the one that controls it."""


@pytest.fixture
def arguments(tmp_path: Path) -> tuple[str | Path, ...]:
    """Of a run that takes as long as one lets it."""
    endless = ("--stop", "1000", "--pace", "1", "--no-report")
    return (failing_ssp(tmp_path, "gain"), "--out", tmp_path / "r", *endless)


def begun(going: Command, folder: Path) -> int:
    """Wait until a run has recorded a row, and return the process that does it."""
    wait_until(lambda: recorded_rows(folder / "r") > 0, going)
    (child,) = children(going.pid)
    return child


def test_a_child_that_is_killed_leaves_a_whole_record(arguments: tuple[str | Path, ...], tmp_path: Path):
    going = start(tmp_path, *arguments)
    os.kill(begun(going, tmp_path), signal.SIGKILL)
    status, shown, errors = going.wait()
    assert status == 3
    assert errors.startswith("the run was killed at t = ")
    assert "gain.ssp failed: the run was killed" in shown
    assert data_in(tmp_path / "r")["failure"]["kind"] == "killed"
    assert Record(tmp_path / "r" / "signals.parquet").time[0] == 0.0
    assert list((tmp_path / "tmp").iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_signal_to_the_parent_ends_the_run_after_its_step(
    number: signal.Signals, arguments: tuple[str | Path, ...], tmp_path: Path
):
    if number != signal.SIGINT and signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip("under nohup the tests' processes ignore it, too")
    going = start(tmp_path, *arguments)
    begun(going, tmp_path)
    going.send_signal(number)
    status, shown, errors = going.wait()
    assert status == 1, errors
    assert "interrupted" in shown
    assert (tmp_path / "r" / "signals.parquet").exists()


@pytest.mark.slow
def test_ctrl_c_in_a_terminal_is_heard_once(arguments: tuple[str | Path, ...], tmp_path: Path):
    here, terminal = os.openpty()
    call = [sys.executable, "-c", IN_TERMINAL, "run", *map(str, arguments)]
    going = subprocess.Popen(
        call, cwd=tmp_path, stdin=terminal, stdout=terminal, stderr=terminal, start_new_session=True
    )
    os.close(terminal)
    until(lambda: recorded_rows(tmp_path / "r") > 0 or going.poll() is not None)
    (child,) = children(going.pid)
    assert os.tcgetpgrp(here) == os.getpgid(going.pid) != os.getpgid(child)  # else the child might hear of it twice
    os.write(here, b"\x03")
    shown = b""
    with contextlib.suppress(OSError):  # the terminal is closed when all its processes are gone
        while part := os.read(here, 1024):
            shown += part
    os.close(here)
    assert going.wait(60) == 1, shown
    assert shown.count(b"ending after this step") == 1
    assert b"Aborted" not in shown
    assert b"simulated" in shown


def test_ctrl_z_stops_both_and_going_on_lets_both_go_on(arguments: tuple[str | Path, ...], tmp_path: Path):
    going = start(tmp_path, *arguments)
    both = (going.pid, begun(going, tmp_path))
    going.send_signal(signal.SIGTSTP)
    wait_until(lambda: all(map(stopped, both)), going)
    going.send_signal(signal.SIGCONT)
    wait_until(lambda: not any(map(stopped, both)), going)
    going.send_signal(signal.SIGTERM)
    assert going.wait().status == 1
