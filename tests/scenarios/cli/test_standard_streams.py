import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import Ended, data_in, run_command
from support.faults.faulty_units import faulty_fmu

from handover.scenarios.cli.entry import terminal_stream

PROGRAM = """
import sys
from handover.scenarios.cli.entry import open_standard_streams
open_standard_streams()
made = open(sys.argv[1], "w")
assert made.fileno() > 2
print("heard by nobody", flush=True)
sys.stderr.write("nor this")
assert sys.stdin.read() == ""
made.write("only what is meant for it")
"""


@pytest.mark.skipif(os.name != "posix", reason="a shell closes the streams")
@pytest.mark.parametrize("closed", ["<&- >&- 2>&-", ">&- </dev/null"])
def test_closed_streams_lead_nowhere(closed: str, tmp_path: Path):
    made = tmp_path / "record"
    call = [sys.executable, "-c", PROGRAM, str(made)]
    done = subprocess.run(["sh", "-c", f'"$@" {closed}', "sh", *call], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert made.read_text() == "only what is meant for it"


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="there are no terminals of this kind")
def test_what_is_printed_on_a_closed_terminal_is_dropped():
    ours, its = os.openpty()
    stream = terminal_stream(its, io.TextIOWrapper(io.BytesIO(), "utf-8"))
    print("read", file=stream)
    assert os.read(ours, 64) == b"read\r\n"
    os.close(ours)
    print("read by nobody", file=stream, flush=True)
    stream.close()
    with pytest.raises(OSError, match="Input/output"):
        os.write(its, b"the terminal is closed")
    os.close(its)


def ran(fmu: Path, folder: Path, *options: str) -> Ended:
    return run_command("run", fmu, "--stop", "1", "--no-report", "--out", "r", *options, cwd=folder)


@pytest.mark.parametrize(("when", "isolated"), [("step", False), ("unload", False), ("step", True)])
def test_what_units_print_is_not_in_the_json(when: str, isolated: bool, tmp_path: Path):
    fmu = faulty_fmu(f"print_in_{when}", 2, tmp_path)
    done = ran(fmu, tmp_path, "--json", *(("--isolate", "all") if isolated else ()))
    assert done.status == 0, done.errors
    assert json.loads(done.output) == data_in(tmp_path / "r") | {"folder": "r"}
    if not isolated:  # its process ends without writing what its C library has kept
        assert "a unit's own words\n" in done.errors


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the run has no process of its own")
@pytest.mark.parametrize(("closed", "options"), [("close_low", ["--json"]), ("close_any", [])])
def test_status_and_summary_agree_where_a_unit_closes_the_streams(closed: str, options: list[str], tmp_path: Path):
    done = ran(faulty_fmu(f"{closed}_in_step", 2, tmp_path), tmp_path, *options)
    summary = data_in(tmp_path / "r")
    assert (done.status, summary["success"], summary["failure"]) == (0, True, None), done.errors
    if options:
        assert json.loads(done.output) == summary | {"folder": "r"}
    else:
        assert f"{closed}_in_step.fmu succeeded: ran to 1 s" in done.output
    assert ("its process could not print its summary" in done.errors) == (closed == "close_any")
