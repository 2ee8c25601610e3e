import errno
import json
import os
import re
import signal
import sys
import types
import zipfile
from collections.abc import Callable, Generator
from contextlib import contextmanager
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner, Result

from handover.controllers.vsl import default_friction_model, default_model, default_physics_model, default_small_model
from handover.controllers.vsl.default_model import DEFAULT_MODEL
from handover.controllers.vsl.hybrid_kinematics import HybridKinematics, Inputs, Params
from handover.controllers.vsl.kinematics import Elbow, VslKinematics
from handover.controllers.vsl.learned_model import ForwardInput, Learned, VslModel
from handover.controllers.vsl.model_text import model_text, parse_model, read_model
from handover.cosim.blocks.ports import Floats
from handover.cosim.exceptions import InvalidFmu
from handover.cosim.fmu.archive import write_archive
from handover.cosim.master.master import Master
from handover.cosim.system.signals import Signals
from handover.cosim.system.system import System
from handover.fmus.build import build_block, cached
from handover.scenarios.cli import vsl_train as vsl_train_command
from handover.scenarios.cli.vsl_train import vsl_train
from handover.scenarios.vsl import learning_curve as curve_module
from handover.scenarios.vsl.data_file import InvalidData, read_data, write_data
from handover.scenarios.vsl.learning_curve import curve_table, learning_curve
from handover.scenarios.vsl.model_file import content_key
from handover.scenarios.vsl.training import Errors, Progress, VslTraining
from handover.scenarios.vsl.training_data import Dataset, Measured, describe_arm

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


def key_of_made_up(_fmu: Path) -> str:
    return "k"


def nobody(_done: float, _of: float) -> None:
    """Take note of no progress."""


def made_up(n: int, seed: int = 2) -> Measured:
    """Return points with a sag that depends on pressures and currents, every tenth unusable."""
    data = points(n, np.array([0.0, -0.01, -0.01]), np.zeros(3))
    data = replace(
        data, p_WG=data.p_WG - np.column_stack([np.zeros((n, 2)), 1e-7 * data.p[:, 0] + 0.01 * data.i[:, 1]])
    )
    order = np.full(n, -1)
    usable = np.flatnonzero(np.arange(n) % 10 != 9)
    order[usable] = np.random.default_rng(seed).permutation(len(usable))
    links = {"L_1": 0.15, "L_2": 0.225, "L_3": 0.225, "elbow": "UP"}
    return Measured(data, order, {"arm": {"key": "k", "parameters": {}}, "links": links, "seed": seed, "walk": False})


def test_the_parts_are_70_15_15_of_the_usable_points_and_lose_nothing():
    measured = made_up(1000)
    parts = measured.parts()
    assert [len(p) for p in parts] == [630, 135, 135]
    np.testing.assert_array_equal(np.sort(np.concatenate(parts)), np.flatnonzero(measured.order >= 0))
    few = measured.parts(0.1)
    assert [len(p) for p in few] == [63, 14, 135]
    np.testing.assert_array_equal(few[0], parts[0][:63])
    np.testing.assert_array_equal(few[2], parts[2])


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
    assert np.all(a.inverse.domain.mean != b.inverse.domain.mean)
    assert a.provenance["arm"]["parameters"]["seed"] != b.provenance["arm"]["parameters"]["seed"]


def test_a_walk_changes_one_thing_a_point():
    training = VslTraining(fmu=cached("VslArm", 3), kinematics=ARM, points=60, seed=3, walk=True)
    data = training.measure(nobody).points
    turned = np.any(np.diff(data.q_cmd, axis=0) != 0.0, axis=1)
    blown = np.any(np.abs(np.diff(data.p, axis=0)) > 3000.0, axis=1)
    assert not np.any(turned & blown)
    assert 8 < np.sum(turned) < 35
    assert 8 < np.sum(blown) < 35
    assert np.sum(~turned & ~blown) > 5  # another load


