import os
import re
import signal
import types
import zipfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pytest
from click.testing import CliRunner, Result

from handover.controllers.vsl.default_model import DEFAULT_MODEL
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import VslModel
from handover.controllers.vsl.model_text import parse_model, read_model
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.archive import write_archive
from handover.cosim.master.master import Master
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus.build import build_block, cached
from handover.scenarios.cli import vsl_train as vsl_train_command
from handover.scenarios.cli.vsl_train import vsl_train
from handover.scenarios.vsl.training import Errors, VslTraining, content_key, split
from handover.scenarios.vsl.training_data import Dataset, describe_arm

ARM = VslKinematics(0.15, 0.225, 0.225, Elbow.UP)
TRAINING = VslTraining(fmu=Path("none"), kinematics=ARM, points=0, seed=0)


def call(*arguments: str | Path) -> Result:
    return CliRunner().invoke(vsl_train, [str(a) for a in arguments])


def points(n: int, droop: Floats, sag: Floats) -> Dataset:
    """Return points of an arm whose joints droop, and whose tip hangs off where they put it, in its own plane."""
    rng = np.random.default_rng(2)
    q_cmd = np.column_stack([rng.uniform(-0.5, 0.5, n), rng.uniform(0.2, 0.9, n), rng.uniform(-1.6, -0.8, n)])
    q = q_cmd + droop
    c, s = np.cos(q[:, 0]), np.sin(q[:, 0])
    in_W = np.column_stack([c * sag[0] - s * sag[1], s * sag[0] + c * sag[1], np.full(n, sag[2])])
    p_WG = np.array([ARM.forward(x) for x in q]) + in_W
    return Dataset(p_WG, rng.uniform(5e4, 2e5, (n, 2)), rng.uniform(-1.0, 1.0, (n, 3)), q, q_cmd)


def test_split_is_70_15_15_and_loses_nothing():
    parts = split(1000, np.random.default_rng(0))
    assert [len(p) for p in parts] == [700, 150, 150]
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.arange(1000))


def test_forward_residuals_are_those_of_the_plane_that_joint_1_turns():
    sag = np.array([-0.01, 0.002, -0.03])
    inputs, residuals = TRAINING.forward_pairs(points(50, np.zeros(3), sag))
    np.testing.assert_allclose(residuals, np.tile(sag, (50, 1)), atol=1e-12)
    assert inputs.shape == (50, 7)


def test_inverse_residuals_lead_from_the_measured_tip_to_the_command():
    droop = np.array([0.0, -0.02, -0.01])
    data = points(50, droop, np.zeros(3))
    inputs, residuals = TRAINING.inverse_pairs(data)
    np.testing.assert_allclose(inputs[:, :3], data.q, atol=1e-9)
    np.testing.assert_allclose(residuals, np.tile(-droop, (50, 1)), atol=1e-9)


def test_key_follows_the_sources_of_the_plant_alone(tmp_path: Path):
    plant, engine = (f"resources/sources/handover/{m}.py" for m in ("plants/vsl/arm", "cosim/blocks/block"))

    def key(name: str, **files: bytes) -> str:
        sources = {
            "resources/sources/handover/plants/arm.py": b"1",
            "resources/sources/handover/cosim/blocks/block.py": b"2",
            **files,
        }
        return content_key(write_archive(tmp_path / name, sources))

    first = key("a.fmu")
    assert key("b.fmu") == first
    assert key("c.fmu", **{engine: b"3"}) == first
    assert key("d.fmu", **{plant: b"3"}) != first
    with zipfile.ZipFile(tmp_path / "e.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", "1")
    assert content_key(tmp_path / "e.fmu") != first


def test_an_arm_without_the_ports_is_refused():
    with pytest.raises(InvalidFmu, match=r"no input 'q_cmd' \(3 real\).*no output 'p_WG_meas' \(3 real\)"):
        describe_arm(cached("TrajectoryPlanner", 3))


