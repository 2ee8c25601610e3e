"""A run in a child process ends as one process would: by signals, by Ctrl-C in a terminal, when it is killed."""

import contextlib
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from failing_systems import IN_TERMINAL, failing_ssp, start, wait_until
from processes import lives, until

from handover.cosim.record.reader import Record

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc"),
]


@pytest.fixture
def arguments(tmp_path: Path) -> tuple[str | Path, ...]:
    """Of a run that takes as long as one lets it."""
    return (failing_ssp(tmp_path, "gain"), "--out", tmp_path / "r", "--stop", "1000", "--pace", "1")


def begun(going: "subprocess.Popen[str]", folder: Path) -> int:
    """Wait until a run has recorded a row, and return the process that does it."""
    tail = folder / "r" / "signals.tail"
    wait_until(lambda: tail.exists() and any(tail.read_bytes()[16:24]), going)
    (child,) = Path(f"/proc/{going.pid}/task/{going.pid}/children").read_text().split()
    return int(child)


def test_a_child_that_is_killed_leaves_a_whole_record(arguments: tuple[str | Path, ...], tmp_path: Path):
    going = start(tmp_path, *arguments)
    os.kill(begun(going, tmp_path), signal.SIGKILL)
    shown, errors = going.communicate(timeout=60)
    assert going.returncode == 3
    assert errors.startswith("the run was killed at t = ")
    assert "gain.ssp failed: the run was killed" in shown
    assert json.loads((tmp_path / "r" / "summary.json").read_text())["failure"]["kind"] == "killed"
    assert Record(tmp_path / "r" / "signals.parquet").time[0] == 0.0
    assert list((tmp_path / "tmp").iterdir()) == []


def test_a_parent_that_is_killed_takes_its_child_with_it(arguments: tuple[str | Path, ...], tmp_path: Path):
    going = start(tmp_path, *arguments)
    child = begun(going, tmp_path)
    going.kill()
    going.communicate(timeout=60)
    until(lambda: not lives(child))  # it lets go of the pipes before it is gone


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_to_the_parent_ends_the_run_after_its_step(
    number: signal.Signals, arguments: tuple[str | Path, ...], tmp_path: Path
):
    if signal.getsignal(number) is signal.SIG_IGN:
        pytest.skip("under nohup the tests' processes ignore it, too")
    going = start(tmp_path, *arguments)
    begun(going, tmp_path)
    going.send_signal(number)
    shown, errors = going.communicate(timeout=60)
    assert going.returncode == 1, errors
    assert "interrupted" in shown
    assert (tmp_path / "r" / "signals.parquet").exists()


def test_ctrl_c_in_a_terminal_is_heard_once(arguments: tuple[str | Path, ...], tmp_path: Path):
    here, terminal = os.openpty()
    streams = {"stdin": terminal, "stdout": terminal, "stderr": terminal}
    going = start(tmp_path, *arguments, program=IN_TERMINAL, start_new_session=True, **streams)
    os.close(terminal)
    child = begun(going, tmp_path)
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
    child = begun(going, tmp_path)

    def state(process: int) -> str:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]

    going.send_signal(signal.SIGTSTP)
    wait_until(lambda: (state(going.pid), state(child)) == ("T", "T"), going)
    going.send_signal(signal.SIGCONT)
    wait_until(lambda: "T" not in (state(going.pid), state(child)), going)
    going.send_signal(signal.SIGTERM)
    going.communicate(timeout=60)
    assert going.returncode == 1


def test_a_usage_error_is_answered_as_ever(tmp_path: Path):
    going = start(tmp_path, "nonsense")
    _, errors = going.communicate(timeout=60)
    assert going.returncode == 2
    assert "no scenario 'nonsense'" in errors
