"""Ctrl-C ends a run from Python after its step, as a KeyboardInterrupt, and keeps what was recorded."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.cosim.native_units import native_fmu
from support.processes import recorded_rows, until

import handover

PROGRAM = """
import handover, signal, sys
before = signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)
try:
    handover.run(sys.argv[1], out="r", stop=1000, options=handover.MasterOptions(pace=1.0))
except KeyboardInterrupt as e:
    print(e)
assert (signal.getsignal(signal.SIGINT), signal.getsignal(signal.SIGTERM)) == before
"""


@pytest.mark.skipif(sys.platform == "win32", reason="a process cannot be sent Ctrl-C alone there")
@pytest.mark.slow
def test_ctrl_c_ends_the_run_and_keeps_its_record(tmp_path: Path):
    call = [sys.executable, "-c", PROGRAM, str(native_fmu("mass"))]
    with subprocess.Popen(call, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        until(lambda: recorded_rows(tmp_path / "r") > 1 or process.poll() is not None)
        process.send_signal(signal.SIGINT)
        printed, errors = process.communicate(timeout=60)
    assert printed == "the run was interrupted; what was recorded is in r\n", errors
    run = handover.load(tmp_path / "r")
    assert isinstance(run, handover.Run)
    assert run.reason.startswith("interrupted: ")
    assert run.signals.time[-1] > 0.0
