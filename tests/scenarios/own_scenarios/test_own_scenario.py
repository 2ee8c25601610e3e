"""A scenario outside of the package, from the tutorial's text: run, listed, resumed, reported; and an installed one."""

import json
import os
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support.commands import Command
from support.documentation import TEXTS, blocks
from support.processes import until
from support.scenarios.tutorial import QUIET, SCENE, call, ran, signals, succeeded, write_files

from handover.cosim.record.reader import Record


@pytest.mark.slow
def test_it_runs_and_its_report_is_written_again_from_elsewhere(here: Path, tmp_path: Path):
    printed = succeeded(here, "run", SCENE, "-p", "goal=0.4,0.3", "--no-report", "--out", "first")
    assert "two_link_reach succeeded" in printed
    assert "from the tip to the goal" in printed  # its metric, with no headline declared
    record = Record(here / "first" / "signals.parquet")
    assert np.linalg.norm(record["arm.p_WG"][-1] - [0.4, 0.3]) < 0.005
    assert f"--trust {here / 'reach.py'}" in call(tmp_path, "report", str(here / "first")).errors
    succeeded(tmp_path, "report", str(here / "first"), "--figures", "--trust", str(here / "reach.py"))
    page = (here / "first" / "report.html").read_text(encoding="utf-8")
    assert "TwoLinkReach draws them by its own code" not in page
    assert "An arm of two links reaches for a point" in page
    assert "where the tip is to come" in page
    assert "Distance to the goal" in page
    for label in ("arm", "path of the tip", "goal"):
        assert f'"label":"{label}"' in page  # of its replay
    assert (here / "first" / "figures" / "distance.png").is_file()


def test_list_prints_scenario_controller_and_plant(here: Path):
    printed = succeeded(here, "list", SCENE)
    assert "An arm of two links reaches for a point" in printed
    assert "where the tip is to come, in W" in printed
    assert "SpringToGoal: tau = J^T k (p_WD - p_WG) - d v" in succeeded(here, "list", "goal_spring:SpringToGoal")


@pytest.mark.slow
def test_a_run_that_was_interrupted_is_resumed_and_not_with_other_code(here: Path, tmp_path: Path):
    options = ["-p", "goal=0.1,0.5", "-p", "patience=1", "--no-report"]
    ran(here, "run", SCENE, *options, "--out", "whole")
    run = Command("run", SCENE, *options, "--checkpoint", "0.2", "--pace", "0.2", "--out", "cut", cwd=here)
    until((here / "cut" / "checkpoint.zip").exists)
    run.send_signal(signal.SIGINT)
    assert run.wait().status == 1
    before = (here / "reach.py").read_text()
    (here / "reach.py").write_text(before + "\n# changed\n")
    line = call(tmp_path, "resume", str(here / "cut")).errors
    assert f"reach:TwoLinkReach: its code, {here / 'reach.py'}, is not what the run had" in line
    (here / "reach.py").write_text(before)
    resumed = call(tmp_path, "resume", str(here / "cut"), "--no-report")
    assert resumed.status == 1, resumed.errors  # to the end, where it is not there yet
    assert f"this runs the code of reach:TwoLinkReach: {here / 'reach.py'}" in resumed.errors
    assert signals(here / "whole") == signals(here / "cut")


COMMANDS = """
import shlex, sys
from click.testing import CliRunner
from handover.scenarios.cli.command import main

for line in sys.argv[1:]:
    done = CliRunner().invoke(main, shlex.split(line))
    assert done.exit_code in (0, 1), done.output
    print(done.output)
"""


@pytest.mark.slow
def test_an_installed_package_adds_scenarios_and_units_by_name(tmp_path: Path):
    installed = tmp_path / "site-packages"
    information = installed / "reaching-1.0.dist-info"
    information.mkdir(parents=True)
    write_files(installed)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: reaching\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(
        "[handover.scenarios]\nreaching = reach:TwoLinkReach\n\n[handover.units]\nPlanarArm = arm:TwoLinkArm\n"
    )
    empty = tmp_path / "empty"
    empty.mkdir()
    run = "run reaching -p patience=0.2 --no-report --out run"
    lines = ["list", run, "report run", "list reaching", "list PlanarArm"]
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    call = [sys.executable, "-c", COMMANDS, *lines]
    done = subprocess.run(call, cwd=empty, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for reported in ("reaching", "An arm of two links reaches for a point", "PlanarArm", "TwoLinkArm", "joint angles"):
        assert reported in done.stdout
    source = json.loads((empty / "run" / "run.json").read_text())["source"]
    assert source["folder"] == str(installed)  # on the path, but not where this interpreter has its packages
    assert (empty / "run" / "report.html").is_file()


@pytest.mark.slow
def test_the_guides_commands_work_beside_the_tutorials_files(here: Path):
    lines = [line for text in blocks(TEXTS["own"]) for line in text.splitlines() if line.startswith("handover ")]
    assert [line.split()[1] for line in lines] == ["list", "run", "sweep", "run", "sweep", "export"]
    for line in lines:
        ran(here, *shlex.split(line)[1:], *(QUIET if line.split()[1] in ("run", "sweep") else ()))
