"""What commands in forked processes and kept runs promise."""

import json
import signal
from pathlib import Path

from support.commands import Command, run_command
from support.kept_runs import copied_run, kept_run
from support.processes import until


def test_a_forked_command_has_its_own_folder_environment_streams_and_status(tmp_path: Path):
    done = run_command("run", "ir_grasp", "--stop", "0.05", "--no-report", "--out", "r", cwd=tmp_path)
    assert done.status == 1, done.errors  # it ends before the grasp
    assert (tmp_path / "r" / "signals.parquet").is_file()
    assert "ir_grasp" in done.output
    refused = run_command("run", "ir_gras", env={"COLUMNS": "70"})
    assert refused.status == 2
    assert not refused.output
    assert max(map(len, refused.errors.splitlines())) <= 70


def test_it_is_interrupted_as_one_in_a_terminal(tmp_path: Path):
    going = Command("run", "helix_handover", "--no-report", "--out", tmp_path / "r")
    until((tmp_path / "r").exists)
    going.send_signal(signal.SIGINT)
    assert going.wait().status == 130


def test_a_run_is_made_once_and_its_copies_may_be_changed(tmp_path: Path):
    arguments = ("run", "ir_grasp", "--stop", "0.1", "--no-report")
    run = kept_run(*arguments)
    made = (run / "summary.json").stat()
    copy = copied_run(tmp_path / "copy", *arguments)
    (copy / "summary.json").unlink()
    assert kept_run(*arguments) == run
    assert (run / "summary.json").stat().st_mtime_ns == made.st_mtime_ns
    assert json.loads((run / "run.json").read_text())["scenario"] == "ir_grasp"
