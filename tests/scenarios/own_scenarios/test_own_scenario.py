"""A scenario outside of the package, from the tutorial's text: run, listed, swept, resumed, reported, exported."""

import importlib.util
import json
import os
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tutorial import COMMAND, SOFTER, TUTORIAL, call, ran, refused, succeeded, write_files

from handover.cosim.record.reader import Record
from handover.scenarios.campaign.table import CampaignTable

SCENE = "reach:TwoLinkReach"


@pytest.fixture
def here(tmp_path: Path) -> Path:
    folder = tmp_path / "mine"
    folder.mkdir()
    write_files(folder)
    return folder


@pytest.mark.slow
def test_it_runs_and_its_report_is_written_again_from_elsewhere(here: Path, tmp_path: Path):
    printed = succeeded(here, "run", SCENE, "-p", "goal=0.4,0.3", "--out", "first")
    assert "two_link_reach succeeded" in printed
    assert "from the tip to the goal" in printed  # its metric, with no headline declared
    record = Record(here / "first" / "signals.parquet")
    assert np.linalg.norm(record["arm.p_WE"][-1] - [0.4, 0.3]) < 0.005
    (here / "first" / "report.html").unlink()
    untrusted = call(tmp_path, "report", str(here / "first"))
    assert f"--trust {here / 'reach.py'}" in untrusted.stderr
    succeeded(tmp_path, "report", str(here / "first"), "--figures", "--trust", str(here / "reach.py"))
    assert "TwoLinkReach draws them by its own code" not in (here / "first" / "report.html").read_text(encoding="utf-8")
    page = (here / "first" / "report.html").read_text(encoding="utf-8")
    assert "An arm of two links reaches for a point" in page
    assert "where the tip is to come" in page
    assert "Distance to the goal" in page
    assert (here / "first" / "figures" / "distance.png").is_file()