@pytest.mark.parametrize("learned", [[], ["--learned", "physics"], ["--friction-compensation"]])
def test_training_from_saved_points_gives_the_same_bytes(learned: list[str], tmp_path: Path):
    first = call("--points", "400", *learned, "--save-data", tmp_path / "d.parquet", "--out", tmp_path / "a.json")
    assert first.exit_code == 0, first.output
    second = call("--data", tmp_path / "d.parquet", *learned, "--out", tmp_path / "b.json")
    assert second.exit_code == 0, second.output
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert first.output.replace("a.json", "b.json") == second.output
    assert ("currents by friction" in first.output) == (learned == ["--friction-compensation"])
    assert ("from X = f(q) in place of q" in first.output) == (learned != ["--learned", "physics"])


def test_points_of_a_file_are_those_written(tmp_path: Path):
    measured = made_up(100)
    write_data(tmp_path / "d.parquet", measured)
    back = read_data(tmp_path / "d.parquet", "k", ARM)
    assert back.digest() == measured.digest()
    assert back.origin == measured.origin
    for name, values in vars(measured.points).items():
        np.testing.assert_array_equal(getattr(back.points, name), values)


def without(name: str) -> Callable[[Any], Any]:
    return lambda table: table.drop_columns([name])


def with_column(name: str, values: Any) -> Callable[[Any], Any]:
    return lambda table: table.set_column(table.column_names.index(name), name, [values])


def with_metadata(metadata: Any) -> Callable[[Any], Any]:
    return lambda table: table.replace_schema_metadata(metadata)


def about(**origin: Any) -> Callable[[Any], Any]:
    def change(table: Any) -> Any:
        kept = json.loads(table.schema.metadata[b"handover-vsl-data"])
        return table.replace_schema_metadata({b"handover-vsl-data": json.dumps(kept | origin).encode()})

    return change


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (without("p_WG_meas[2]"), r"it lacks the columns p_WG_meas\[2\]"),
        (without("order"), "it lacks the columns order"),
        (
            with_column("i_meas[3]", [0.0] * 7 + [float("nan")] * 93),
            r"i_meas\[3\] is not finite in 93 rows, row 8 first",
        ),
        (with_column("i_meas[3]", [None] + [1.0] * 99), r"i_meas\[3\] has 1 rows without a value"),
        (with_column("q_cmd[1]", ["x"] * 100), r"q_cmd\[1\] holds string, not numbers"),
        (with_column("order", [0] * 100), "order must count the usable rows from 0"),
        (about(arm={"key": "other"}), "measured on another arm: the hash of its sources is other, not k"),
        (about(links={"L_1": 0.15, "L_2": 0.2, "L_3": 0.2, "elbow": "UP"}), "with links of L_1 0.15, L_2 0.2"),
        (about(version=9), "is not of version 1"),
        (about(seed="x"), "has a seed or walk of a wrong kind"),
        (about(arm=None), "lacks arm, links, seed or walk"),
        (with_metadata(None), "does not say of which arm it is"),
        (with_metadata({b"handover-vsl-data": b"{"}), "is not JSON"),
    ],
)
def test_data_that_cannot_be_trained_on_is_refused(change: Callable[[Any], Any], text: str, tmp_path: Path):
    write_data(tmp_path / "d.parquet", made_up(100))
    pq.write_table(change(pq.read_table(tmp_path / "d.parquet")), tmp_path / "d.parquet")
    with pytest.raises(InvalidData, match=text):
        read_data(tmp_path / "d.parquet", "k", ARM)


def test_data_of_too_few_points_or_without_gauges_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(vsl_train_command, "content_key", key_of_made_up)
    without_gauges = made_up(400)
    without_gauges.points.p[:] = 1e5
    far = made_up(400)
    far.points.p_WG[far.order == 7] = [0.6, 0.0, 0.15]
    for measured, text in (
        (made_up(100), r"--data .*d\.parquet: 90 points with a tip within reach are too few to train on: 200"),
        (without_gauges, r"d\.parquet: the same at all points, whatever is commanded: p_meas\[1\], p_meas\[2\]"),
        (far, r"d\.parquet: 1 of 360 points in its split have a tip out of reach"),
    ):
        write_data(tmp_path / "d.parquet", measured)
        result = call("--data", tmp_path / "d.parquet", "--out", tmp_path / "m.json")
        assert result.exit_code == 2
        assert re.search(text, result.output)
        assert "Traceback" not in result.output
        assert not (tmp_path / "m.json").exists()


