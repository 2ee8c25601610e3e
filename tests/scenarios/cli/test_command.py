import json
import os
import re
import subprocess
import sys
import zipfile
from fractions import Fraction
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from support.wording import Wording

from handover.cosim.record.reader import Record
from handover.fmus.build import build_block, cached
from handover.fmus.catalog import UNITS
from handover.scenarios.catalog import SCENARIOS
from handover.scenarios.cli.command import main
from handover.scenarios.cli.console import open_console, print_rows
from handover.scenarios.execution.progress import say


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def assert_refused(result: Result, wording: Wording, *untouched: Path) -> None:
    assert result.exit_code == 2, result.output
    assert len(result.output.splitlines()) == 1 or result.output.startswith("Usage: ")
    wording.check(result.output)
    assert "Traceback" not in result.output
    assert not re.search(r"_fmu_[0-9a-f]{16}", result.output)  # the private name of a unit's modules
    for path in untouched:
        assert not path.exists()


def test_list_names_robots_scenarios_and_units():
    shown = call("list").output
    for title in ("Helix, ", "VSL arm, ", "Free-flyer, ", "IR grasp, "):
        assert title in shown
    for name in (*SCENARIOS, *UNITS):
        assert name in shown.split()


def test_what_others_have_written_does_not_steer_the_terminal(capsys: pytest.CaptureFixture[str]):
    escapes = "\x1b[31m\x1b]0;x\x07\u202e"
    say(escapes)
    print_rows(open_console(), [("name", escapes)])
    shown = call("report", f"no{escapes}").output + "".join(capsys.readouterr())
    assert shown.count("[31m") == 3
    assert not set(escapes) & set(shown) - set("[31m]0;x")


def test_list_of_a_scenario_shows_ranges_and_units():
    shown = call("list", "helix_handover").output
    assert "from 0.01 to 1" in shown
    assert "front | front_left | left | back_left" in " ".join(shown.split())


def test_list_of_a_unit_shows_parameters_and_ports_with_units_and_ranges():
    shown = " ".join(call("list", "VslArm").output.split())
    assert "EI_0 real N.m2 0.55" in shown
    assert "link_2 enumeration vsl vsl | rigid" in shown
    assert "load real kg 0 from 0 to 0.5 kg" in shown
    assert "shape real[25,3] m" in shown


@pytest.mark.parametrize("name", UNITS)
def test_every_unit_can_be_listed(name: str):
    result = call("list", name)
    assert result.exit_code == 0, result.output
    assert "Outputs" in result.output


def test_ctrl_c_while_the_command_loads_aborts_it(tmp_path: Path):
    (tmp_path / "click.py").write_text("raise KeyboardInterrupt\n")
    command = [sys.executable, "-c", "from handover.scenarios.cli.entry import main; main()", "list"]
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert (done.returncode, done.stderr) == (130, "Aborted!\n")


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "helix_hand"),
        ("list", "nothing_like_it"),
        ("run", "helix_handover", "-p", "alfa=0.2"),
        ("run", "helix_handover", "-p", "alpha=7"),
        ("run", "helix_handover", "-p", "alpha=quick"),
        ("run", "helix_handover", "--seed", "-1"),
        ("run", "flyer_impedance", "-p", "delay=0.032"),
        ("run", "vsl_hybrid", "-p", "path=custom", "-p", "x_g=0.6,0,0.15"),
        (
            "run",
            "ir_grasp",
            "-p",
            "run_up=0",
            "-p",
            "standoff=0",
            "-p",
            "perturbed=false",
            "-p",
            "thing=paper_box_a",
        ),
        ("run", "helix_handover", "--unit", "arms=x.fmu"),
        ("run", "helix_handover", "--unit", "arm"),
        ("run", "helix_handover", "--unit", "arm=a.fmu", "--unit", "arm=b.fmu"),
        ("run", "helix_handover", "--unit", "arm=missing.fmu"),
        ("run", "helix_handover", "--unit", "arm=TendonArmFst"),
        ("run", "helix_handover", "-p", "ball_mass=1"),
        ("build", "TendonArms"),
        ("build", "spring"),
        ("build", "nowhere:Spring"),
        ("build", "support.scenarios.failing_arm:Nothing"),
        ("build", "support.scenarios.failing_arm:RunTime", "--step", "soon"),
        ("build", "support.scenarios.failing_arm:RunTime", "--step", "1e400"),
        ("build", "support.scenarios.failing_arm:RunTime", "--step", "1e-400"),
        ("build", "support.scenarios.failing_arm:Inputs"),
        ("build", "Push", "--step", "0.1"),
        ("build", "StereoCamera", "--fmi", "2"),
        ("build", "Push", "--stimulus", "given.csv"),
        ("build", "--prove", "--stimulus", "given.csv"),
        ("build", "Push", "Thrusters", "--prove", "--stimulus", "a.csv"),
        ("build", "Push", "--prove", "--stimulus", "given.csv"),
    ],
    ids=" ".join,
)
def test_a_usage_error_is_refused_with_valid_values(tmp_path: Path, arguments: tuple[str, ...], wording: Wording):
    out = tmp_path / "out"
    assert_refused(call(*arguments, "--out", out) if arguments[0] != "list" else call(*arguments), wording, out)


