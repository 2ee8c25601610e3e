"""Measured points as a file: written, read, refused."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
from vsl_training_points import ARM, call, key_of_made_up, made_up

from handover.scenarios.cli.robots import vsl_train as vsl_train_command
from handover.scenarios.vsl.data_file import InvalidData, read_data, write_data

PARAMETERS = made_up(1).origin["arm"]["parameters"]


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


def scaled(name: str, factor: float) -> Callable[[Any], Any]:
    def change(table: Any) -> Any:
        for k in range(1, 4):
            if f"{name}[{k}]" in table.column_names:
                table = with_column(f"{name}[{k}]", factor * np.asarray(table[f"{name}[{k}]"]))(table)
        return table

    return change


def shuffled(name: str) -> Callable[[Any], Any]:
    def change(table: Any) -> Any:
        rows = np.random.default_rng(0).permutation(100)
        for k in range(1, 4):
            table = with_column(f"{name}[{k}]", np.asarray(table[f"{name}[{k}]"])[rows])(table)
        return table

    return change


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
        (scaled("p_meas", 1e-5), r"its p_meas, up to 1\.\d+, cannot be in Pa above the air outside"),
        (scaled("i_meas", 1e3), "its i_meas, up to 99.*, cannot be in A"),
        (scaled("q_meas", 180.0 / np.pi), r"its q_meas, up to 9.\..*, cannot be in rad"),
        (scaled("q_cmd", 180.0 / np.pi), r"its q_cmd, up to 9.\..*, cannot be in rad"),
        (with_column("p_meas[1]", [3.2e5] * 100), r"its p_meas, up to 3.*e\+05, cannot be in Pa above"),
        (shuffled("p_WG_meas"), "its p_WG_meas is .*, or they are not of the same points"),
        (scaled("p_WG_meas", 1e3), "its p_WG_meas is .* m from where rigid links have the tip by q_meas"),
        (about(version=9), "is not of version 1"),
        (about(seed="x"), "has a seed or walk of a wrong kind"),
        (about(arm={"key": "k", "parameters": PARAMETERS | {"EI_0": 1.0}}), "on an arm with EI_0 = 1.0, not 0.55"),
        (about(arm={"key": "k", "parameters": {}}), r"EI_0 = None, not 0.55, EI_factor = .* and \d+ more"),
        (about(arm={"key": "k"}), "lacks the arm's parameters"),
        (about(arm=None), "lacks arm, links, seed or walk"),
        (with_metadata(None), "does not say of which arm it is"),
        (with_metadata({b"handover-vsl-data": b"{"}), "is not JSON"),
    ],
)
def test_data_that_cannot_be_trained_on_is_refused(change: Callable[[Any], Any], text: str, tmp_path: Path):
    write_data(tmp_path / "d.parquet", made_up(100))
    pq.write_table(change(pq.read_table(tmp_path / "d.parquet")), tmp_path / "d.parquet")
    with pytest.raises(InvalidData, match=text):
        read_data(tmp_path / "d.parquet", "k", ARM, PARAMETERS)


@pytest.mark.parametrize("arm", ["EI_factor=0.15,0.15,0.15", "kt=0.05", "kt=20"])
def test_points_of_the_oddest_arms_are_taken_back(arm: str, tmp_path: Path):
    out = tmp_path / "m.json"
    first = call("--points", "400", "--arm", arm, "--save-data", tmp_path / "d.parquet", "--out", out)
    assert first.exit_code == 0, first.output
    again = call("--data", tmp_path / "d.parquet", "--arm", arm, "--out", out)
    assert again.exit_code == 0, again.output


def test_data_of_an_arm_with_other_parameters_are_refused_unless_that_arm_is_meant(tmp_path: Path):
    out = tmp_path / "m.json"
    first = call("--points", "400", "--arm", "EI_0=0.605", "--save-data", tmp_path / "d.parquet", "--out", out)
    assert first.exit_code == 0, first.output
    former = out.read_bytes()
    result = call("--data", tmp_path / "d.parquet", "--out", out)
    assert result.exit_code == 2
    assert "it was measured on an arm with EI_0 = 0.605, not 0.55: --arm NAME=VALUE says which" in result.output
    assert out.read_bytes() == former
    result = call("--data", tmp_path / "d.parquet", "--arm", "EI_0=0.605", "--out", out)
    assert result.exit_code == 0, result.output
    assert out.read_bytes() == former
    assert call("--data", tmp_path / "d.parquet", "--adapt", out, "--out", tmp_path / "n.json").exit_code == 0


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
