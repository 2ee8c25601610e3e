"""`--config`: options from a TOML or JSON file, under the command line; a run's `run.json` repeats the run."""

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import click
import pytest
from support.commands import call, data_in, refusal
from support.cosim.native_units import native_fmu
from support.wording import Wording

from handover.cosim.ssp.writing import write_ssp
from handover.cosim.stepping.options import AdaptiveStep, Algorithm, Extrapolation, MasterOptions
from handover.cosim.system.system import System
from handover.fmus.build import cached
from handover.scenarios.cli.master_options import coupling_of
from handover.scenarios.cli.options import limits
from handover.scenarios.cli.run import run as run_command
from handover.scenarios.cli.sweep import sweep as sweep_command

RUN = """
scenario = "ir_grasp"
seed = 3
stop = 0.3
call-limit = 30
no-report = true
format = ["csv", "mat"]
isolate = "reflex"

[parameters]
strategy = "forward"
forward = 0.05
reflex.damping = 0.5

[parameters.scene]
grip_friction = 0.4
"""


def parsed(command: click.Command, folder: Path, text: str, *arguments: str, name: str = "run.toml") -> dict[str, Any]:
    """Return what a command gets as its options."""
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return command.make_context("command", ["--config", str(file), *arguments]).params


def test_a_file_gives_what_is_run_and_the_options(tmp_path: Path):
    got = parsed(run_command, tmp_path, RUN)
    assert (got["scenario"], got["seed"], got["stop"], got["call_limit"]) == ("ir_grasp", 3, Fraction(3, 10), 30.0)
    assert (got["no_report"], got["formats"], got["isolate"]) == (True, ("csv", "mat"), ("reflex",))
    texts = ("strategy=forward", "forward=0.05", "reflex.damping=0.5", "scene.grip_friction=0.4")
    assert got["parameters"] == texts
    assert (got["algorithm"], got["strict"]) == ("gauss-seidel", False)
    text = '{"scenario": "x.fmu", "step": "1/30", "parameters": {"on": true, "p": [1, 2.5]}, "unit": {"arm": "my:Arm"}}'
    got = parsed(run_command, tmp_path, text, name="run.json")
    assert (got["scenario"], str(got["step"])) == ("x.fmu", "1/30")
    assert (got["parameters"], got["replaced"]) == (("on=true", "p=1,2.5"), ("arm=my:Arm",))


@pytest.mark.parametrize(("name", "text"), [("run.toml", RUN), ("run.json", '{"scenario": "ir_grasp"}')])
def test_a_file_may_begin_with_a_byte_order_mark(name: str, text: str, tmp_path: Path):
    assert parsed(run_command, tmp_path, "\ufeff" + text, name=name)["scenario"] == "ir_grasp"


def test_the_command_line_comes_first_of_tables_name_by_name(tmp_path: Path):
    text = RUN + '[unit]\nscene = "a.fmu"\nreflex = "b.fmu"\n'
    given = ("--seed", "7", "-p", "forward=0.1", "--unit", "reflex=c.fmu", "vsl_hybrid", "--format", "csv")
    got = parsed(run_command, tmp_path, text, *given)
    assert (got["scenario"], got["seed"], got["formats"]) == ("vsl_hybrid", 7, ("csv",))
    assert set(got["parameters"]) == {
        "strategy=forward",
        "forward=0.1",
        "reflex.damping=0.5",
        "scene.grip_friction=0.4",
    }
    assert set(got["replaced"]) == {"scene=a.fmu", "reflex=c.fmu"}


SWEEP = """
scenario = "reach:Reach"
repeat = 5
paired = true
parameters.arm.mass = 2
parameters.gain = 1
[unit]
servo = ["a.fmu", "b.fmu"]
[sweep]
alpha = "0.1:0.4:4"
goal = [[0.3, 0.6], [0.4, 0.2]]
strategy = ["reflex", "blind"]
servo.gain = [0.2, 0.4]
"""


def test_a_sweep_has_a_table_of_values_to_vary(tmp_path: Path):
    got = parsed(sweep_command, tmp_path, SWEEP)
    assert (got["repeat"], got["paired"], got["replaced"]) == (5, True, ("servo=a.fmu,b.fmu",))
    wanted = ("alpha=0.1:0.4:4", "goal=0.3,0.6;0.4,0.2", "strategy=reflex,blind", "servo.gain=0.2,0.4")
    assert (got["grid"], got["parameters"]) == (wanted, ("arm.mass=2", "gain=1"))
    got = parsed(sweep_command, tmp_path, SWEEP, "other", "gain=3,4", "-p", "alpha=0.2")
    assert (got["scenario"], got["grid"]) == ("other", (*wanted[1:], "gain=3,4"))
    assert got["parameters"] == ("arm.mass=2", "alpha=0.2")


