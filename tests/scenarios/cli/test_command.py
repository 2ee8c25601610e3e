import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from support.commands import call, refusal
from support.scenarios import tearing_spring
from support.wording import Wording

from handover.fmus.catalog import UNITS
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import DeferringGroup, main
from handover.scenarios.cli.console import open_console, print_rows
from handover.scenarios.runs.execution.progress import say


def test_lists_have_robots_scenarios_units_and_their_parameters_and_ports():
    shown = call("list").output
    assert all(title in shown for title in ("Helix, ", "VSL arm, ", "Free-flyer, ", "IR grasp, "))
    assert {*SCENARIOS, *UNITS} <= {*shown.split()}
    scenario = " ".join(call("list", "helix_handover").output.split())
    assert "from 0.01 to 1" in scenario
    assert "front | front_left | left | back_left" in scenario
    units = {name: call("list", name) for name in UNITS}
    assert [name for name, shown in units.items() if shown.exit_code or "Outputs" not in shown.output] == []
    arm = " ".join(units["VslArm"].output.split())
    assert "EI_0 real N.m2 0.55" in arm
    assert "link_2 enumeration vsl vsl | rigid" in arm
    assert "load real kg 0 from 0 to 0.5 kg" in arm
    assert "shape real[25,3] m" in arm


def test_what_is_piped_is_as_wide_as_columns_says(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("COLUMNS", "60")
    rows = [line for line in call("list", "ir_grasp").output.splitlines() if line.startswith("  ")]
    assert max(map(len, rows)) == 60


def test_what_others_have_written_does_not_steer_the_terminal(capsys: pytest.CaptureFixture[str]):
    escapes = "\x1b[31m\x1b]0;x\x07\u202e"
    say(escapes)
    print_rows(open_console(), [("name", escapes)])
    shown = call("report", f"no{escapes}").output + "".join(capsys.readouterr())
    assert shown.count("[31m") == 3
    assert not set(escapes) & set(shown) - set("[31m]0;x")


def test_ctrl_c_while_the_command_loads_aborts_it(tmp_path: Path):
    (tmp_path / "click.py").write_text("raise KeyboardInterrupt\n")
    command = [sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()", "list"]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (130, "Aborted!\n")


def test_ctrl_c_in_a_command_that_does_not_handle_it_aborts_it():
    def work() -> None:
        raise KeyboardInterrupt

    group = DeferringGroup("main", commands=[click.Command("work", callback=work)])
    assert CliRunner().invoke(group, ["work"]).exit_code == 130


def test_settings_of_the_environment_that_cannot_be_used_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    (tmp_path / "file").write_text("precious")
    with monkeypatch.context() as patched:
        patched.setenv("HANDOVER_CACHE", str(tmp_path / "file"))
        reported = refusal("run", "ir_grasp", "--out", tmp_path / "r")
        assert (reported.count("\n"), "HANDOVER_CACHE" in reported) == (1, True)
    monkeypatch.setenv("HANDOVER_FMI_PLATFORMS", "foo")
    for arguments in (("run", "ir_grasp"), ("build", "Push")):
        wording.check(refusal(*arguments, "--out", tmp_path / "r"))
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


@pytest.mark.parametrize(
    ("given", "made"),
    [
        ("Thrusters Push", {"Thrusters.fmi2", "Thrusters.fmi3", "Push.fmi2", "Push.fmi3"}),
        ("Push Push --fmi 3", {"Push.fmi3"}),
        ("Push --scalar", {"Push.fmi2", "Push.fmi3-scalar"}),
        ("Push --fmi 2 --scalar", {"Push.fmi2"}),
    ],
)
def test_build_writes_the_files_it_names(given: str, made: set[str], tmp_path: Path):
    result = call("build", *given.split(), "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert {Path(line).stem for line in result.output.split()} == {p.stem for p in tmp_path.iterdir()} == made


def test_build_makes_a_unit_of_ones_own_from_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    shutil.copyfile(tearing_spring.__file__, tmp_path / "own_spring.py")
    result = call("build", "own_spring:TearingSpring", "--step", "1/50", "--out", "made")
    assert result.exit_code == 0, result.output
    built = [tmp_path / "made" / f"TearingSpring.fmi{fmi}.fmu" for fmi in (2, 3)]
    assert sorted((tmp_path / "made").iterdir()) == built
    with zipfile.ZipFile(built[1]) as archive:
        assert 'stepSize="0.02"' in archive.read("modelDescription.xml").decode()
    assert call("check", built[1]).exit_code == 0


def test_a_folder_that_cannot_be_made_is_reported_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    def refuse(path: Path, **_: object) -> None:
        raise FileNotFoundError(2, "No such file or directory", str(path))

    monkeypatch.setattr(Path, "mkdir", refuse)  # as /proc does, though it says that it can be written to
    wording.check(refusal("build", "Push", "--fmi", "3", "--out", tmp_path / "out"))


@pytest.mark.parametrize(("words", "completed"), [("com", "compare"), ("run --alg", "--algorithm")])
def test_a_shell_completes_commands_and_options(words: str, completed: str):
    reported = {"_HANDOVER_COMPLETE": "bash_complete", "COMP_WORDS": f"handover {words}"}
    result = CliRunner().invoke(main, env={**reported, "COMP_CWORD": str(len(words.split()))}, prog_name="handover")
    assert result.output.strip() == f"plain,{completed}"