def test_folders_that_cannot_be_used_are_refused_before_anything_runs(tmp_path: Path, wording: Wording):
    (tmp_path / "mine").write_text("precious")
    for arguments in (
        ("run", "helix_handover", "--out", tmp_path),
        ("build", "TendonArm", "--out", tmp_path / "mine"),
        ("build", "TendonArm", "--out", tmp_path / "mine" / "x"),
        ("run", "helix_handover", "--unit", f"arm={tmp_path}", "--out", tmp_path / "out"),
    ):
        assert_refused(call(*arguments), wording)
    assert [p.name for p in tmp_path.iterdir()] == ["mine"]


def test_a_broken_fmu_and_one_that_does_not_fit_are_refused_with_every_fault(tmp_path: Path, wording: Wording):
    out, broken = tmp_path / "out", tmp_path / "broken.fmu"
    broken.write_bytes(cached("TendonArm", 3).read_bytes()[:5000])
    assert_refused(call("run", "helix_handover", "--unit", f"arm={broken}", "--out", out), wording, out)
    with zipfile.ZipFile(broken, "w") as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription")
    assert_refused(call("run", "helix_handover", "--unit", f"arm={broken}", "--out", out), wording, out)
    hand = cached("HandoverPartner", 3)
    assert_refused(call("run", "helix_handover", "--unit", f"arm={hand}", "--out", out), wording, out)


def test_settings_of_the_environment_that_cannot_be_used_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    (tmp_path / "file").write_text("precious")
    with monkeypatch.context() as patched:
        patched.setenv("HANDOVER_CACHE", str(tmp_path / "file"))
        result = call("run", "helix_handover", "--out", tmp_path / "r")
        assert (result.exit_code, result.output.count("\n"), "HANDOVER_CACHE" in result.output) == (2, 1, True)
    monkeypatch.setenv("HANDOVER_FMI_PLATFORMS", "foo")
    for arguments in (("run", "helix_handover", "--out", tmp_path / "r"), ("build", "Push", "--out", tmp_path / "u")):
        assert_refused(call(*arguments), wording, tmp_path / "r", tmp_path / "u")


