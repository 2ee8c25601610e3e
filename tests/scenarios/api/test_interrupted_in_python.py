"""Ctrl-C ends a run from Python after its step, as a KeyboardInterrupt, and keeps what was recorded."""

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import handover

PROGRAM = """
import handover, signal
before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
try:
    handover.run("flyer_impedance", out="r", options=handover.MasterOptions(pace=1.0))
except KeyboardInterrupt as e:
    print(e)
assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be sent Ctrl-C alone there")
@pytest.mark.slow
def test_ctrl_c_ends_the_run_and_keeps_its_record(tmp_path: Path):
    call = [sys.executable, "-c", PROGRAM]
    with subprocess.Popen(call, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        for _ in range(600):
            if (tmp_path / "r" / "run.json").is_file():
                break
            time.sleep(0.1)
        time.sleep(1.0)
        process.send_signal(signal.SIGINT)
        printed, errors = process.communicate(timeout=60)
    assert printed == "the run was interrupted; what was recorded is in r\n", errors
    run = handover.load(tmp_path / "r")
    assert isinstance(run, handover.Run)
    assert run.reason.startswith("interrupted: ")
    assert run.signals.time[-1] > 0.0