@pytest.mark.parametrize("content", [b"", b"text", b"PAR1 and more"])
def test_a_file_that_is_no_parquet_is_refused_and_nothing_overwritten(content: bytes, tmp_path: Path):
    (tmp_path / "d.parquet").write_bytes(content)
    (tmp_path / "m.json").write_text("former")
    result = call("--data", tmp_path / "d.parquet", "--out", tmp_path / "m.json")
    assert result.exit_code == 2
    assert "it is no Parquet file that can be read" in result.output
    assert "Traceback" not in result.output
    assert (tmp_path / "m.json").read_text() == "former"


def test_errors_fall_along_the_learning_curve():
    training, measured = replace(TRAINING, forward_input=ForwardInput.X), made_up(800)
    seen: list[float] = []
    curve = learning_curve(training, measured, lambda done, _of: seen.append(done), sizes=(400, 600, 9999))
    assert [p.points for p in curve] == [400, 600, 800]
    assert curve[-1].errors == training.learn(measured, nobody)[1]
    assert curve[-1].errors.forward_hybrid < curve[0].errors.forward_hybrid
    assert len({p.errors.forward_model_based for p in curve}) == 1  # the same test points
    assert len(list(curve_table(curve))) == 4
    assert seen == [1, 2, 3]


def test_the_curve_is_drawn(tmp_path: Path):
    result = call("--points", "400", "--curve", tmp_path / "a.b.png", "--out", tmp_path / "m.json")
    assert result.exit_code == 0, result.output
    assert {p.name for p in tmp_path.iterdir()} == {"a.b.png", "a.b.svg", "m.json"}
    assert re.search(r"^ +250 +\d+\.\d\d", result.output, re.MULTILINE)


