"""The process that serves the page of a run ends with that run, however the run's process ends."""

import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

RUN = """
import sys, time
from pathlib import Path
from handover.scenarios.live.process import live_page

with live_page(Path(sys.argv[1]), 1.0, {}) as (address, _, inputs):
    print(address, inputs.folder, flush=True)
    time.sleep(600.0)
"""


def until(condition: Callable[[], bool]) -> None:
    late = time.monotonic() + 60.0
    while not condition():
        assert time.monotonic() < late, "it never came true"
        time.sleep(0.02)


def accepts(port: int) -> bool:
    with socket.socket() as asking:
        return asking.connect_ex(("127.0.0.1", port)) == 0


@pytest.mark.slow
def test_a_killed_runs_page_is_served_no_more_and_its_folder_is_removed(tmp_path: Path):
    run = subprocess.Popen([sys.executable, "-c", RUN, str(tmp_path / "run")], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    address, _, scratch = run.stdout.readline().strip().partition(" ")
    told = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/", address)
    assert told is not None
    port = int(told[1])
    assert accepts(port)
    assert (Path(scratch) / "control").is_file()
    run.send_signal(signal.SIGKILL)
    run.communicate(timeout=60)
    until(lambda: not accepts(port))
    until(lambda: not Path(scratch).exists())
