import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from faulty_units import faulty_fmu

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


@pytest.mark.parametrize("isolated", [(), ("--isolate", "all")], ids=["", "isolated"])
@pytest.mark.parametrize("when", ["step", "unload"])
def test_what_units_print_is_not_in_the_json(when: str, isolated: tuple[str, ...], tmp_path: Path):
    fmu = faulty_fmu(f"print_in_{when}", 2, tmp_path)
    call = [sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()", "run", str(fmu)]
    options = ("--stop", "1", "--no-report", "--out", "r", "--json", *isolated)
    done = subprocess.run([*call, *options], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == json.loads((tmp_path / "r" / "summary.json").read_text()) | {"folder": "r"}
    if not isolated:  # its process ends without writing what its C library has kept
        assert "a unit's own words\n" in done.stderr