def loaded(file: Path) -> Any:
    """Return a module of the tutorial."""
    spec = importlib.util.spec_from_file_location(f"tutorial_{file.stem}", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # dataclasses look for it
    spec.loader.exec_module(module)
    return module


def test_the_tutorials_figure_is_the_distance_to_the_goal(here: Path):
    reach = loaded(here / "reach.py")
    record = {"arm.p_WE": np.array([[0.3, 0.6], [0.3, 0.5], [0.0, 0.2]])}
    (figure,) = reach.TwoLinkReach().time_figures(reach.Parameters(), record)
    assert figure.plots[0].curves[0].values == pytest.approx([0.0, 100.0, 500.0])


def test_the_tutorials_generator_goes_on_from_a_state_bit_for_bit(here: Path):
    encoders = loaded(here / "encoders.py")
    u = encoders.Inputs(q=np.array([0.5, 1.0]))
    block, other = (encoders.NoisyEncoders(encoders.Params(sigma=0.01, seed=seed)) for seed in (1, 2))
    block.step(0.0, 0.01, u)
    state = block.get_state()
    ahead = [block.step(0.01 * k, 0.01, u).q_meas for k in range(1, 200)]
    other.set_state(state)
    assert np.array_equal(ahead, [other.step(0.01 * k, 0.01, u).q_meas for k in range(1, 200)])
    assert np.std(np.subtract(ahead, u.q)) == pytest.approx(0.01, rel=0.1)


def test_list_prints_scenario_controller_and_plant(here: Path):
    printed = succeeded(here, "list", SCENE)
    assert "An arm of two links reaches for a point" in printed
    assert "where the tip is to come, in W" in printed
    assert "SpringToGoal: tau = J^T k (p_WG - p_WE) - d v" in succeeded(here, "list", "goal_spring:SpringToGoal")


@pytest.mark.slow
def test_another_block_or_file_takes_a_units_place(here: Path, tmp_path: Path):
    (here / "softer.py").write_text(SOFTER)
    succeeded(here, "run", SCENE, "--out", "stiff", "--no-report")
    succeeded(here, "run", SCENE, "--unit", "controller=softer:Softer", "--out", "soft", "--no-report")
    first = [Record(here / name / "signals.parquet")["controller.tau"][0] for name in ("stiff", "soft")]
    np.testing.assert_allclose(first[1], 0.5 * first[0], rtol=1e-12)
    built = succeeded(here, "build", "softer:Softer", "--fmi", "3", "--out", "fmus").strip()
    succeeded(here, "run", SCENE, "--unit", f"controller={built}", "--out", "file", "--no-report")
    again = ("--out", str(here / "again"), "--no-report")
    succeeded(tmp_path, "run", "--config", str(here / "soft" / "run.json"), *again)  # from elsewhere
    signals = [(here / name / "signals.parquet").read_bytes() for name in ("soft", "file", "again")]
    assert signals[0] == signals[1] == signals[2]


@pytest.mark.slow
def test_a_run_that_was_interrupted_is_resumed_and_not_with_other_code(here: Path, tmp_path: Path):
    options = ["-p", "goal=0.1,0.5", "--no-report"]
    succeeded(here, "run", SCENE, *options, "--out", "whole")
    run = subprocess.Popen(
        [*COMMAND, "run", SCENE, *options, "--checkpoint", "0.2", "--pace", "1", "--out", "cut"], cwd=here
    )
    deadline = time.monotonic() + 120
    while not (here / "cut" / "checkpoint.zip").exists() and time.monotonic() < deadline:
        time.sleep(0.05)
    run.send_signal(signal.SIGINT)
    assert run.wait(60) == 1
    before = (here / "reach.py").read_text()
    (here / "reach.py").write_text(before + "\n# changed\n")
    line = call(tmp_path, "resume", str(here / "cut")).stderr
    assert f"reach:TwoLinkReach: its code, {here / 'reach.py'}, is not what the run had" in line
    (here / "reach.py").write_text(before)
    resumed = call(tmp_path, "resume", str(here / "cut"), "--no-report")
    assert resumed.returncode == 0, resumed.stderr
    assert f"this runs the code of reach:TwoLinkReach: {here / 'reach.py'}" in resumed.stderr
    signals = [(here / name / "signals.parquet").read_bytes() for name in ("whole", "cut")]
    assert signals[0] == signals[1]


def test_an_evaluators_checkpoints_are_written_or_refused_before_the_run(here: Path):
    code = (here / "reach.py").read_text()
    (here / "reach.py").write_text(code.replace("self.parameters", "self.p"))
    checkpoints = ("--no-report", "--checkpoint", "0.05", "-p", "patience=0.1")
    ran(here, "run", SCENE, *checkpoints, "--out", "named")
    with_set = code.replace("self.is_there = False", "self.is_there, self.ever = False, set()", 1)
    assert with_set != code
    (here / "reach.py").write_text(with_set)
    line = refused(here, "run", SCENE, *checkpoints, "--out", "odd")
    assert "what reach:ReachEvaluator has seen cannot be kept in a checkpoint: a state cannot hold builtins.set" in line


@pytest.mark.slow
def test_a_sweep_goes_on_after_a_kill_and_its_report_is_written_from_elsewhere(here: Path, tmp_path: Path):
    sweep = ["sweep", SCENE, "goal=0.3,0.6;0.4,0.2;-0.5,0.3", "--repeat", "2", "--workers", "2", "--out", "goals"]
    killed = subprocess.Popen([*COMMAND, *sweep], cwd=here, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not list(here.glob("goals/runs/0*/summary.json")) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.kill(killed.pid, signal.SIGKILL)
    killed.wait()
    done = {p.parent.name: p.stat().st_mtime_ns for p in here.glob("goals/runs/0*/summary.json")}
    assert done
    printed = succeeded(here, *sweep)
    assert "6 of 6 runs done" in printed
    assert {name: (here / "goals/runs" / name / "summary.json").stat().st_mtime_ns for name in done} == done
    table = CampaignTable.read(here / "goals" / "runs.parquet")
    assert "distance" in table.metrics
    succeeded(tmp_path, "report", str(here / "goals"))
    page = (here / "goals" / "report.html").read_text(encoding="utf-8")
    assert "An arm of two links reaches for a point" in page
    run = next(here.glob("goals/runs/0*/run.json"))
    assert json.loads(run.read_text())["source"]["folder"] == str(here)
    succeeded(tmp_path, "report", str(run.parent), "--trust", str(here / "reach.py"))


@pytest.mark.slow
def test_its_ssp_runs_like_it(here: Path):
    succeeded(here, "export", SCENE, "--ssp", "reach.ssp")
    succeeded(here, "run", "reach.ssp", "--out", "exported", "--no-report")
    succeeded(here, "run", SCENE, "--out", "own", "--no-report")
    ours, theirs = (Record(here / name / "signals.parquet") for name in ("own", "exported"))
    n = min(len(ours.time), len(theirs.time))
    np.testing.assert_array_equal(ours["arm.p_WE"][:n], theirs["arm.p_WE"][:n])


def test_what_is_wrong_is_told_in_one_line_and_nothing_is_written(here: Path):
    assert "did you mean TwoLinkReach?" in refused(here, "run", "reach:TwoLinkRech")
    assert "there is no module 'reech'" in refused(here, "run", "reech:TwoLinkReach")
    assert "goal_spring:SpringToGoal: SpringToGoal is no scenario" in refused(here, "run", "goal_spring:SpringToGoal")
    assert "a scenario of your own is named MODULE:CLASS" in refused(here, "run", "two_link_reach")
    assert "two_link_reach has no parameter 'goall'; did you mean goal?" in refused(
        here, "run", SCENE, "-p", "goall=1,1"
    )
    assert "module 'goal_spring' has no class 'Spring'" in refused(
        here, "run", SCENE, "--unit", "controller=goal_spring:Spring"
    )
    (here / "broken.py").write_text("import nowhere_to_be_found\n")
    assert "the module nowhere_to_be_found is needed, which this Python does not have" in refused(
        here, "sweep", "broken:Scene"
    )


def test_all_that_a_scenario_lacks_is_told_at_once(here: Path):
    (here / "lacking.py").write_text(
        "from reach import TwoLinkReach\nfrom handover.scenarios.experiment.experiment import Experiment\n\n\n"
        "class Scene(Experiment):\n    name = 'ir_grasp'\n    units = {'arm': 'arm:TwoLinkArms', 'servo': 'Visual'}\n"
        "    parameters_type = dict\n\n"
        "    def build(self, parameters, seed, fmu):\n        raise ValueError\n\n\n"
        "class Failing(TwoLinkReach):\n    def evaluator(self, parameters):\n        return parameters.gaol\n"
    )
    line = refused(here, "run", "lacking:Scene")
    for fault in (
        "it has no method 'evaluator'",
        "it has no method 'stop_time'",
        "its name 'ir_grasp' is that of a scenario of this package",
        "its parameters are invalid: <class 'dict'> is no dataclass",
        "did you mean TwoLinkArm?",
        "there is no unit 'Visual'",
    ):
        assert fault in line
    for command in ("run", "sweep"):
        line = refused(here, command, "lacking:Failing")
        assert "the scenario failing failed as it was set up: AttributeError" in line
        assert "(lacking.py, line 16)" in line


@pytest.mark.slow
def test_an_installed_package_adds_scenarios_and_units_by_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    installed = tmp_path / "site-packages"
    information = installed / "reaching-1.0.dist-info"
    information.mkdir(parents=True)
    write_files(installed)
    (information / "METADATA").write_text("Metadata-Version: 2.1\nName: reaching\nVersion: 1.0\n")
    (information / "entry_points.txt").write_text(
        "[handover.scenarios]\nreaching = reach:TwoLinkReach\n\n[handover.units]\nPlanarArm = arm:TwoLinkArm\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(installed))
    empty = tmp_path / "empty"
    empty.mkdir()
    printed = succeeded(empty, "list")
    assert "reaching" in printed
    assert "An arm of two links reaches for a point" in printed
    assert "PlanarArm" in printed
    succeeded(empty, "run", "reaching", "--out", "run", "--no-report")
    source = json.loads((empty / "run" / "run.json").read_text())["source"]
    assert source["folder"] == str(installed)  # on the path, but not where this interpreter has its packages
    succeeded(empty, "report", "run")
    assert "TwoLinkArm" in succeeded(empty, "list", "reaching")
    assert "joint angles" in succeeded(empty, "list", "PlanarArm")


@pytest.mark.slow
def test_the_readmes_commands_work_beside_the_tutorials_files(here: Path):
    readme = (TUTORIAL.parents[1] / "README.md").read_text(encoding="utf-8")
    lines = [line for line in readme.splitlines() if line.startswith("handover ")]
    assert [line.split()[1] for line in lines] == ["list", "run", "sweep", "run", "sweep", "export"]
    for line in lines:
        succeeded(here, *shlex.split(line)[1:])