def test_model_and_data_are_written_before_the_curve(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    def full(_points: object, path: Path) -> None:
        path.with_suffix(".svg").write_text("<svg>")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(curve_module, "_draw", full)
    out, curve = tmp_path / "m.json", tmp_path / "c.png"
    result = call("--points", "400", "--save-data", tmp_path / "d.parquet", "--curve", curve, "--out", out)
    assert result.exit_code == 2
    assert re.search(r"--curve .*c\.png: No space left on device; the model is written: .*m\.json", result.output)
    assert {p.name for p in tmp_path.iterdir()} == {"d.parquet", "m.json"}


@pytest.mark.parametrize("learned", [Learned.CUBIC, Learned.SMALL])
@pytest.mark.parametrize("forward_input", list(ForwardInput))
def test_either_input_of_the_forward_model_is_learned(learned: Learned, forward_input: ForwardInput):
    training = replace(TRAINING, learned=learned, forward_input=forward_input)
    model, errors = training.learn(made_up(500), nobody)
    again = parse_model(model_text(model), "x")
    assert again.forward_input is forward_input
    assert errors.forward_other_input is not None
    assert errors.forward_hybrid < 0.2 * errors.forward_model_based
    assert errors.forward_other_input < 0.2 * errors.forward_model_based
    assert model.provenance["mean_test_errors_m"]["forward_other_input"] == pytest.approx(
        errors.forward_other_input, rel=1e-3
    )


def test_a_model_is_adapted_to_stiffer_links_by_few_points(tmp_path: Path):
    (tmp_path / "m.json").write_text(DEFAULT_MODEL)
    stiffer = ("--arm", "EI_0=0.605", "--arm", "EI_p=1.155e-5")
    result = call("--adapt", tmp_path / "m.json", "--points", "50", *stiffer, "--out", tmp_path / "a.json")
    assert result.exit_code == 0, result.output
    rows = [
        [float(x) for x in line.split()[-3:]]
        for line in result.output.splitlines()
        if re.match("forward|inverse", line)
    ]
    assert all(adapted < 0.7 * before for _, before, adapted in rows)
    model = read_model(tmp_path / "a.json")
    assert model.provenance["adapted_from"] == shipped().provenance
    assert model.provenance["arm"]["parameters"]["EI_0"] == 0.605
    again = call("--adapt", tmp_path / "a.json", "--points", "50", *stiffer, "--out", tmp_path / "b.json")
    assert again.exit_code == 0, again.output
    np.testing.assert_array_equal(
        read_model(tmp_path / "b.json").inverse.predict(np.ones(7)), model.inverse.predict(np.ones(7))
    )


@pytest.mark.slow
def test_a_published_network_is_trained_and_used(tmp_path: Path):
    pytest.importorskip("torch")
    out = tmp_path / "m.json"
    result = call("--learned", "published", "--points", "400", "--epochs", "20", "--out", out)
    assert result.exit_code == 0, result.output
    unit = HybridKinematics(Params(learned=Learned.PUBLISHED, model=str(out)))
    assert unit.step(0.0, 0.02, Inputs(q_ref=np.array([0.0, 0.6, -1.2]))).q_cmd.shape == (3,)
    facts = read_model(out).provenance["forward"]
    assert facts["epochs"] == 20
    assert facts["torch"]


def test_without_pytorch_the_published_network_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    result = call("--learned", "published", "--out", tmp_path / "m.json")
    assert result.exit_code == 2
    assert 'pip install "handover-cosim[train]"' in result.output
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--points", "10"], "10 is not in the range"),
        (["--points", "50"], "50 is not in the range x>=400"),
        (["--arm", "EI_0"], "is not of the form NAME=VALUE"),
        (["--arm", "EI=1"], "the arm has no parameter 'EI'"),
        (["--arm", "EI_0=x"], "'x' is not a number"),
        (["--arm", "EI_0=-1"], "--arm EI_0=-1"),
        (["--save-data", "d.csv"], "ends in .parquet"),
        (["--curve", "c.pdf"], "ends in .png"),
        (["--epochs", "3"], "of the published network alone"),
        (["--learned", "physics", "--forward-input", "X"], "begins with the joints' angles"),
        (["--data", "d.parquet", "--seed", "1", "--walk"], "--seed, --walk: with --data it is the file's"),
        (["--adapt", "m.json", "--learned", "small"], "--learned: with --adapt it is the model's"),
        (["--adapt", "none.json"], "none.json: it cannot be read"),
        (["--data", "none.parquet"], "it is no Parquet file that can be read"),
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
    def gone(training: VslTraining, measured: Measured, _progress: Progress) -> tuple[VslModel, Errors]:
        (tmp_path / "a").rmdir()
        return shipped(), training.errors(shipped(), measured.points.rows(np.arange(10)))

    (tmp_path / "a").mkdir()
    write_data(tmp_path / "d.parquet", made_up(400))
    monkeypatch.setattr(VslTraining, "learn", gone)
    monkeypatch.setattr(vsl_train_command, "content_key", key_of_made_up)
    result = call("--data", tmp_path / "d.parquet", "--out", tmp_path / "a" / "m.json")
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


@pytest.mark.parametrize("module", [default_model, default_friction_model, default_small_model, default_physics_model])
def test_the_models_that_ship_were_trained_on_the_present_arm(module: types.ModuleType):
    key = parse_model(module.DEFAULT_MODEL, "that ships").provenance["arm"]["key"]
    assert key == content_key(cached("VslArm", 3)), (module.__doc__ or "").splitlines()[-1]


@pytest.mark.slow
def test_the_model_that_ships_can_be_made_again():
    text = shipped().provenance
    training = VslTraining(
        fmu=cached("VslArm", 3), kinematics=ARM, points=text["points"]["measured"], seed=text["seed"]
    )
    again, _ = training.train(lambda _t, _end: None)
    assert again.provenance["arm"] == text["arm"]
    domain = shipped().inverse.domain
    x = domain.mean + np.random.default_rng(0).uniform(-1.5, 1.5, (100, 7)) * domain.scale
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
