"""Units that lower hard limits, which a process without privileges cannot raise again: the run ends as by a crash."""

import ctypes
import json
import subprocess
import sys
from pathlib import Path

import pytest
from native_units import native_fmu

from handover.cosim.record.reader import Record

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="privileges are dropped as Linux does it")

_PR_CAPBSET_DROP, _CAP_SYS_RESOURCE = 24, 24
LIMITS = {"files": "RLIMIT_FSIZE to 1000", "descriptors": "RLIMIT_NOFILE to 4", "memory": "RLIMIT_AS to 300000000"}
EVERY = pytest.mark.parametrize("limit", list(LIMITS))


def without_privileges() -> None:
    ctypes.CDLL(None).prctl(_PR_CAPBSET_DROP, _CAP_SYS_RESOURCE, 0, 0, 0)  # fails for whoever has none


def run(unit: str, out: Path, *more: str) -> "subprocess.CompletedProcess[str]":
    call = [sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()"]
    arguments = ["run", str(native_fmu(unit, 3)), "--no-report", "--out", str(out), *more]
    return subprocess.run(
        [*call, *arguments], capture_output=True, text=True, check=False, preexec_fn=without_privileges
    )


@EVERY
def test_a_run_that_cannot_go_on_has_its_record_and_names_the_limit(tmp_path: Path, limit: str):
    out = tmp_path / "out"
    done = run(f"lower_{limit}_in_step", out, "-p", "at=0.5")
    assert done.returncode == 3, done.stderr
    assert "Traceback" not in done.stderr
    unit = f"lower_{limit}_in_step"
    assert f"unit {unit} lowered hard limits in one of its calls: {LIMITS[limit]};" in done.stderr
    failure = json.loads((out / "summary.json").read_text())["failure"]
    assert (failure["kind"], failure["instance"], failure["status"]) == ("limits", unit, LIMITS[limit])
    assert Record(out / "signals.parquet").time[-1] >= 0.5
    assert not (out / "signals.arrows").exists()


@EVERY
@pytest.mark.parametrize("when", ["load", "instantiate"])
def test_one_that_does_so_before_the_run_has_begun_leaves_no_folder(tmp_path: Path, limit: str, when: str):
    unit = f"lower_{limit}_in_{when}"
    done = run(unit, tmp_path / "out")
    assert done.returncode == 3, done.stderr
    assert "Traceback" not in done.stderr
    assert f"unit {unit} lowered hard limits in its loading or instantiation: {LIMITS[limit]};" in done.stderr
    assert not (tmp_path / "out").exists()


@EVERY
def test_an_isolated_one_harms_itself_alone(tmp_path: Path, limit: str):
    done = run(f"lower_{limit}_in_step", tmp_path / "out", "--isolate", "all")
    assert done.returncode == 0, done.stderr
