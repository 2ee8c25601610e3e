"""Records in all their forms are read back by readers that are not ours."""

import csv
import struct
from pathlib import Path
from typing import Any

import DyMat
import numpy as np
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from support.cosim.signals_of import signals_of

from handover.cosim.blocks.units import Unit
from handover.cosim.blocks.variable import Kind
from handover.cosim.record.reader import Record
from handover.cosim.record.recorder import Recorder

ROWS = 700


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Record all kinds of signal, with the greatest and least integers, in all forms."""
    file = tmp_path_factory.mktemp("recorded") / "signals.parquet"
    arrays: dict[str, NDArray[Any]] = {
        "x": np.zeros(2),
        "single": np.zeros(1, np.float32),
        "n": np.zeros(1, np.int64),
        "small": np.zeros(1, np.int8),
        "large": np.zeros(1, np.uint64),
        "on": np.zeros(1, bool),
    }
    signals = signals_of(arrays, unit=Unit("m"), description="a length in μm")
    with Recorder(file, ["csv", "mat"]) as recorder:
        for i in range(ROWS):
            for name, values in WANTED.items():
                arrays[name][:] = values[i]
            recorder(i / 10, signals)
    return file


WANTED: dict[str, list[Any]] = {
    "x": [[i / 3, -i * 1e-300] for i in range(ROWS)],
    "single": [float(np.float32(i / 3)) for i in range(ROWS)],
    "n": [-(2**63) + i for i in range(ROWS)],
    "small": [i % 256 - 128 for i in range(ROWS)],
    "large": [2**64 - 1 - i for i in range(ROWS)],
    "on": [i % 3 == 0 for i in range(ROWS)],
}


def test_parquet_holds_every_kind_of_number_exactly(recorded: Path):
    record = Record(recorded)
    assert {name: record[f"unit.{name}"].tolist() for name in WANTED} == WANTED


def test_csv_has_time_first_units_in_its_title_and_every_number_exactly(recorded: Path):
    with open(recorded.with_suffix(".csv"), encoding="utf-8", newline="") as file:
        title, *rows = csv.reader(file)
    assert title[:3] == ["time [s]", "unit.x[1] [m]", "unit.x[2] [m]"]
    named = {name: [row[i] for row in rows] for i, name in enumerate(title)}
    assert [float(v) for v in named["time [s]"]] == [i / 10 for i in range(ROWS)]
    entries = zip(named["unit.x[1] [m]"], named["unit.x[2] [m]"], strict=True)
    assert [[float(v) for v in pair] for pair in entries] == WANTED["x"]
    for name in ("n", "large"):
        assert [int(v) for v in named[f"unit.{name} [m]"]] == WANTED[name]
    assert named["unit.on [m]"] == ["true" if on else "false" for on in WANTED["on"]]


@settings(max_examples=20)
@given(st.lists(st.integers(0, 2**64 - 1), min_size=1, max_size=80))
def test_csv_gives_any_double_back(tmp_path_factory: pytest.TempPathFactory, bits: list[int]):
    file, x = tmp_path_factory.mktemp("doubles") / "signals.parquet", np.zeros(1)
    signals = signals_of({"x": x})
    numbers = np.array(bits, dtype=np.uint64).view(np.float64)
    with Recorder(file, ["csv"]) as recorder:
        for number in numbers:
            x[:] = number
            recorder(0.0, signals)
    with open(file.with_suffix(".csv"), encoding="utf-8", newline="") as lines:
        read = [float(row[1]) for row in list(csv.reader(lines))[1:]]
    np.testing.assert_array_equal(np.array(read), numbers)
    assert [struct.pack("<d", v) for v in read if v == v] == [struct.pack("<d", v) for v in numbers if v == v]


def test_mat_is_read_by_a_reader_of_modelica_results(recorded: Path):
    file = recorded.with_suffix(".mat")
    result: Any = DyMat.DyMatFile(str(file))
    time, name, _ = result.abscissa(2)
    assert name == "time"
    assert time.tolist() == [i / 10 for i in range(ROWS)]
    found = {name.removeprefix("unit."): result.data(name).tolist() for name in result.names()}
    x = {f"x[{k + 1}]": [pair[k] for pair in WANTED["x"]] for k in range(2)}
    assert found == x | {name: [float(v) for v in WANTED[name]] for name in WANTED if name != "x"}
    assert result.description("unit.x[1]").startswith("a length in ")
    assert result.description("unit.x[1]").endswith("m [m]")
    matrices: dict[str, Any] = scipy.io.loadmat(file)
    assert [row.rstrip() for row in matrices["Aclass"]] == ["Atrajectory", "1.1", "", "binTrans"]
    order = [name for name, _, _ in scipy.io.whosmat(file)]
    assert order == ["Aclass", "name", "description", "dataInfo", "data_1", "data_2"]
    assert matrices["dataInfo"].tolist() == [[0, *[2] * 7], [1, 2, 3, 4, 5, 6, 7, 8], [0] * 8, [-1] * 8]
    assert matrices["data_1"].tolist() == [[0.0, (ROWS - 1) / 10]]
    assert matrices["data_2"].shape == (8, ROWS)


def test_an_enumeration_has_its_items_in_the_description(tmp_path: Path):
    light = np.ones(1, dtype=np.int64)
    facts = {"kind": Kind.ENUMERATION, "items": (("RED", 1), ("GREEN", 2)), "description": "a light"}
    with Recorder(tmp_path / "signals.parquet", ["mat", "csv"]) as recorder:
        recorder(0.0, signals_of({"light": light}, **facts))
    result: Any = DyMat.DyMatFile(str(tmp_path / "signals.mat"))
    assert result.description("unit.light") == "a light (1 RED, 2 GREEN)"
    record = Record(tmp_path / "signals.parquet")
    assert (record.items("unit.light"), record.items("time")) == ({1: "RED", 2: "GREEN"}, {})
    assert (tmp_path / "signals.csv").read_text().splitlines()[1] == "0,1"