@pytest.mark.parametrize(
    "text",
    [
        "seed = ",
        "[3]",
        '{"seed": 1, "seed": 2}',
        '{"parameters": {"strategy": "blind", "thing": "disc", "strategy": "forward"}}',
        "sed = 3",
        "p = {forward = 0.1}",
        "controls = 'folder'",
        "stop = 1\nstop-time = 2",
        "call_limit = 3",
        "seed = -1",
        "seed = true",
        "out = 3",
        "isolate = [3]",
        "stop = 'soon'",
        "stop = 1979-05-27",
        "algorithm = 'jacoby'",
        "parameters = 3",
        "parameters.a.b = 1979-05-27",
        "sweep.a = [1, 2]",
        "scenario = 'ir_grasp'\nadaptive-absolute = 1",
        "seed = -1\nsed = 2",
        "scenario = ''",
        "scenario = 'ir_grasp'\n[parameters]\nstrategi = 'blind'\nforward = 9",
    ],
    ids=str.strip,
)
def test_what_is_wrong_is_reported_in_one_line_and_nothing_is_written(text: str, tmp_path: Path, wording: Wording):
    file = tmp_path / ("run.json" if text.startswith(("[", "{")) else "run.toml")
    file.write_text(text, encoding="utf-8")
    reported = refusal("run", "--config", file, "--out", tmp_path / "out")
    assert reported.count("\n") == 1
    wording.check(reported)
    assert [*tmp_path.iterdir()] == [file]


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run with options of all kinds."""
    folder = tmp_path_factory.mktemp("first")
    file = folder / "run.toml"
    file.write_text(RUN.replace('isolate = "reflex"', 'algorithm = "jacobi"\ncheckpoint = 1\ntolerance = 1e-6'))
    done = call("run", "--config", file, "--unit", f"scene={cached('GraspScene', 2)}", "--out", folder / "r")
    assert done.exit_code == 1, done.output
    return folder / "r"


def test_a_run_s_run_json_repeats_it_byte_for_byte(first: Path, tmp_path: Path):
    done = call("run", "--config", first / "run.json", "--no-report", "--out", tmp_path / "r")
    assert done.exit_code == 1, done.output
    for name in ("run.json", "signals.parquet", "signals.csv", "signals.mat"):
        assert (tmp_path / "r" / name).read_bytes() == (first / name).read_bytes(), name
    data = data_in(first, "run")
    assert (data["seed"], data["stop"], data["checkpoint"], data["master"]["tolerance"]) == (3, "3/10", "1", 1e-6)
    assert data["units"]["scene"]["fmu"] == "GraspScene.fmi2.fmu"


def test_a_run_s_results_are_no_options_and_the_file_that_has_them_is_named(first: Path):
    assert str(first / "run.json") in refusal("run", "--config", first / "summary.json")


def test_it_can_be_changed_by_the_command_line_and_be_swept(first: Path):
    options = ["--config", str(first / "run.json")]
    got = sweep_command.make_context("sweep", [*options, "forward=0.03,0.1", "--seed", "9"]).params
    assert (got["scenario"], got["seed"], got["grid"]) == ("ir_grasp", 9, ("forward=0.03,0.1",))
    assert not [text for text in got["parameters"] if text.startswith("forward=")]
    assert {"strategy=forward", "reflex.damping=0.5"} < set(got["parameters"])


@pytest.mark.parametrize(
    ("typed", "left"), [((), []), (("strategy=forward",), ["forward=0.05"]), (("forward=0.1",), ["forward=0.1"])]
)
def test_what_nothing_comes_of_in_a_point_of_a_campaign_is_left_out(
    typed: tuple[str, ...], left: list[str], first: Path, tmp_path: Path
):
    data = data_in(first, "run")
    data["parameters"]["strategy"] = "blind"
    given = [part for text in typed for part in ("-p", text)]
    got = parsed(run_command, tmp_path, json.dumps(data), *given, name="run.json")["parameters"]
    assert [text for text in got if text.startswith("forward=")] == left


def test_all_options_of_the_master_are_repeated(first: Path, tmp_path: Path):
    lengths: dict[str, Any] = {"smallest": Fraction(1, 3000), "largest": Fraction(1, 3), "initial": Fraction("0.01")}
    options = MasterOptions(
        algorithm=Algorithm.NEWTON,
        tolerance=1e-7,
        max_iterations=7,
        extrapolation=Extrapolation.LINEAR,
        repeat_discarded=True,
        isolated=("foreign", "arm"),
        unit_tolerances={"all": 1e-5, "arm": 1e-7},
        adaptive=AdaptiveStep(relative=0.1, absolute=1e-7, uncontrolled=("arm.q", "arm.v"), **lengths),
    )
    data = data_in(first, "run") | {"master": options.as_data()}
    got = parsed(run_command, tmp_path, json.dumps(data), name="run.json")
    assert MasterOptions(**coupling_of(got)) == options
    assert limits(0.0, 0.5) == {"call_limit": None, "pace": 0.5}


def test_other_versions_and_files_that_are_gone_are_reported(first: Path, tmp_path: Path, wording: Wording):
    data, file = data_in(first, "run"), tmp_path / "run.json"
    data["versions"]["numpy"] = "0.1"
    data["files"]["reflex"] = str(tmp_path / "gone.fmu")
    file.write_text(json.dumps(data))
    reported = refusal("run", "--config", file, "--out", tmp_path / "out")
    assert "the run was of other versions: numpy 0.1" in reported
    assert f"the FMU of its unit reflex, {tmp_path / 'gone.fmu'}, is not there; --unit reflex=FILE" in reported
    del data["master"]["tolerance"]
    file.write_text(json.dumps(data))
    wording.check(refusal("run", "--config", file, "--out", tmp_path / "out"))
    assert not (tmp_path / "out").exists()


def test_a_run_of_an_ssp_is_repeated(tmp_path: Path):
    system = System()
    system.add("mass", native_fmu("mass", 2))
    ssp = write_ssp(system, tmp_path / "x.ssp", "x", None)
    given = ("-p", "mass.m=2", "--stop", "0.2", "--step", "0.05", "--no-report", "--out")
    assert call("run", ssp, *given, tmp_path / "1").exit_code == 0
    done = call("run", "--config", tmp_path / "1" / "run.json", "--no-report", "--out", tmp_path / "2")
    assert done.exit_code == 0, done.output
    for name in ("run.json", "signals.parquet"):
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()
