"""A run server returns a result for each job, whatever a run does to its process, and leaves no incomplete folder."""

import json
import os
import signal
import subprocess
import sys
import time
import zipfile
from collections.abc import Generator
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from support.commands import call, data_in
from support.cosim.native_units import native_fmu
from support.processes import children, lives, until
from support.rewritten_archive import DESCRIPTION, rewritten
from support.scenarios.sample_jobs import bad_job, job, quick_job

from handover.cosim.python_process import code_command
from handover.cosim.record.reader import Record
from handover.cosim.stepping.options import MasterOptions
from handover.fmus.build import cached
from handover.scenarios.runs.campaign.plan import PlannedRun
from handover.scenarios.runs.campaign.run_server import load_modules
from handover.scenarios.runs.campaign.run_servers import NotWanted, ServerLost, ServerProcess
from handover.scenarios.runs.campaign.table import row_of

slow = pytest.mark.slow
pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="looks for processes in /proc")


def yes() -> bool:
    return True


@pytest.fixture(scope="module")
def server() -> Generator[ServerProcess, None, None]:
    server = ServerProcess()
    yield server
    server.end()


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("built")


def summary_in(runs: Path, name: str = "bad") -> dict[str, Any]:
    """Return the summary of the only run in a folder."""
    assert [p.name for p in runs.iterdir()] == [name]
    return data_in(runs / name)


def test_the_signals_are_those_of_the_same_run_by_itself_also_if_it_is_executed_twice(
    server: ServerProcess, tmp_path: Path
):
    alone, runs = tmp_path / "alone", tmp_path / "runs"
    call("run", "ir_grasp", "--seed", "3", "--stop", "0.5", "--no-report", "--out", alone)
    for _ in range(2):
        assert server.run_job(replace(job(runs), stop=Fraction(1, 2)), yes).lost == ""
    assert [p.name for p in runs.iterdir()] == ["run"]
    assert (runs / "run" / "signals.parquet").read_bytes() == (alone / "signals.parquet").read_bytes()
    assert {p.name for p in (runs / "run").iterdir()} == {"run.json", "signals.parquet", "summary.json"}


def test_a_file_whose_unit_crashes_takes_its_run_alone(server: ServerProcess, tmp_path: Path):
    runs, file = tmp_path / "runs", str(native_fmu("crashes_in_step", 3))
    for name, at, reason in (("bad", "0.25", "crashed"), ("good", "9", "ran to 1 s")):
        of_file = replace(quick_job(runs, name), scenario=file, parameters=(f"at={at}",))
        assert server.run_job(of_file, yes).lost == ""
        summary = data_in(runs / name)
        assert reason in summary["reason"]
        assert (summary["failure"] is None) is (name == "good")


@pytest.mark.parametrize(
    ("reflex", "kind", "line"),
    [("RefusesToStart", "error", "reflex does not start: "), ("CrashesAtStart", "crash", "a unit failed: ")],
)
def test_a_unit_that_does_not_start_is_in_the_summary(
    reflex: str, kind: str, line: str, server: ServerProcess, built: Path, tmp_path: Path
):
    """It would not start another time either: there is nothing to try again."""
    job = bad_job(tmp_path / "runs", reflex, built)
    assert server.run_job(job, yes).lost == ""
    summary = summary_in(tmp_path / "runs")
    assert (summary["success"], summary["complete"], summary["simulated_seconds"]) == (False, False, 0.0)
    assert (summary["failure"]["kind"], summary["failure"]["instance"]) == (kind, "reflex")
    assert summary["reason"].startswith(line)
    assert "\n" not in summary["reason"]
    run = PlannedRun(name="bad", point=0, repetition=0, parameters={}, seed=job.seed)
    row = row_of(run, tmp_path / "runs" / "bad")
    assert row is not None
    assert (row.status, row.success) == ("failed", None)


@pytest.mark.parametrize(
    ("reflex", "kind"), [("Raises", "error"), ("Crashes", "crash"), pytest.param("Hangs", "hang", marks=slow)]
)
def test_a_unit_that_fails_or_does_not_come_back_ends_its_run_only(
    reflex: str, kind: str, server: ServerProcess, built: Path, tmp_path: Path
):
    limit = 0.5 if kind == "hang" else None  # a crash takes longer on a loaded machine
    assert server.run_job(bad_job(tmp_path / "runs", reflex, built, call_limit=limit), yes).lost == ""
    summary = summary_in(tmp_path / "runs")
    assert (summary["success"], summary["failure"]["kind"], summary["failure"]["instance"]) == (False, kind, "reflex")
    assert ("a sensor broke" in summary["reason"]) is (kind == "error")
    assert 0.0 < summary["cpu_seconds"] < 60.0
    assert Record(tmp_path / "runs" / "bad" / "signals.parquet").time[-1] == pytest.approx(0.09)
    assert server.lives


