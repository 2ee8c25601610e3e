"""Measured points as a file: written, read, refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from support.scenarios.vsl_training_points import ARM, Trained, call, made_up, nobody
from support.wording import Wording

from handover.fmus.build import cached
from handover.scenarios.robots.vsl.data_file import InvalidData, read_data, write_data
from handover.scenarios.robots.vsl.training import VslTraining

PARAMETERS = made_up(1).origin["arm"]["parameters"]
SHUFFLED = np.random.default_rng(0).permutation(100)


def test_training_from_saved_points_gives_the_same_bytes(trained: Trained, tmp_path: Path):
    again = call("--data", trained.data, "--out", tmp_path / "b.json")
    assert again.exit_code == 0, again.output
    assert trained.model.read_bytes() == (tmp_path / "b.json").read_bytes()
    assert trained.output.replace(str(trained.model), str(tmp_path / "b.json")) == again.output


@pytest.mark.parametrize("learned", [["--learned", "physics"], ["--friction-compensation"]], ids=" ".join)
def test_what_was_learned_is_reported(learned: list[str], tmp_path: Path):
    write_data(tmp_path / "d.parquet", made_up(240))
    done = call("--data", tmp_path / "d.parquet", *learned, "--out", tmp_path / "a.json")
    assert done.exit_code == 0, done.output
    assert ("currents by friction" in done.output) == (learned == ["--friction-compensation"])
    assert ("from X = f(q) in place of q" in done.output) == (learned != ["--learned", "physics"])


def test_points_of_a_file_are_those_written(tmp_path: Path):
    measured = made_up(100)
    write_data(tmp_path / "d.parquet", measured)
    back = read_data(tmp_path / "d.parquet", ARM)
    assert back.digest() == measured.digest()
    assert back.origin == measured.origin
    for name, values in vars(measured.points).items():
        np.testing.assert_array_equal(getattr(back.points, name), values)


def with_column(name: str, values: Any) -> Callable[[Any], Any]:
    return lambda table: table.set_column(table.column_names.index(name), name, [values])


def changed(name: str, change: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def with_all(table: Any) -> Any:
        for k in range(1, 4):
            if f"{name}[{k}]" in table.column_names:
                table = with_column(f"{name}[{k}]", change(np.asarray(table[f"{name}[{k}]"])))(table)
        return table

    return with_all


def without_place(table: Any) -> Any:
    return table.drop_columns(["p_WG_meas[2]"])


def with_metadata(metadata: Any) -> Callable[[Any], Any]:
    return lambda table: table.replace_schema_metadata(metadata)


def about(**origin: Any) -> Callable[[Any], Any]:
    def change(table: Any) -> Any:
        kept = json.loads(table.schema.metadata[b"handover-vsl-data"])
        return table.replace_schema_metadata({b"handover-vsl-data": json.dumps(kept | origin).encode()})

    return change


@pytest.mark.parametrize(
    "change",
    [
        pytest.param(without_place, id="no place"),
        pytest.param(with_column("i_meas[3]", [0.0] * 7 + [float("nan")] * 93), id="no numbers"),
        pytest.param(with_column("q_cmd[1]", ["x"] * 100), id="text"),
        pytest.param(with_column("order", [0] * 100), id="one place in the order"),
        pytest.param(about(links={"L_1": 0.15, "L_2": 0.2, "L_3": 0.2, "elbow": "UP"}), id="other links"),
        pytest.param(changed("p_meas", lambda p: 1e-5 * p), id="bar"),
        pytest.param(changed("i_meas", lambda i: 1e3 * i), id="milliamperes"),
        pytest.param(changed("q_meas", np.degrees), id="degrees"),
        pytest.param(with_column("p_meas[1]", [3.2e5] * 100), id="too much pressure"),
        pytest.param(changed("p_WG_meas", lambda x: x[SHUFFLED]), id="tips of other points"),
        pytest.param(changed("p_WG_meas", lambda x: 1e3 * x), id="millimetres"),
        pytest.param(about(version=9), id="version"),
        pytest.param(about(seed="x"), id="seed"),
        pytest.param(about(arm={"parameters": PARAMETERS | {"EI_0": 1.0}}), id="another parameter"),
        pytest.param(about(arm={"parameters": {}}), id="no parameters"),
        pytest.param(about(arm=None), id="no arm"),
        pytest.param(with_metadata(None), id="no metadata"),
        pytest.param(with_metadata({b"handover-vsl-data": b"{"}), id="no JSON"),
    ],
)
def test_data_that_cannot_be_trained_on_is_refused(change: Callable[[Any], Any], tmp_path: Path, wording: Wording):
    path = tmp_path / "d.parquet"
    write_data(path, made_up(100))
    pq.write_table(change(pq.read_table(path)), path)
    with pytest.raises(InvalidData) as caught:
        read_data(path, ARM, PARAMETERS)
    assert caught.value.path == path
    wording.check(caught.value.fault)


@pytest.mark.parametrize(
    "arm", [{"EI_factor": np.full(3, 0.15), "kt": 0.05}, {"kt": 20.0}], ids=["soft and low kt", "high kt"]
)
def test_points_of_the_oddest_arms_are_taken_back(arm: dict[str, Any], tmp_path: Path):
    training = VslTraining(fmu=cached("VslArm", 3), kinematics=ARM, points=30, seed=0, arm=arm)
    measured, path = training.measure(nobody), tmp_path / "d.parquet"
    write_data(path, measured)
    back = read_data(path, ARM, training.parameters())
    training.check(back)
    assert back.digest() == measured.digest()


def test_data_of_an_arm_with_other_parameters_are_refused_unless_that_arm_is_meant(tmp_path: Path, wording: Wording):
    measured, out, data = made_up(240), tmp_path / "m.json", tmp_path / "d.parquet"
    measured.origin["arm"]["parameters"]["EI_0"] = 0.605
    write_data(data, measured)
    result = call("--data", data, "--out", out)
    assert result.exit_code == 2
    wording.check(result.output)
    assert not out.exists()
    result = call("--data", data, "--arm", "EI_0=0.605", "--out", out)
    assert result.exit_code == 0, result.output
    assert call("--data", data, "--adapt", out, "--out", tmp_path / "n.json").exit_code == 0


def test_data_of_too_few_points_or_without_gauges_are_refused(tmp_path: Path, wording: Wording):
    without_gauges = made_up(400)
    without_gauges.points.p[:] = 1e5
    far = made_up(400)
    far.points.p_WG[far.order == 7] = [0.6, 0.0, 0.15]
    for measured in (made_up(100), without_gauges, far):
        write_data(tmp_path / "d.parquet", measured)
        result = call("--data", tmp_path / "d.parquet", "--out", tmp_path / "m.json")
        assert result.exit_code == 2
        wording.check(result.output)
        assert not (tmp_path / "m.json").exists()


@pytest.mark.parametrize("content", [b"", b"text", b"PAR1 and more"], ids=["empty", "text", "begun"])
def test_a_file_that_is_no_parquet_is_refused_and_nothing_overwritten(content: bytes, tmp_path: Path):
    (tmp_path / "d.parquet").write_bytes(content)
    (tmp_path / "m.json").write_text("former")
    result = call("--data", tmp_path / "d.parquet", "--out", tmp_path / "m.json")
    assert result.exit_code == 2
    assert "it is not a Parquet file that can be read" in result.output  # the rest is PyArrow's words
    assert (tmp_path / "m.json").read_text() == "former"