def test_build_writes_the_files_it_names(tmp_path: Path):
    result = call("build", "TendonArm", "VisualServo", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    names = sorted(Path(line).name for line in result.output.split())
    assert names == ["TendonArm.fmi2.fmu", "TendonArm.fmi3.fmu", "VisualServo.fmi2.fmu", "VisualServo.fmi3.fmu"]
    assert sorted(p.name for p in tmp_path.iterdir()) == names


OWN = """
from dataclasses import dataclass
from fractions import Fraction
from handover.cosim.blocks.ports import output
from handover.cosim.blocks.units import Metre

@dataclass(frozen=True)
class Params: ...

@dataclass
class Inputs: ...

@dataclass
class Outputs:
    x: Metre = output("place")

class Spring:
    "A spring."
    feedthrough = {}
    period = None
    def __init__(self, params: Params) -> None: ...
    def outputs(self, t: float, u: Inputs) -> Outputs: return Outputs(x=t)
    def step(self, t: float, dt: float, u: Inputs) -> Outputs: return Outputs(x=t + dt)
    def get_state(self) -> bytes: return b""
    def set_state(self, state: bytes) -> None: ...
"""


def test_build_makes_a_unit_of_ones_own_from_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "own_spring.py").write_text(OWN)
    result = call("build", "own_spring:Spring", "--step", "1/50", "--out", "made")
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in (tmp_path / "made").iterdir()) == ["Spring.fmi2.fmu", "Spring.fmi3.fmu"]
    with zipfile.ZipFile(tmp_path / "made" / "Spring.fmi3.fmu") as archive:
        assert 'stepSize="0.02"' in archive.read("modelDescription.xml").decode()
    assert call("check", "made/Spring.fmi3.fmu").exit_code == 0


def test_a_users_module_that_does_not_load_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    (tmp_path / "own_broken.py").write_text("x = 1\ny = 1 / 0\n")
    assert_refused(call("build", "own_broken:Spring", "--out", "made"), wording, tmp_path / "made")


def test_a_unit_that_is_named_twice_is_built_once(tmp_path: Path):
    result = call("build", "Push", "Push", "--fmi", "3", "--out", tmp_path)
    assert [Path(line).name for line in result.output.split()] == ["Push.fmi3.fmu"]


def test_a_folder_that_cannot_be_made_is_reported_by_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    def refuse(path: Path, **_: object) -> None:
        raise FileNotFoundError(2, "No such file or directory", str(path))

    monkeypatch.setattr(Path, "mkdir", refuse)  # as /proc does, though it says that it can be written to
    assert_refused(call("build", "Push", "--fmi", "3", "--out", tmp_path / "out"), wording)


def test_build_scalar_writes_fmi_3_without_arrays(tmp_path: Path):
    result = call("build", "VisualServo", "--scalar", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in tmp_path.iterdir()) == ["VisualServo.fmi2.fmu", "VisualServo.fmi3-scalar.fmu"]
    result = call("build", "VisualServo", "--fmi", "2", "--scalar", "--out", tmp_path / "two")
    assert result.exit_code == 0, result.output
    assert [p.name for p in (tmp_path / "two").iterdir()] == ["VisualServo.fmi2.fmu"]


@pytest.mark.slow
def test_a_unit_that_fails_ends_the_run_with_status_3_and_keeps_the_record(tmp_path: Path):
    failing = build_block("support.scenarios.failing_arm:FailingArm", 3, tmp_path, step=Fraction(1, 50))
    out = tmp_path / "out"
    result = call("run", "helix_handover", "--unit", f"arm={failing}", "--no-report", "--out", out)
    assert result.exit_code == 3, result.output
    assert "a tendon tore" in result.output
    summary = json.loads((out / "summary.json").read_text())
    assert summary["success"] is False
    assert summary["reason"].startswith("a unit failed: arm: fmi3DoStep at t = 0.3 s: RuntimeError: a tendon tore")
    assert Record(out / "signals.parquet").time[-1] == pytest.approx(0.3)


@pytest.mark.parametrize(("words", "completed"), [("com", "compare"), ("run --alg", "--algorithm")])
def test_a_shell_completes_commands_and_options(words: str, completed: str):
    told = {"_HANDOVER_COMPLETE": "bash_complete", "COMP_WORDS": f"handover {words}"}
    result = CliRunner().invoke(main, env={**told, "COMP_CWORD": str(len(words.split()))}, prog_name="handover")
    assert result.output.strip() == f"plain,{completed}"
