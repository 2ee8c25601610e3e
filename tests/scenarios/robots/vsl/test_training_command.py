"""The command `handover vsl-train`."""

import errno
import os
import re
import shutil
import signal
import sys
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pytest
from support.scenarios.vsl_training_points import TRAINING, Trained, call, made_up, nobody, shipped
from support.wording import Wording

from handover.controllers.vsl.hybrid_kinematics import HybridKinematics, InvalidModel, Params, shipped_file
from handover.controllers.vsl.kinematics import Elbow
from handover.controllers.vsl.learned_model import ForwardInput, VslModel
from handover.controllers.vsl.model_text import read_model
from handover.fmus.build import build_block
from handover.scenarios.cli.robots import vsl_train as vsl_train_command
from handover.scenarios.robots.vsl import learning_curve as curve_module
from handover.scenarios.robots.vsl.data_file import write_data
from handover.scenarios.robots.vsl.learning_curve import curve_table, learning_curve
from handover.scenarios.robots.vsl.residuals import Errors
from handover.scenarios.robots.vsl.training import Progress, VslTraining
from handover.scenarios.robots.vsl.training_data import Measured


def test_a_model_says_what_it_was_made_of(trained: Trained):
    assert "400 points" in trained.output
    text = read_model(trained.model).provenance
    assert (text["arm"]["fmu"], text["arm"]["parameters"]["motion"], text["seed"]) == ("VslArm", "QUASI_STATIC", 1)
    assert 300 < sum(text["points"][k] for k in ("training", "validation", "test")) <= 400
    assert text["mean_test_errors_m"]["forward_hybrid"] < 0.1 * text["mean_test_errors_m"]["forward_model_based"]


