import os
import subprocess
import sys
from pathlib import Path

import pytest

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
@pytest.mark.parametrize("closed", ["<&- >&- 2>&-", "<&- 2>&-", ">&- </dev/null"])
def test_closed_streams_lead_nowhere(closed: str, tmp_path: Path):
    made = tmp_path / "record"
    call = [sys.executable, "-c", PROGRAM, str(made)]
    done = subprocess.run(["sh", "-c", f'"$@" {closed}', "sh", *call], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert made.read_text() == "only what is meant for it"