def test_the_same_seed_gives_the_same_model_in_both_forms(tmp_path: Path):
    for name in ("m.json", "m.py"):
        result = call("--points", "400", "--seed", "1", "--out", tmp_path / name)
        assert result.exit_code == 0, result.output
        assert "400 points measured" in result.output
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m.json", "m.py"]
    module = types.ModuleType("m")
    exec((tmp_path / "m.py").read_text(), vars(module))
    assert vars(module)["DEFAULT_MODEL"] == (tmp_path / "m.json").read_text()
    assert "--points 400 --seed 1" in (module.__doc__ or "")
    text = read_model(tmp_path / "m.json").provenance
    assert text["arm"]["fmu"] == "VslArm"
    assert text["arm"]["parameters"]["motion"] == "QUASI_STATIC"
    assert text["seed"] == 1
    assert 300 < sum(text["points"][k] for k in ("training", "validation", "test")) <= 400
    assert text["mean_test_errors_m"]["forward_hybrid"] < 0.1 * text["mean_test_errors_m"]["forward_model_based"]


def test_another_seed_gives_another_model():
    a, b = (
        VslTraining(fmu=cached("VslArm", 3), kinematics=ARM, points=40, seed=seed).train(lambda _t, _end: None)[0]
        for seed in (1, 2)
    )
    assert np.all(a.inverse.mean != b.inverse.mean)
    assert a.provenance["arm"]["parameters"]["seed"] != b.provenance["arm"]["parameters"]["seed"]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--points", "10"], "10 is not in the range"),
        (["--seed", "-1"], "-1 is not in the range"),
        (["--out", "none/m.json"], "there is no folder"),
        (["--out", "m.txt"], "ends in .json"),
        (["--out", "m" * 250 + ".json"], "the name is longer than"),
        (["--elbow", "left"], "'left' is not one of"),
        (["--out", "folder.json"], "there is a folder of that name"),
        (["--plant", "none.fmu"], "none.fmu"),
        (["--plant", "text.fmu"], "not an FMU"),
    ],
)
def test_usage_errors_take_a_line(arguments: list[str], text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder.json").mkdir()
    (tmp_path / "text.fmu").write_text("text")
    before = sorted(tmp_path.iterdir())
    result = call(*arguments)
    assert result.exit_code == 2
    assert text in result.output
    assert "Traceback" not in result.output
    assert sorted(tmp_path.iterdir()) == before


def test_an_arm_that_fails_leaves_no_file(tmp_path: Path):
    fmu = build_block("vsl_training_arms:BreakingArm", 3, tmp_path, step=Fraction(1, 50))
    result = call("--plant", fmu, "--out", tmp_path / "m.json")
    assert result.exit_code == 3
    assert "the arm broke" in result.output
    assert not (tmp_path / "m.json").exists()


@pytest.mark.parametrize(
    ("arm", "text"),
    [
        ("DistantArm", "0 of 400 measured tips are where links of 0.225 and 0.225 m"),
        ("ArmWithoutGauges", r"the same at all points, whatever is commanded: p_meas\[1\], p_meas\[2\]"),
    ],
)
def test_an_arm_that_teaches_nothing_is_refused(arm: str, text: str, tmp_path: Path):
    fmu = build_block(f"vsl_training_arms:{arm}", 3, tmp_path, step=Fraction(1, 50))
    result = call("--points", "400", "--plant", fmu, "--out", tmp_path / "m.json")
    assert result.exit_code == 2
    assert re.search(text, result.output)
    assert "Traceback" not in result.output
    assert not (tmp_path / "m.json").exists()


def test_a_folder_that_goes_away_is_reported_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def gone(training: VslTraining, _progress: Callable[[float, float], None]) -> tuple[VslModel, Errors]:
        (tmp_path / "a").rmdir()
        return shipped(), training.errors(shipped(), points(10, np.zeros(3), np.zeros(3)))

    (tmp_path / "a").mkdir()
    monkeypatch.setattr(VslTraining, "train", gone)
    result = call("--out", tmp_path / "a" / "m.json")
    assert result.exit_code == 2
    assert "No such file or directory" in result.output
    assert "Traceback" not in result.output


def test_the_elbow_is_the_models(tmp_path: Path):
    result = call("--points", "400", "--elbow", "down", "--out", tmp_path / "m.py")
    assert result.exit_code == 0, result.output
    module = types.ModuleType("m")
    exec((tmp_path / "m.py").read_text(), vars(module))
    assert parse_model(vars(module)["DEFAULT_MODEL"], "m").kinematics == replace(ARM, elbow=Elbow.DOWN)
    assert "--seed 0 --elbow down --out" in (module.__doc__ or "")


def test_ctrl_c_leaves_the_file_of_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    @contextmanager
    def interrupted(_stream: TextIO) -> Generator[Callable[[float, float], None], None, None]:
        yield lambda _t, _end: os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(vsl_train_command, "progress_bar", interrupted)
    (tmp_path / "m.json").write_text("former")
    assert call("--out", tmp_path / "m.json").exit_code == 130
    assert [p.read_text() for p in tmp_path.iterdir()] == ["former"]


def shipped() -> VslModel:
    return parse_model(DEFAULT_MODEL, "that ships")


def test_the_model_that_ships_was_trained_on_the_present_arm():
    key = shipped().provenance["arm"]["key"]
    assert key == content_key(cached("VslArm", 3)), "run `handover vsl-train --out controllers/vsl/default_model.py`"


@pytest.mark.slow
def test_the_model_that_ships_can_be_made_again():
    text = shipped().provenance
    training = VslTraining(
        fmu=cached("VslArm", 3), kinematics=ARM, points=text["points"]["measured"], seed=text["seed"]
    )
    again, _ = training.train(lambda _t, _end: None)
    assert again.provenance["arm"] == text["arm"]
    x = shipped().inverse.mean + np.random.default_rng(0).uniform(-1.5, 1.5, (100, 7)) * shipped().inverse.scale
    np.testing.assert_allclose(again.inverse.predict(x), shipped().inverse.predict(x), atol=2e-6)  # 1 um at the tip
    np.testing.assert_allclose(again.forward.predict(x), shipped().forward.predict(x), atol=1e-6)


def path_error(method: str, **arm: Any) -> float:
    """Return the mean distance of the tip from its goal on the curve, at 0.5 bar and with 75 g, m."""
    s = System()
    planner = s.add("planner", cached("TrajectoryPlanner", 3), path="CURVE", pressure=np.array([5e4, 5e4]))
    kinematics = s.add("kinematics", cached("HybridKinematics", 3), method=method)
    vsl = s.add("arm", cached("VslArm", 3), load=0.075, **arm)
    for source, target, names in (
        (planner, kinematics, ("q_ref", "qd_ref")),
        (planner, vsl, ("p_cmd",)),
        (kinematics, vsl, ("q_cmd", "qd_cmd")),
        (vsl, kinematics, ("q_meas", "p_meas", "i_meas")),
    ):
        for name in names:
            s.connect(getattr(source.y, name), getattr(target.u, name))
    errors: list[float] = []

    def look(_t: float, signals: Signals) -> None:
        if signals["planner.moving"]:
            errors.append(float(np.linalg.norm(signals["arm.p_WG"] - signals["planner.p_WG_goal"])))

    with Master(s) as master:
        master.run(Fraction(10), [look])
    assert len(errors) > 300
    return float(np.mean(errors))


def test_hybrid_errs_by_less_than_a_fifth_of_the_model_based():
    assert path_error("HYBRID") < path_error("MODEL_BASED") / 5.0


@pytest.mark.slow
def test_an_arm_that_swings_is_not_swung_up():
    assert path_error("HYBRID", motion="DYNAMIC") < path_error("MODEL_BASED", motion="DYNAMIC") / 5.0