@pytest.mark.slow
def test_the_command_that_a_refusal_advises_makes_the_model_that_is_lacking(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr(vsl_train_command, "MIN_POINTS", 200)
    links: dict[str, Any] = {"L_1": 0.2, "L_2": 0.3, "L_3": 0.26, "elbow": Elbow.DOWN}
    with pytest.raises(InvalidModel) as refused:
        HybridKinematics(Params(**links))
    advice = re.search(r"`handover vsl-train(.*)`", str(refused.value))
    assert advice is not None
    result = call(*advice[1].split(), "--points", "200", "--out", tmp_path / "m.json")
    assert result.exit_code == 0, result.output
    HybridKinematics(Params(**links, model=str(tmp_path / "m.json")))
    arm = read_model(tmp_path / "m.json").provenance
    assert all(arm["arm"]["parameters"][name] == value for name, value in links.items() if name != "elbow")
    assert arm["mean_test_errors_m"]["forward_hybrid"] < 0.1 * arm["mean_test_errors_m"]["forward_model_based"]


@pytest.mark.slow
def test_errors_fall_along_the_learning_curve_which_is_drawn(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    training, measured = replace(TRAINING, forward_input=ForwardInput.X), made_up(800)
    seen: list[float] = []
    curve = learning_curve(training, measured, lambda done, _of: seen.append(done), sizes=(400, 9999))
    assert [p.points for p in curve] == [400, 800]
    assert curve[-1].errors == training.learn(measured, nobody)[1]
    assert curve[-1].errors.forward_hybrid < curve[0].errors.forward_hybrid
    assert len({p.errors.forward_model_based for p in curve}) == 1  # the same test points
    assert len(list(curve_table(curve))) == 3
    assert seen == [1, 2]

    def known(*_given: object) -> Any:
        return curve

    monkeypatch.setattr(vsl_train_command, "learning_curve", known)
    monkeypatch.setattr(VslTraining, "measure", measured_at_once)
    result = call("--points", "400", "--curve", tmp_path / "a.b.png", "--out", tmp_path / "m.json")
    assert result.exit_code == 0, result.output
    assert {p.name for p in tmp_path.iterdir()} == {"a.b.png", "a.b.svg", "m.json"}
    assert re.search(r"^ +400 +\d+\.\d\d", result.output, re.MULTILINE)


def measured_at_once(_training: VslTraining, _progress: Progress) -> Measured:
    return made_up(400)


def test_model_and_data_are_written_before_the_curve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(_points: object, path: Path) -> None:
        path.with_suffix(".svg").write_text("<svg>")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(curve_module, "_draw", full)
    monkeypatch.setattr(VslTraining, "measure", measured_at_once)
    out, curve = tmp_path / "m.json", tmp_path / "c.png"
    result = call("--points", "400", "--save-data", tmp_path / "d.parquet", "--curve", curve, "--out", out)
    assert result.exit_code == 2
    assert re.search(r"--curve .*c\.png: No space left on device; the model is written: .*m\.json", result.output)
    assert {p.name for p in tmp_path.iterdir()} == {"d.parquet", "m.json"}


@pytest.mark.slow
def test_a_model_is_adapted_to_stiffer_links_by_few_points(tmp_path: Path):
    shutil.copyfile(shipped_file("cubic"), tmp_path / "m.json")
    stiffer = ("--arm", "EI_0=0.605", "--arm", "EI_p=1.155e-5")
    result = call("--adapt", tmp_path / "m.json", "--points", "50", *stiffer, "--out", tmp_path / "a.json")
    assert result.exit_code == 0, result.output
    rows = [line.split()[-2:] for line in result.output.splitlines() if re.match("forward|inverse", line)]
    assert all(float(adapted) < 0.7 * float(before) for before, adapted in rows)
    model = read_model(tmp_path / "a.json")
    assert model.provenance["adapted_from"] == shipped().provenance
    assert model.provenance["arm"]["parameters"]["EI_0"] == 0.605
    assert model.provenance["seed"] == shipped().provenance["seed"] + 1, "its points are others than the base's"
    again = call("--adapt", tmp_path / "a.json", "--points", "50", *stiffer, "--out", tmp_path / "b.json")
    assert again.exit_code == 0, again.output
    np.testing.assert_array_equal(
        read_model(tmp_path / "b.json").inverse.predict(np.ones(7)), model.inverse.predict(np.ones(7))
    )


def test_without_pytorch_the_published_network_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.setitem(sys.modules, "torch", None)
    result = call("--learned", "published", "--out", tmp_path / "m.json")
    assert result.exit_code == 2
    wording.check(result.output)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "arguments",
    [
        ["--points", "50"],
        ["--arm", "EI_factor=1.2,1.2"],
        ["--arm", "EI_0"],
        ["--arm", "EI=1"],
        ["--arm", "links=3"],
        ["--arm", "load_steps=8:0.1"],
        ["--arm", "EI_0=x"],
        ["--arm", "EI_0=-1"],
        ["--arm", "L_2=0.12", "--arm", "L_3=0.12"],
        ["--save-data", "d.csv"],
        ["--curve", "c.pdf"],
        ["--epochs", "3"],
        ["--learned", "physics", "--forward-input", "X"],
        ["--data", "d.parquet", "--seed", "1", "--walk"],
        ["--adapt", "m.json", "--learned", "small"],
        ["--adapt", "none.json"],
        ["--data", "none.parquet"],
        ["--out", "text.fmu/m.json"],
        ["--out", "m.txt"],
        pytest.param(["--out", "m" * 250 + ".json"], id="--out of a long name"),
        ["--out", "folder.json"],
        ["--plant", "none.fmu"],
        ["--plant", "text.fmu"],
    ],
    ids=" ".join,
)
def test_usage_errors_take_a_line(
    arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "text.fmu").write_text("text")
    before = sorted(tmp_path.iterdir())
    result = call(*arguments)
    assert result.exit_code == 2
    if not result.output.startswith("Usage:"):  # which are click's words
        wording.check(result.output)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(("arm", "status"), [("BreakingArm", 3), ("DistantArm", 2), ("ArmWithoutGauges", 2)])
def test_an_arm_that_fails_or_teaches_nothing_leaves_no_file(
    arm: str, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wording: Wording
):
    monkeypatch.setattr(vsl_train_command, "MIN_POINTS", 20)
    fmu = build_block(f"support.scenarios.vsl_training_arms:{arm}", 3, tmp_path, step=Fraction(1, 50))
    result = call("--points", "20", "--plant", fmu, "--out", tmp_path / "m.json")
    assert result.exit_code == status
    wording.check(re.sub(r", line \d+", "", result.output))
    assert not (tmp_path / "m.json").exists()


def test_a_folder_that_has_become_a_file_is_reported_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def gone(training: VslTraining, measured: Measured, _progress: Progress) -> tuple[VslModel, Errors]:
        (tmp_path / "a").rmdir()
        (tmp_path / "a").touch()
        return shipped(), training.residuals.errors(shipped(), measured.points.rows(np.arange(10)))

    (tmp_path / "a").mkdir()
    write_data(tmp_path / "d.parquet", made_up(400))
    monkeypatch.setattr(VslTraining, "learn", gone)
    result = call("--data", tmp_path / "d.parquet", "--out", tmp_path / "a" / "m.json")
    assert result.exit_code == 2
    assert "cannot be written: File exists" in result.output
    assert "Traceback" not in result.output


def test_ctrl_c_leaves_the_file_of_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    @contextmanager
    def interrupted(_stream: TextIO) -> Generator[Callable[[float, float], None], None, None]:
        yield lambda _t, _end: os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(vsl_train_command, "progress_bar", interrupted)
    (tmp_path / "m.json").write_text("former")
    assert call("--out", tmp_path / "m.json").exit_code == 130
    assert [p.read_text() for p in tmp_path.iterdir()] == ["former"]


def test_arrays_of_the_arm_are_given_with_commas(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    arms: list[Mapping[str, Any]] = []

    def measure(training: VslTraining, _progress: Progress) -> Measured:
        arms.append(training.arm)
        return made_up(400)

    monkeypatch.setattr(VslTraining, "measure", measure)
    result = call("--points", "400", "--arm", "EI_factor=1.2,1.1,1", "--out", tmp_path / "m.json")
    assert result.exit_code == 0, result.output
    assert [arm["EI_factor"].tolist() for arm in arms] == [[1.2, 1.1, 1.0]]
