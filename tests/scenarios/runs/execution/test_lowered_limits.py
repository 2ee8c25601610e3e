"""Units that lower hard limits, which a process without privileges cannot raise again: the run ends as by a crash."""

import subprocess
import sys
from pathlib import Path

import pytest
from support.commands import Ended, data_in, drop_privilege_of_limits
from support.cosim.native_units import native_fmu
from support.failing_systems import start

from handover.cosim.record.reader import Record

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="privileges are dropped as Linux does it")

LIMITS = {"files": "RLIMIT_FSIZE to 1000", "descriptors": "RLIMIT_NOFILE to 4", "memory": "RLIMIT_AS to 300000000"}


def run(unit: str, folder: Path, *more: str) -> Ended:
    arguments = [native_fmu(unit, 3), "--no-report", "--out", "out", *more]
    if "memory" not in unit:
        return start(folder, *arguments, privileged=False).wait()
    call = [sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()", "run", *map(str, arguments)]
    done = subprocess.run(  # a forked command has loaded more than the limit already
        call, cwd=folder, capture_output=True, text=True, check=False, preexec_fn=drop_privilege_of_limits
    )
    return Ended(done.returncode, done.stdout, done.stderr)


@pytest.mark.parametrize("limit", LIMITS)
def test_a_run_that_cannot_go_on_has_its_record_and_names_the_limit(tmp_path: Path, limit: str):
    unit, out = f"lower_{limit}_in_step", tmp_path / "out"
    done = run(unit, tmp_path, "-p", "at=0.5")
    assert done.status == 3, done.errors
    assert "Traceback" not in done.errors
    assert f"unit {unit} lowered hard limits in one of its calls: {LIMITS[limit]};" in done.errors
    failure = data_in(out)["failure"]
    assert (failure["kind"], failure["instance"], failure["status"]) == ("limits", unit, LIMITS[limit])
    assert Record(out / "signals.parquet").time[-1] >= 0.5
    assert not (out / "signals.arrows").exists()


@pytest.mark.parametrize(("limit", "when"), [("files", "instantiate"), ("descriptors", "load")])
def test_one_that_does_so_before_the_run_has_begun_leaves_no_folder(tmp_path: Path, limit: str, when: str):
    unit = f"lower_{limit}_in_{when}"
    done = run(unit, tmp_path)
    assert done.status == 3, done.errors
    assert "Traceback" not in done.errors
    assert f"unit {unit} lowered hard limits in its loading or instantiation: {LIMITS[limit]};" in done.errors
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("limit", ["files", "descriptors"])
def test_an_isolated_one_harms_itself_alone(tmp_path: Path, limit: str):
    done = run(f"lower_{limit}_in_step", tmp_path, "--isolate", "all")
    assert done.status == 0, done.errors