@pytest.mark.parametrize(
    ("reflex", "line", "no_room"),
    [
        ("IsKilled", "the run was killed at t = 0.105 s, in ", ""),
        pytest.param("FillsTheDisk", "cannot be written: File too large", "File too large", marks=slow),
    ],
)
def test_a_run_without_a_summary_leaves_nothing(
    reflex: str, line: str, no_room: str, server: ServerProcess, built: Path, tmp_path: Path
):
    result = server.run_job(bad_job(tmp_path / "runs", reflex, built), yes)
    assert line in result.lost
    assert "\n" not in result.lost
    assert result.no_room == no_room
    assert list((tmp_path / "runs").iterdir()) == []


@pytest.mark.slow
def test_an_invalid_job_is_lost_with_the_reason(server: ServerProcess, tmp_path: Path):
    assert "has no parameter 'gloss'" in server.run_job(job(tmp_path / "runs", "run", "gloss=1"), yes).lost
    unknown = replace(job(tmp_path / "runs"), scenario="juggle")
    assert "no scenario 'juggle'" in server.run_job(unknown, yes).lost
    assert list((tmp_path / "runs").iterdir()) == []


@slow
def test_what_a_run_prints_is_kept_beside_its_record(server: ServerProcess, built: Path, tmp_path: Path):
    assert server.run_job(bad_job(tmp_path / "runs", "Prints", built), yes).lost == ""
    log = tmp_path / "runs" / "bad" / "log.txt"
    assert log.read_text() == "from Python\nfrom native code\ninput: ''\n"


@slow
@pytest.mark.parametrize(("killed", "error"), [(True, ServerLost), (False, NotWanted)])
def test_a_server_that_is_killed_or_whose_run_is_not_wanted_any_more_takes_its_run_with_it(
    killed: bool, error: type[Exception], built: Path, tmp_path: Path
):
    server, seen = ServerProcess(), list[int]()

    def wanted() -> bool:
        if not seen and list((tmp_path / "runs").glob(".bad.*/signals.tail")):
            seen.extend(children(server.pid))
            if killed:
                os.kill(server.pid, signal.SIGKILL)
        return killed or not seen

    with pytest.raises(error, match="ended with status -9" if killed else None):
        server.run_job(bad_job(tmp_path / "runs", "Hangs", built), wanted)
    assert len(seen) == 1
    until(lambda: not any(map(lives, (server.pid, *seen))))
    assert list((tmp_path / "runs").iterdir()) == []
    assert not server.lives


@slow
def test_a_run_that_is_stopped_for_a_while_does_not_hang(server: ServerProcess, tmp_path: Path):
    stopped: list[int] = []

    def stop_once() -> bool:
        if not stopped and list((tmp_path / "runs").glob(".run.*/signals.tail")):
            stopped.extend(children(server.pid))
            for process in stopped:
                os.kill(process, signal.SIGSTOP)
            time.sleep(8.0)  # longer than the limit of a call, and than the server waits besides
            for process in stopped:
                os.kill(process, signal.SIGCONT)
        return True

    # paced, so that the run lasts longer than the time between two calls of stop_once
    limited = replace(quick_job(tmp_path / "runs"), options=MasterOptions(call_limit=0.5, pace=1.0))
    assert server.run_job(limited, stop_once).lost == ""
    assert len(stopped) == 1
    summary = data_in(tmp_path / "runs" / "run")
    assert (summary["complete"], summary["failure"]) == (True, None)


@slow
def test_runs_are_served_where_pandas_is_not_installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    absent = tmp_path / "absent"
    absent.mkdir()
    (absent / "pandas.py").write_text("raise ModuleNotFoundError(\"No module named 'pandas'\")\n")
    monkeypatch.syspath_prepend(absent)
    assert subprocess.run(code_command("import pandas"), capture_output=True, check=False).returncode == 1
    server = ServerProcess()
    try:
        assert server.run_job(quick_job(tmp_path / "runs"), yes).lost == ""
    finally:
        server.end()


@slow
def test_the_modules_of_our_fmus_are_loaded_for_all_runs_but_those_of_others_are_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    ours = cached("Push", 3)
    with zipfile.ZipFile(ours) as archive:
        unit = json.loads(archive.read("resources/unit.json"))
    own = json.dumps({**unit, "block": "my_package.push:Push"}).encode()
    other = rewritten(ours, tmp_path / "other.fmu", lambda name, data: own if name == "resources/unit.json" else data)
    foreign = rewritten(ours, tmp_path / "foreign.fmu", lambda name, data: data if name == DESCRIPTION else None)
    module = f"{unit['prefix']}.handover.fmus.slave"
    for name in [name for name in sys.modules if name.startswith(unit["prefix"])]:
        monkeypatch.delitem(sys.modules, name)
    for path in (other, foreign):
        load_modules(path)
        assert module not in sys.modules
    load_modules(ours)
    assert module in sys.modules
